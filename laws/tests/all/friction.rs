//! Friction of the bearing: it must dissipate energy, be odd, and be continuous where the law is.

use freeplay_laws::{ContactFriction, FrictionLaw};

fn friction(law: FrictionLaw) -> ContactFriction {
    ContactFriction {
        law,
        static_coefficient: 0.015,
        dynamic_coefficient: 0.01,
        static_speed: 1e-3,
        dynamic_speed: 1e-2,
    }
}

const MEANT: [FrictionLaw; 3] = [FrictionLaw::Corrected, FrictionLaw::Ambrosio, FrictionLaw::Threlfall];

fn speeds() -> impl Iterator<Item = f64> {
    (-4000..=4000).map(|k| f64::from(k) * 1e-5)
}

#[test]
fn friction_never_feeds_energy_in() {
    for law in MEANT {
        let friction = friction(law);
        let mut opposed = 0;
        for v in speeds() {
            let power = friction.force(100.0, v) * v;
            assert!(power <= 0.0, "{law:?} at {v} m/s: {power} W");
            opposed += u32::from(power < 0.0);
        }
        assert!(opposed > 7000, "{law:?} does something: {opposed}");
    }
}

#[test]
fn the_printed_law_does_feed_energy_in() {
    let friction = friction(FrictionLaw::Printed);
    assert!(friction.force(100.0, 0.02) * 0.02 > 0.0);
    assert!(friction.force(100.0, 5e-4) * 5e-4 > 0.0);
    assert!(friction.force(100.0, -0.02) * -0.02 > 0.0);
}

#[test]
fn friction_is_odd_and_continuous() {
    for law in MEANT {
        let friction = friction(law);
        for v in speeds() {
            assert!((friction.coefficient(v) + friction.coefficient(-v)).abs() < 1e-17);
        }
        for edge in [0.0, 1e-3, 1e-2] {
            let gap = (friction.coefficient(edge + 1e-12) - friction.coefficient(edge - 1e-12)).abs();
            println!("{law:?} at {edge} m/s: jump {gap:.1e}");
            assert!(gap < 1e-9, "{law:?} jumps by {gap} at {edge}");
        }
    }
}

#[test]
fn the_corrected_law_has_its_printed_values_and_no_kink() {
    let friction = friction(FrictionLaw::Corrected);
    assert!((friction.coefficient(1e-3) - 0.015).abs() < 1e-15);
    assert!((friction.coefficient(1e-2) - 0.01).abs() < 1e-15);
    assert!((friction.coefficient(1.0) - 0.01).abs() < 1e-15);
    let slope = |v: f64| (friction.coefficient(v + 1e-8) - friction.coefficient(v)) / 1e-8;
    for edge in [1e-3, 1e-2] {
        let (left, right) = (slope(edge - 1e-8), slope(edge));
        println!("slopes at {edge} m/s: {left:.2e}, {right:.2e} 1/(m/s)");
        assert!((left - right).abs() < 1e-3);
    }
}

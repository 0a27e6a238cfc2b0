//! The normal law against closed forms: stiffness, Hertz's impact, and the restitution of each law.

use freeplay_laws::{Material, NormalContact, NormalLaw, hertz_stiffness};

const ALUMINIUM: Material = Material { young: 71.7e9, poisson: 0.33 };

fn stiffness(c: f64) -> f64 {
    hertz_stiffness(ALUMINIUM, ALUMINIUM, 0.010, 0.010 - c)
}

#[test]
fn stiffness_agrees_with_equation_4() {
    for (c, expected) in [(0.2e-3, 3.7549e10), (0.4e-3, 2.6279e10), (0.6e-3, 2.1232e10)] {
        let got = stiffness(c);
        println!("c = {c}: K = {got:.6e}, expected {expected:.4e}");
        assert!((got / expected - 1.0).abs() < 2e-5);
    }
    // The fifteen digits of the reference runs.
    for (c, expected) in
        [(0.2e-3, 37549096622.15234), (0.4e-3, 26278893436.210533), (0.6e-3, 21231943730.984646)]
    {
        let margin = (stiffness(c) / expected - 1.0).abs();
        println!("c = {c}: margin {margin:.1e} of 1e-12");
        assert!(margin < 1e-12);
    }
    let steel = Material { young: 207e9, poisson: 0.3 };
    let got = hertz_stiffness(steel, steel, 0.010, 0.0095);
    assert!((got / 6.6102e10 - 1.0).abs() < 1e-5, "steel, c = 0.5 mm: {got:e}");
}

/// One free impact of a mass on the contact: (restitution, duration, peak force, peak penetration), by RK4.
fn impact(contact: &NormalContact, mass: f64, speed: f64, step: f64) -> [f64; 4] {
    let accelerate = |x: f64, v: f64| -contact.force(x.max(0.0), v, speed) / mass;
    let (mut x, mut v, mut t, mut peak, mut deepest) = (0.0_f64, speed, 0.0_f64, 0.0_f64, 0.0_f64);
    loop {
        let (k1x, k1v) = (v, accelerate(x, v));
        let (k2x, k2v) = (v + 0.5 * step * k1v, accelerate(x + 0.5 * step * k1x, v + 0.5 * step * k1v));
        let (k3x, k3v) = (v + 0.5 * step * k2v, accelerate(x + 0.5 * step * k2x, v + 0.5 * step * k2v));
        let (k4x, k4v) = (v + step * k3v, accelerate(x + step * k3x, v + step * k3v));
        let (next_x, next_v) = (
            x + step / 6.0 * (k1x + 2.0 * k2x + 2.0 * k3x + k4x),
            v + step / 6.0 * (k1v + 2.0 * k2v + 2.0 * k3v + k4v),
        );
        if next_x <= 0.0 {
            return [-next_v / speed, t + step * x / (x - next_x), peak, deepest];
        }
        (x, v, t) = (next_x, next_v, t + step);
        peak = peak.max(contact.force(x, v, speed));
        deepest = deepest.max(x);
    }
}

#[test]
fn every_law_returns_the_restitution_of_its_closed_form() {
    let oracle: serde_json::Value =
        serde_json::from_str(include_str!("data/ln_restitution.json")).expect("oracle");
    let laws = [
        ("Lankarani", NormalLaw::LankaraniNikravesh),
        ("Hunt", NormalLaw::HuntCrossley),
        ("Hu-Guo", NormalLaw::HuGuo),
        ("Flores", NormalLaw::Flores),
        ("Gonthier", NormalLaw::Gonthier),
        ("Herbert", NormalLaw::HerbertMcwhannell),
        ("Lee", NormalLaw::LeeWang),
    ];
    let (mut compared, mut worst) = (0, 0.0_f64);
    for (name, table) in oracle.as_object().expect("laws") {
        let (_, law) = laws.iter().find(|(prefix, _)| name.starts_with(prefix)).expect("a law we have");
        for (e, returned) in table.as_object().expect("restitutions") {
            let contact = NormalContact::new(3.7549e10, *law, e.parse().expect("number"));
            let [got, ..] = impact(&contact, 2.22, 0.062_641_8, 1e-8);
            worst = worst.max((got - returned.as_f64().expect("number")).abs());
            compared += 1;
        }
    }
    println!("{compared} restitutions, worst margin {worst:.1e} of 1e-6");
    assert_eq!(compared, 77);
    assert!(worst < 1e-6);
}

#[test]
fn the_restitution_does_not_depend_on_mass_stiffness_or_speed() {
    let reference = impact(&NormalContact::new(3.7549e10, NormalLaw::default(), 0.9), 2.22, 0.0626, 1e-8)[0];
    for (stiffness, mass, speed) in [(3.7549e10, 22.2, 0.0626), (2e9, 2.22, 0.0626), (3.7549e10, 2.22, 1.5)] {
        let got = impact(&NormalContact::new(stiffness, NormalLaw::default(), 0.9), mass, speed, 1e-8)[0];
        println!("K = {stiffness:e}, m = {mass}, v = {speed}: margin {:.1e}", (got - reference).abs());
        assert!((got - reference).abs() < 2e-6);
    }
}

#[test]
fn an_impact_has_the_reference_duration_depth_and_force() {
    let contact = NormalContact::new(3.7549e10, NormalLaw::default(), 0.9);
    let [e, duration, force, depth] = impact(&contact, 2.22, 0.062_641_8, 1e-8);
    println!("e' {e:.6}, {duration:.9} s, {force:.3} N, {:.5} um", depth * 1e6);
    assert!((e - 0.913_177).abs() < 1e-6);
    assert!((duration - 0.458_349e-3).abs() < 1e-8);
    assert!((depth - 9.318_74e-6).abs() < 1e-10);
    // The reference took the peak from its output steps: five digits.
    assert!((force - 1076.325).abs() < 0.05);
}

#[test]
fn an_elastic_impact_is_hertz() {
    for (c, v, depth, force, duration) in
        [(0.2e-3, 0.062_642, 9.660e-6, 1127.3, 0.4539e-3), (0.6e-3, 0.108_499, 18.830e-6, 1734.9, 0.5108e-3)]
    {
        let contact = NormalContact::new(stiffness(c), NormalLaw::default(), 1.0);
        let got = impact(&contact, 2.22, v, 1e-8);
        let closed = (5.0 * 2.22 * v * v / (4.0 * contact.stiffness)).powf(0.4);
        assert!((got[0] - 1.0).abs() < 1e-6, "elastic: {}", got[0]);
        assert!((got[3] / closed - 1.0).abs() < 1e-6, "depth {} against {closed}", got[3]);
        assert!((got[3] / depth - 1.0).abs() < 1e-3 && (got[2] / force - 1.0).abs() < 1e-3);
        assert!(
            (got[1] / duration - 1.0).abs() < 1e-3 && (got[1] / (2.943_28 * closed / v) - 1.0).abs() < 1e-5
        );
    }
}

#[test]
fn the_contact_never_pulls_and_stores_what_its_elastic_force_says() {
    let contact = NormalContact::new(2e10, NormalLaw::HuGuo, 0.3);
    assert!(contact.damping > 1.0, "this law would pull if it were let");
    assert_eq!(contact.force(1e-6, -1.0, 0.1), 0.0);
    let (x, h) = (1e-5, 1e-9);
    let slope = (contact.elastic_energy(x + h) - contact.elastic_energy(x - h)) / (2.0 * h);
    assert!((slope / contact.elastic_force(x) - 1.0).abs() < 1e-6);
    assert!((contact.static_penetration(contact.elastic_force(x)) / x - 1.0).abs() < 1e-12);
}

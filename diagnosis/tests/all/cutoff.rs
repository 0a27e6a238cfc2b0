//! Noise of the motion lowers the cutoff; nothing else does.

use std::f64::consts::{PI, TAU};

use freeplay_arm::{Arm, JointFriction, JointKind};
use freeplay_diagnosis::{Settings, compare, default_cutoff_hz};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::common::{arm, columns, columns_along, even, link, nothing, recording, sines};

const RATE_HZ: f64 = 500.0;
/// Frequency of the shaking, Hz.
const SHAKES_HZ: f64 = 9.7;
const SHAKE: f64 = 2e-3;

type Columns = Vec<(String, Vec<f64>)>;

fn two_joints() -> Arm {
    let joint = |name| link(name, JointKind::Revolute, JointFriction::default());
    arm(vec![joint("shoulder"), joint("elbow")])
}

/// The sines with every joint shaking.
fn shaken(arm: &Arm, t: f64) -> [Vec<f64>; 3] {
    let mut motion = sines(arm, t);
    let w = TAU * SHAKES_HZ;
    let (sin, cos) = (w * t).sin_cos();
    for (column, shake) in motion.iter_mut().zip([sin, w * cos, -w * w * sin]) {
        column.iter_mut().for_each(|x| *x += SHAKE * shake);
    }
    motion
}

/// Applies `work` to every torque.
fn torques(mut columns: Columns, work: impl Fn(&mut [f64])) -> Columns {
    columns.iter_mut().filter(|(name, _)| name.starts_with("tau")).for_each(|(_, column)| work(column));
    columns
}

/// The cutoff for these columns, Hz, and true if a note says that the program lowered it.
fn cutoff_hz(arm: &Arm, columns: Columns, settings: Settings) -> (f64, bool) {
    let (comparison, _) = compare(arm, &[], &recording(columns), &settings).expect("a comparison");
    (comparison.lowpass_hz, comparison.notes.iter().any(|note| note.contains("low-pass at")))
}

#[test]
fn noise_of_the_motion_lowers_the_cutoff() {
    let arm = two_joints();
    let t = even(20.0, RATE_HZ);
    let mut noisy = columns(&arm, &t, nothing);
    for (_, column) in noisy.iter_mut().filter(|(name, _)| name.starts_with('q')) {
        column.iter_mut().zip(&t).for_each(|(q, t)| *q += SHAKE * (TAU * SHAKES_HZ * t).sin());
    }
    let (lowered_hz, is_noted) = cutoff_hz(&arm, noisy.clone(), Settings::default());
    println!("noise at {SHAKES_HZ} Hz: low-pass at {lowered_hz:.1} Hz");
    assert!(lowered_hz < SHAKES_HZ && is_noted);
    let (chosen_hz, is_noted) = cutoff_hz(&arm, noisy, Settings { lowpass_hz: Some(15.0), trim_s: None });
    assert!(chosen_hz == 15.0 && !is_noted, "a cutoff that was asked for stays");
}

#[test]
fn what_takes_torque_away_in_proportion_does_not() {
    let arm = two_joints();
    let made = || columns_along(shaken, &arm, &even(20.0, RATE_HZ), nothing);
    let slow_sensor = |column: &mut [f64]| {
        let share = 1.0 - (-2.0 * PI * 4.0 / RATE_HZ).exp();
        let mut y = column[0];
        for x in column {
            y += share * (*x - y);
            *x = y;
        }
    };
    let clipped = |column: &mut [f64]| {
        let most = column.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        column.iter_mut().for_each(|x| *x = x.clamp(-0.6 * most, 0.6 * most));
    };
    let cases = [
        ("as the motion asks", made()),
        ("through a sensor of 4 Hz", torques(made(), slow_sensor)),
        ("by a drive that clips", torques(made(), clipped)),
        ("with half the gain", torques(made(), |column| column.iter_mut().for_each(|x| *x *= 0.5))),
    ];
    for (name, columns) in cases {
        let (hz, is_noted) = cutoff_hz(&arm, columns, Settings::default());
        println!("torque {name}: low-pass at {hz:.1} Hz");
        assert!((hz - default_cutoff_hz(RATE_HZ)).abs() < 1e-6 && !is_noted, "{name}");
    }
}

/// At a kilohertz the low-pass passes 30 Hz, where 10⁻⁵ rad of noise cause more torque than was measured there, although little of the whole torque.
#[test]
fn bands_above_a_motion_that_hold_noise_alone_are_left_out() {
    const FAST_HZ: f64 = 1000.0;
    const ENCODER: f64 = 1e-5;
    let arm = two_joints();
    let mut noisy = columns(&arm, &even(12.0, FAST_HZ), nothing);
    let mut rng = ChaCha8Rng::seed_from_u64(42);
    for (_, column) in noisy.iter_mut().filter(|(name, _)| name.starts_with('q')) {
        for q in column {
            let noise: f64 = StandardNormal.sample(&mut rng);
            *q += ENCODER * noise;
        }
    }
    let (hz, is_noted) = cutoff_hz(&arm, noisy, Settings::default());
    println!(
        "low-pass at {hz:.1} Hz, 10 to 20 Hz expected, {:.1} Hz without noise",
        default_cutoff_hz(FAST_HZ)
    );
    assert!((10.0..20.0).contains(&hz) && is_noted);
}

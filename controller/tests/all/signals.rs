//! Tests of the moving average with its look ahead, and of derivatives by centred differences.

use std::f64::consts::PI;

use freeplay_controller::{Centred, CentredAverage};

#[test]
fn the_average_is_that_of_the_window() {
    let signal = |tick: i32| [f64::from(tick).sin(), f64::from(tick * tick)];
    let mut preview = CentredAverage::new(3, 2);
    assert_eq!(preview.half_width(), 3);
    for tick in 0..7 {
        preview.push(signal(tick));
    }
    for newest in 7..40 {
        preview.push(signal(newest));
        let mut mean = [0.0; 2];
        preview.mean(&mut mean);
        for (part, mean) in mean.into_iter().enumerate() {
            let weight = |tick: i32| (PI * f64::from(tick - newest + 7) / 8.0).sin().powi(2);
            let window = newest - 6..=newest;
            let sum: f64 = window.clone().map(weight).sum();
            let expected = window.map(|tick| weight(tick) * signal(tick)[part]).sum::<f64>() / sum;
            assert!((mean - expected).abs() < 1e-12 * expected.abs().max(1.0), "{mean} is not {expected}");
        }
    }
}

#[test]
fn centred_differences_are_exact_for_a_parabola() {
    let (period, mut course) = (1e-3, Centred::new(1, 1e-3));
    course.clear();
    let parabola =
        |tick: i32| 3.0 + 2.0 * f64::from(tick) * period - 5.0 * (f64::from(tick) * period).powi(2);
    for tick in 0..10 {
        course.push(&[parabola(tick)]);
        let motion = course.motion();
        if tick < 3 {
            assert_eq!((motion.v[0], motion.a[0]), (0.0, 0.0), "no derivatives before four values");
        } else {
            let t = f64::from(tick - 2) * period;
            let errors =
                [motion.q[0] - parabola(tick - 2), motion.v[0] - (2.0 - 10.0 * t), motion.a[0] + 10.0];
            println!("{errors:?} (limits 1e-15, 1e-11, 1e-8)");
            assert!(errors[0].abs() < 1e-15 && errors[1].abs() < 1e-11 && errors[2].abs() < 1e-8);
        }
    }
    course.rest(&[7.0]);
    assert_eq!((course.motion().q[0], course.motion().v[0], course.motion().a[0]), (7.0, 0.0, 0.0));
    course.push(&[7.0 + 1e-6]);
    assert_eq!(course.motion().a[0], 0.0, "it is a tick too early to accelerate");
    assert!((course.held()[0] - 0.5).abs() < 1e-6, "half-way to where it does: {}", course.held()[0]);
    course.push(&[7.0 + 2e-6]);
    let a = course.motion().a[0];
    assert!((a - 1.0).abs() < 1e-6, "what was at rest accelerates: {a}");
}

/// The held acceleration leads from velocity to velocity: a motion that starts on a sine stays on it.
#[test]
fn what_is_held_leads_along_the_signal() {
    let (period, mut course) = (1e-3, Centred::new(1, 1e-3));
    let signal = |tick: i32| (30.0 * f64::from(tick) * period).sin();
    course.clear();
    let (mut state, mut late, mut worst, mut worst_late): (Option<[f64; 2]>, [f64; 2], f64, f64) =
        (None, [0.0; 2], 0.0, 0.0);
    for newest in 0..300 {
        course.push(&[signal(newest)]);
        if newest < 3 {
            continue;
        }
        let motion = course.motion();
        let moved = |[q, v]: [f64; 2], a: f64| [q + (v + 0.5 * a * period) * period, v + a * period];
        let [q, v] = state.unwrap_or([motion.q[0], motion.v[0]]);
        if state.is_none() {
            late = [q, v];
        }
        worst = worst.max((q - motion.q[0]).abs());
        worst_late = worst_late.max((late[0] - motion.q[0]).abs());
        late = moved(late, motion.a[0]);
        state = Some(moved([q, v], course.held()[0]));
    }
    println!("off by {worst:.1e}; with the acceleration at the start of each tick held, by {worst_late:.1e}");
    // The expected errors are half a tick of the change of velocity, 60/s × 0.5 ms, and a quarter of a squared tick of that of acceleration,
    // 1800/s² × 0.25 µs².
    assert!(worst_late > 0.02, "holding the acceleration of the start is late");
    assert!(worst < 5e-4, "what is held leads along the signal");
}

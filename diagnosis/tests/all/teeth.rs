//! Damaged teeth: a joint meets the same torque whenever it passes a place.

use freeplay_diagnosis::Verdict;

use crate::generated::of_three_axes;

/// Each passage by itself looks like a push.
#[test]
fn a_torque_that_recurs_at_a_place_is_no_push() {
    for seed in 1..=2 {
        let diagnosis = of_three_axes("broken_tooth", 2, seed);
        let named: Vec<&str> = diagnosis.effects.iter().map(|effect| effect.kind).collect();
        println!("{:?}: {named:?}", diagnosis.verdict);
        assert_eq!(diagnosis.verdict, Verdict::Unknown);
        assert!(!named.contains(&"external_torque"));
    }
}

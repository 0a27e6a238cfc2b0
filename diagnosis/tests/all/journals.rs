//! Journals with play in bearings of vertical axes, where no load presses them to one side.

use crate::generated::of_three_axes;

/// A recorded motion does not determine the end of a bounce, and the mean of many bounces looks like a film of oil.
#[test]
fn a_journal_that_bounces_is_told_from_one_in_oil() {
    for kind in ["joint_clearance", "lubricated_clearance"] {
        let named: Vec<&str> = of_three_axes(kind, 0, 1).effects.iter().map(|effect| effect.kind).collect();
        println!("{kind}: {named:?}");
        assert_eq!(named, [kind]);
    }
}

//! Evaluating a path allocates nothing: it runs inside the loop.

use crate::common;
use freeplay_path::{JointPath, PathKind, PathSpec};

#[test]
fn evaluation_allocates_nothing() {
    let arm = common::paper_arm();
    let spec = PathSpec { kind: PathKind::Square, period: 1.0, laps: 2, ..PathSpec::default() };
    let mut path = None;
    let planning = allocation_counter::measure(|| path = JointPath::plan(&arm, &spec, 1000.0).ok());
    assert!(planning.count_total > 0, "the counter counts");
    let path = path.expect("the path is reachable");
    let (mut q, mut v, mut a) = ([0.0; 6], [0.0; 6], [0.0; 6]);
    let running = allocation_counter::measure(|| {
        for k in -100..2200 {
            path.at(f64::from(k) * 1e-3, &mut q, &mut v, &mut a);
        }
    });
    println!("allocations: planning {}, 2300 evaluations {}", planning.count_total, running.count_total);
    assert_eq!(running.count_total, 0);
}

//! Which joint of a recording is which of the arm: by name, where both have names.

use freeplay_arm::{Arm, match_joints};
use freeplay_recording::Recording;

/// The key under which a recording names its joints, separated by commas.
const JOINTS: &str = "joints";

/// The names of the joints of `recording` in the order of its columns; none where it does not name all of them.
pub fn joint_names(recording: &Recording) -> Vec<String> {
    let given = recording.metadata.iter().find(|(key, _)| key == JOINTS).map(|(_, names)| names.as_str());
    let names: Vec<String> =
        given.into_iter().flat_map(|names| names.split(',')).map(str::to_owned).collect();
    if names.len() == recording.joints() { names } else { Vec::new() }
}

/// Puts the joints of `recording` into the order of `arm` and drops those that are not its own, if it names all of the arm's.
pub fn by_name(recording: &mut Recording, arm: &Arm) {
    let names = joint_names(recording);
    let found = match_joints(&names, arm.joints().iter().map(|joint| joint.name.as_str()));
    let place = |joint: usize| found.iter().position(|match_| *match_ == Some(joint));
    let Some(order) = (0..arm.dof()).map(place).collect::<Option<Vec<usize>>>() else { return };
    if order.iter().copied().eq(0..names.len()) {
        return;
    }
    recording.q = chosen(&recording.q, &order);
    for group in [&mut recording.qd, &mut recording.tau, &mut recording.q_ref] {
        *group = group.as_ref().map(|columns| chosen(columns, &order));
    }
    recording.q_link = chosen(&recording.q_link, &order);
    let left: Vec<&str> =
        (0..names.len()).filter(|place| !order.contains(place)).map(|place| names[place].as_str()).collect();
    let taken = order.iter().map(|&place| names[place].as_str()).collect::<Vec<_>>().join(", ");
    let beside =
        if left.is_empty() { String::new() } else { format!("; not of the arm: {}", left.join(", ")) };
    recording.notes.push(format!("joints are matched by name: {taken}{beside}"));
    let kept = order.iter().map(|&place| names[place].clone()).collect::<Vec<_>>().join(",");
    for (key, value) in &mut recording.metadata {
        if key == JOINTS {
            value.clone_from(&kept);
        }
    }
}

/// The columns at `order`.
fn chosen<T: Clone>(columns: &[T], order: &[usize]) -> Vec<T> {
    order.iter().filter_map(|&place| columns.get(place)).cloned().collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use freeplay_arm::parse_urdf;
    use freeplay_recording::Recording;

    use super::{by_name, joint_names};

    const ROBOT: &str = r#"<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
        <joint name="pan" type="revolute"><parent link="a"/><child link="b"/></joint>
        <joint name="lift" type="revolute"><parent link="b"/><child link="c"/></joint></robot>"#;

    /// A recording of `names` in which q of joint k is k and its torque 10 k, k from 1.
    fn recording(names: &str) -> Recording {
        let count = names.split(',').count();
        let mut columns = vec![("t".to_owned(), vec![0.0, 1.0])];
        for joint in 1..=count {
            columns.push((format!("q{joint}"), vec![joint as f64; 2]));
            columns.push((format!("tau{joint}"), vec![10.0 * joint as f64; 2]));
        }
        let mut recording = Recording::new(Path::new("r.mcap"), columns).expect("a recording");
        recording.metadata.push(("joints".to_owned(), names.to_owned()));
        recording
    }

    #[test]
    fn joints_are_put_into_the_order_of_the_arm_by_their_names() {
        let arm = parse_urdf(ROBOT, "r.urdf").expect("an arm").arm;
        for names in ["finger,ur_lift,ur_pan", "finger,lift,pan"] {
            let mut recording = recording(names);
            by_name(&mut recording, &arm);
            assert_eq!((recording.joints(), recording.q[0][0], recording.q[1][0]), (2, 3.0, 2.0));
            assert_eq!(recording.tau.as_ref().map(|tau| tau[0][1]), Some(30.0));
            assert_eq!(joint_names(&recording).len(), 2);
            assert!(recording.notes.iter().any(|note| note.contains("not of the arm: finger")));
        }
        for names in ["pan,lift", "one,two", "pan,two"] {
            let (mut changed, before) = (recording(names), recording(names));
            by_name(&mut changed, &arm);
            assert_eq!((changed.q, changed.notes), (before.q, before.notes), "{names}");
        }
    }
}

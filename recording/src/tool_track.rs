//! The poses of a tool over time, interpolated to other times.

use serde::Deserialize;

/// A position, m.
#[derive(Clone, Copy, Debug, Deserialize)]
struct Point {
    x: f64,
    y: f64,
    z: f64,
}

/// A unit quaternion.
#[derive(Clone, Copy, Debug, Deserialize)]
struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

/// `geometry_msgs/msg/Pose`.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(crate) struct Pose {
    position: Point,
    orientation: Quaternion,
}

impl Pose {
    /// The pose of the numbers x, y, z, qx, qy, qz, qw.
    pub fn of([x, y, z, qx, qy, qz, qw]: [f64; 7]) -> Self {
        Self { position: Point { x, y, z }, orientation: Quaternion { x: qx, y: qy, z: qz, w: qw } }
    }

    fn numbers(self) -> [f64; 7] {
        let (p, o) = (self.position, self.orientation);
        [p.x, p.y, p.z, o.x, o.y, o.z, o.w]
    }
}

/// The poses of a tool over time.
pub(crate) struct ToolTrack {
    topic: String,
    /// Time, ns, increasing, and pose.
    poses: Vec<(i64, [f64; 7])>,
}

impl ToolTrack {
    /// A track of these poses, sorted by time; of several at one time the first counts.
    pub fn new(topic: &str, poses: Vec<(i64, Pose)>) -> Self {
        let mut poses: Vec<_> = poses.into_iter().map(|(time, pose)| (time, pose.numbers())).collect();
        poses.sort_by_key(|(time, _)| *time);
        poses.dedup_by_key(|(time, _)| *time);
        ToolTrack { topic: topic.to_owned(), poses }
    }

    /// The pose at `time`, ns: linear interpolation of positions; orientations along the chord between the nearer signs, normalised. `None` outside the track.
    pub fn at(&self, time: i64) -> Option<[f64; 7]> {
        let after = self.poses.partition_point(|(t, _)| *t < time);
        let (t1, b) = self.poses.get(after)?;
        if *t1 == time {
            return Some(*b);
        }
        let (t0, a) = self.poses.get(after.checked_sub(1)?)?;
        let share = (time - t0) as f64 / (t1 - t0) as f64;
        let sign = if a[3..].iter().zip(&b[3..]).map(|(a, b)| a * b).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
        let mut pose = [0.0; 7];
        for (i, out) in pose.iter_mut().enumerate() {
            let end = if i < 3 { b[i] } else { sign * b[i] };
            *out = a[i] + share * (end - a[i]);
        }
        let size = pose[3..].iter().map(|part| part * part).sum::<f64>().sqrt();
        if size > 0.0 {
            pose[3..].iter_mut().for_each(|part| *part /= size);
        }
        Some(pose)
    }

    /// The source of the track, for people.
    pub fn in_words(&self) -> String {
        let widest = self.poses.windows(2).map(|pair| pair[1].0 - pair[0].0).max().unwrap_or(0);
        format!(
            "{} poses of {}, interpolated, at most {:.4} s apart",
            self.poses.len(),
            self.topic,
            widest as f64 * 1e-9
        )
    }
}

#[cfg(test)]
mod tests {
    use super::{Point, Pose, Quaternion, ToolTrack};

    #[test]
    fn positions_are_linear_and_orientations_stay_unit_whatever_their_sign() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let pose = |x: f64, z: f64, w: f64| Pose {
            position: Point { x, y: 1.0, z: -x },
            orientation: Quaternion { x: 0.0, y: 0.0, z, w },
        };
        // From zero to a quarter turn about z, the second with the other sign.
        let track = ToolTrack::new("/pose", vec![(1000, pose(3.0, -half, -half)), (0, pose(1.0, 0.0, 1.0))]);
        let middle = track.at(500).expect("within the track");
        let eighth = std::f64::consts::PI / 8.0;
        let expected = [2.0, 1.0, -2.0, 0.0, 0.0, eighth.sin(), eighth.cos()];
        for (found, expected) in middle.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-15, "{middle:?}");
        }
        assert!(track.at(-1).is_none() && track.at(1001).is_none());
        assert_eq!(track.at(0).map(|pose| pose[0]), Some(1.0));
    }
}

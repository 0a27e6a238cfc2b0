//! The kinds of set-up faults, one file each with the same sections: what it asks, what the hypothesis changes, words, remedy.

pub(crate) mod angle_wrap;
pub(crate) mod torque_unit;

use freeplay_arm::{Arm, JointKind};
use nalgebra::Vector3;

use super::change::Change;
use super::problem::Outcome;
use super::search::{groups, physics};

/// What a kind may look at before it asks.
pub(crate) struct Ask<'a> {
    pub arm: &'a Arm,
    pub has_torques: bool,
    pub has_tool: bool,
    /// The best set so far.
    pub best: &'a Outcome,
}

/// All that can be asked.
pub(crate) fn asks(ask: &Ask) -> Vec<Change> {
    let n = ask.arm.dof();
    let mut all = vec![Change::AngleUnit];
    for j in 0..n {
        all.extend((j + 1..n).map(|k| Change::Exchange(j, k)));
        all.extend([true, false].map(|with_torque| Change::Direction { joint: j, with_torque }));
        let kind = ask.arm.joints()[j].kind;
        if kind == JointKind::Revolute {
            all.extend((-5..=6).filter(|k| *k != 0).map(|k| Change::Zero {
                joint: j,
                offset: f64::from(k) * std::f64::consts::PI / 6.0,
                is_fitted: k % 3 != 0,
            }));
        }
        if j > 0 {
            all.extend([1.0, -1.0].map(|factor| Change::Relative { joint: j, other: j - 1, factor }));
        }
        if ask.has_torques {
            all.push(Change::TorqueSign(j));
            all.push(Change::Scale(j));
            for k in (0..n).filter(|k| *k != j) {
                if (ask.best.scale[k] - 1.0).abs() > 1e-9 {
                    all.push(Change::SameScale(j, ask.best.scale[k]));
                }
            }
        }
    }
    if ask.has_torques {
        all.push(Change::CommonScale);
        all.extend([Change::AnyGravity, Change::Compensated]);
        let size = ask.arm.gravity().norm();
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            for sign in [1.0, -1.0] {
                let g = axis * (sign * size);
                if (g - ask.arm.gravity()).norm() > 1e-6 * size {
                    all.push(Change::Gravity(g));
                }
            }
        }
        all.extend(physics(n));
    }
    for late in groups(ask.has_torques, ask.has_tool) {
        all.extend((-15..=15).filter(|k| *k != 0).map(|k| Change::Delay(late, f64::from(k) * 0.03)));
    }
    all
}

//! Requirements on a recording that identifies an effect, and missing requirements in words.

use freeplay_arm::JointKind;

use crate::place::{Place, Site};
use crate::scene::torque_unit;

/// The recorded channels besides the motion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recorded {
    /// Joint torques.
    pub torque: bool,
    /// Tool position.
    pub tool: bool,
    /// Link-side encoder, by joint; may be shorter than the arm.
    pub link: Vec<bool>,
}

/// One requirement on a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Need {
    /// Measured torques.
    Torque,
    /// The tool's position.
    Tool,
    /// The tool's position, or the joint's link encoder.
    Pose,
    /// Measured torques, or a pose channel.
    TorqueOrPose,
    /// The joint moves.
    Motion,
    /// At least this number of changes of the joint's direction.
    Reversals(usize),
    /// The speed of the fastest tenth of the moving samples is at least this multiple of that of the slowest tenth.
    Speeds(f64),
    /// The model's load on the joint changes by at least this share of its greatest amount.
    LoadRange(f64),
    /// The model's load on the joint changes its sign.
    LoadReversal,
    /// The joint covers at least this number of its own turns (m for a prismatic joint's pitch of 1 m).
    Turns(f64),
    /// The joint moves over at least this range, rad (m).
    Travel(f64),
    /// At least this duration, s.
    Duration(f64),
    /// The arm file names friction for the joint.
    NominalFriction,
}

/// Speed below which a joint counts as at rest, rad/s (m/s).
const STILL: f64 = 1e-4;

impl Need {
    /// True if the requirement concerns a motion that distinguishes the effect from equally simple ones. If the motion keeps the quantity
    /// of a law constant, the law reduces to a simpler one.
    pub(crate) fn is_coverage(self) -> bool {
        matches!(self, Need::Reversals(_) | Need::Speeds(_))
    }

    pub(crate) fn missing(
        self,
        place: &Place,
        recorded: &Recorded,
        site: Site,
        name: &str,
    ) -> Option<String> {
        let link = match (site, place.joint) {
            (Site::Arm, _) | (_, None) => recorded.link.contains(&true),
            (_, Some(joint)) => recorded.link.get(joint).copied().unwrap_or(false),
        };
        let pose = recorded.tool || link;
        match self {
            Need::Torque => (!recorded.torque).then(|| "no torque was recorded (tau1…)".to_owned()),
            Need::Tool => {
                (!recorded.tool).then(|| "the tool's position (x, y, z) was not recorded".to_owned())
            }
            Need::Pose => (!pose).then(|| {
                format!(
                    "neither the tool's position (x, y, z) nor the link side of {name} (q_link) was recorded"
                )
            }),
            Need::TorqueOrPose => (!pose && !recorded.torque).then(|| {
                "neither torques nor the tool's position nor link encoders were recorded".to_owned()
            }),
            Need::Duration(least) => {
                let stretches = &place.scene.motion.stretches;
                let t = &place.scene.motion.t;
                let lasts: f64 = stretches.iter().map(|s| t[s.end - 1] - t[s.start]).sum();
                (lasts < least)
                    .then(|| format!("the recording lasts only {lasts:.1} s; {least:.0} s are needed"))
            }
            _ => place.joint.and_then(|joint| self.missing_of_motion(place, joint, name)),
        }
    }

    /// The requirement that the motion of `joint` does not meet.
    fn missing_of_motion(self, place: &Place, joint: usize, name: &str) -> Option<String> {
        let (q, v) = (&place.scene.motion.q[joint], &place.scene.motion.v[joint]);
        let load = &place.scene.load[joint];
        let (least, most) = extremes(q);
        let kind = place.scene.arm.joints()[joint].kind;
        let of_way = if kind == JointKind::Revolute { "rad" } else { "m" };
        let of_load = torque_unit(kind).replace('*', "·");
        match self {
            Need::Motion => (!v.iter().any(|v| v.abs() > STILL))
                .then(|| format!("{name} does not move in this recording")),
            Need::Reversals(needed) => {
                let found = reversals(v);
                (found < needed).then(|| {
                    format!(
                        "{name} changes its direction {found} time(s) in this recording; {needed} are needed"
                    )
                })
            }
            Need::Speeds(needed) => {
                let ratio = speed_ratio(&place.speeds());
                (ratio < needed).then(|| {
                    format!("{name} moves at nearly one speed (fast is {ratio:.1} times slow; {needed:.0} are needed)")
                })
            }
            Need::LoadRange(share) => {
                let (low, high) = extremes(load);
                let greatest = low.abs().max(high.abs());
                (high - low < share * greatest || greatest == 0.0).then(|| {
                    format!(
                        "the load of {name} hardly changes ({low:.3} to {high:.3} {of_load} by the model)"
                    )
                })
            }
            Need::LoadReversal => {
                let (low, high) = extremes(load);
                (low >= 0.0 || high <= 0.0).then(|| {
                    format!("the load of {name} never changes its sign ({low:.3} to {high:.3} {of_load} by the model)")
                })
            }
            Need::Turns(needed) => {
                let turns = (most - least) / std::f64::consts::TAU;
                (turns < needed).then(|| {
                    format!("{name} covers {turns:.2} of a turn; {needed:.2} are needed to see a period")
                })
            }
            Need::Travel(needed) => (most - least < needed).then(|| {
                format!("{name} moves over {:.4} {of_way} only; {needed} {of_way} are needed", most - least)
            }),
            Need::NominalFriction => {
                let friction = place.scene.arm.joints()[joint].friction;
                (friction.viscous == 0.0 && friction.coulomb == 0.0)
                    .then(|| format!("the arm file has no friction of {name} that could change"))
            }
            Need::Torque | Need::Tool | Need::Pose | Need::TorqueOrPose | Need::Duration(_) => None,
        }
    }
}

fn extremes(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), x| (least.min(*x), most.max(*x)))
}

/// Number of sign changes of the velocity, without rest.
pub fn reversals(v: &[f64]) -> usize {
    let mut last = 0.0;
    v.iter()
        .filter(|v| v.abs() > STILL)
        .filter(|v| {
            let turned = last * v.signum() < 0.0;
            last = v.signum();
            turned
        })
        .count()
}

/// Ninth decile over first decile of the speeds of a moving joint, `speeds` in ascending order; 1 at rest.
fn speed_ratio(speeds: &[f64]) -> f64 {
    let moving = &speeds[speeds.partition_point(|speed| *speed <= STILL)..];
    if moving.is_empty() {
        return 1.0;
    }
    let quantile = |share: f64| moving[((moving.len() - 1) as f64 * share) as usize];
    quantile(0.9) / quantile(0.1)
}

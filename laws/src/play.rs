//! The arm with play: two slides across the axis before every joint with clearance.
//!
//! The extended arm is an ordinary [`Arm`]; the dynamics are independent of clearances. Its coordinates are the nominal ones with the two
//! slides of each clearance inserted before that joint's own coordinate, in metres, in the plane across the joint's axis: e₁ along the
//! coordinate axis farthest from the joint's axis, e₂ = e₁ × axis.

use freeplay_arm::{Arm, Inertia, Joint, JointFriction, JointKind, Limits};
use nalgebra::{Unit, Vector3};

use crate::{Clearance, LawError};

/// One joint with play, and the indices of its coordinates in the extended arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Play {
    /// Index of the joint in the nominal arm.
    pub joint: usize,
    /// Indices of the two slides in the extended arm.
    pub slides: [usize; 2],
    /// Index of the joint itself in the extended arm.
    pub turn: usize,
    /// The contact in its bearing.
    pub clearance: Clearance,
}

/// The nominal arm with its plays, as an arm with more coordinates.
#[derive(Clone, Debug)]
pub struct ArmWithPlay {
    arm: Arm,
    joints: Vec<usize>,
    plays: Vec<Play>,
}

/// The two directions across `axis`, right-handed with e₂ = e₁ × axis.
pub(crate) fn across(axis: &Unit<Vector3<f64>>) -> [Unit<Vector3<f64>>; 2] {
    let farthest = (0..3).fold(0, |best, i| if axis[i].abs() < axis[best].abs() - 1e-12 { i } else { best });
    let basis = Vector3::ith(farthest, 1.0);
    let first = Unit::new_normalize(basis - axis.into_inner() * axis.dot(&basis));
    [first, Unit::new_normalize(first.cross(axis))]
}

fn slide(name: &str, axis: Unit<Vector3<f64>>) -> Joint {
    Joint {
        name: name.to_owned(),
        kind: JointKind::Prismatic,
        axis,
        placement: nalgebra::Isometry3::identity(),
        limits: Limits::NONE,
        friction: JointFriction { viscous: 0.0, coulomb: 0.0 },
        rotor_inertia: 0.0,
        inertia: Inertia::zero(),
    }
}

impl ArmWithPlay {
    /// The arm `nominal` with `clearances` by joint index, at most one per joint, in ascending order.
    ///
    /// # Errors
    /// [`LawError::Arm`] if the extended arm is impossible, for example without mass beyond a joint with play.
    pub fn new(nominal: &Arm, clearances: &[(usize, Clearance)]) -> Result<Self, LawError> {
        let mut arm = nominal.clone();
        let mut joints: Vec<usize> = (0..nominal.dof()).collect();
        let mut plays = Vec::with_capacity(clearances.len());
        for (inserted, &(joint, clearance)) in clearances.iter().enumerate() {
            let at = joint + 2 * inserted;
            let name = &nominal.joints()[joint].name;
            let [first, second] = across(&nominal.joints()[joint].axis);
            arm = arm.with_joint_inserted_before(at, slide(&format!("{name}_play_1"), first))?;
            arm = arm.with_joint_inserted_before(at + 1, slide(&format!("{name}_play_2"), second))?;
            joints[joint..].iter_mut().for_each(|index| *index += 2);
            plays.push(Play { joint, slides: [at, at + 1], turn: at + 2, clearance });
        }
        Ok(Self { arm, joints, plays })
    }

    /// The extended arm.
    pub fn arm(&self) -> &Arm {
        &self.arm
    }

    /// Number of joints of the nominal arm.
    pub fn nominal_dof(&self) -> usize {
        self.joints.len()
    }

    /// Index in the extended arm of the nominal joint `nominal`.
    pub fn joint(&self, nominal: usize) -> usize {
        self.joints[nominal]
    }

    /// The joints with play, in the order of the nominal joints.
    pub fn plays(&self) -> &[Play] {
        &self.plays
    }

    /// Writes nominal coordinates into extended ones; the slides keep their values.
    pub fn spread(&self, nominal: &[f64], extended: &mut [f64]) {
        for (&index, &value) in self.joints.iter().zip(nominal) {
            extended[index] = value;
        }
    }

    /// Copies the nominal coordinates out of extended ones.
    pub fn gather(&self, extended: &[f64], nominal: &mut [f64]) {
        for (value, &index) in nominal.iter_mut().zip(&self.joints) {
            *value = extended[index];
        }
    }
}

//! A magnetic detent: it pulls a joint into one position from both sides.
//!
//! Law: τ = T (x/w) exp(½ − x²/2w²), x = q − q₀ \[rad\], with T \[N·m\] the greatest torque, reached at x = ±w. The drive spends τ.
//! Source: the shape of a magnetic spring between two poles near its rest (Akoun & Yonnet 1984, IEEE Trans. Magn. 20:1962), as the gradient
//! of a Gaussian well. Departure: the law neglects losses.

use crate::joint_law::{AtJoint, Instant, JointLaw};
use crate::kind::{Kind, Occurrence, Seen, Terms, one_shape};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "detent",
    title: "a magnetic detent",
    words: "a detent of {torque} at {position}, {width} wide",
    site: Site::Joint,
    parameters: &[
        Parameter::number("torque", "greatest torque", "N*m", [0.0, 1e6]).prismatic("N"),
        Parameter::number("position", "position to which the detent pulls", "rad", [-1e3, 1e3])
            .prismatic("m"),
        Parameter::number("width", "distance from there to the greatest torque", "rad", [1e-6, 1e3])
            .prismatic("m"),
    ],
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::TORQUE,
    rough: false,
    shakes: false,
    equation: "τ = T (x/w) exp(½ − x²/2w²), x = q − q₀",
    source: "Akoun & Yonnet 1984",
    signature: "a pull to one position of a joint, from both sides, in both directions of motion",
    confounders: &[("joint_spring", "pulls everywhere"), ("torque_ripple", "repeats")],
    contains: &[],
    needs: &[Need::Torque],
    terms: Terms::LINEAR,
    shapes: one_shape,
    build: |values| {
        let law = Detent {
            torque: values.number("torque")?,
            position: values.number("position")?,
            width: values.number("width")?,
        };
        Ok(Box::new(AtJoint { joint: values.joint()?, law }))
    },
};

/// The law.
#[derive(Clone, Copy, Debug)]
struct Detent {
    torque: f64,
    position: f64,
    width: f64,
}

impl JointLaw for Detent {
    fn resisting(&self, at: &Instant) -> f64 {
        let x = (at.q - self.position) / self.width;
        self.torque * x * (0.5 - 0.5 * x * x).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::Detent;
    use crate::joint_law::{Instant, JointLaw};

    /// The greatest torque is at one width from the centre, and the torque is an odd function.
    #[test]
    fn a_detent_draws_to_its_middle_from_both_sides() {
        let law = Detent { torque: 20.0, position: 0.3, width: 0.05 };
        let at = |q: f64| law.resisting(&Instant { t: 0.0, q, v: 1.0, sign: 1.0, load: 0.0 });
        assert!((at(0.35) - 20.0).abs() < 1e-12 && (at(0.25) + 20.0).abs() < 1e-12);
        assert!(at(0.345) < at(0.35) && at(0.355) < at(0.35) && at(0.3).abs() < 1e-12 && at(0.8) < 1e-9);
    }
}

//! From the journal's position in its bearing to the force and the moment on it.
//!
//! With the journal's centre at r = (x, z) from the bearing's centre (in the plane across the axis), eccentricity e = |r|, normal n = r/e
//! and tangent t = axis × n: penetration δ = e − c, rate δ̇ = ṙ·n, sliding speed of the journal's surface at the contact v_T = ṙ·t + R_j ω,
//! where ω is the angular velocity of the journal against the bearing about the axis. The force on the journal is −F_N n + F_T t and the
//! moment about its centre F_T R_j.
//!
//! Source: Flores et al. 2006, Mech. Mach. Theory 41:247; Erkaya 2018, Eqs. 1–7.

use crate::Clearance;

/// State of the journal in its bearing, in the two coordinates of the plane across the joint's axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Journal {
    /// Offset of the journal's centre from the bearing's, m.
    pub offset: [f64; 2],
    /// Its velocity, m/s.
    pub velocity: [f64; 2],
    /// Angular velocity of the journal against the bearing about the joint's axis, rad/s.
    pub turning: f64,
}

/// Position and velocity of a journal relative to the wall of its bearing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Approach {
    /// Eccentricity e, m.
    pub eccentricity: f64,
    /// Penetration δ = e − c, m; negative in free flight.
    pub penetration: f64,
    /// Approach speed δ̇, m/s, positive outwards.
    pub rate: f64,
    /// The normal n in the plane's coordinates.
    pub normal: [f64; 2],
    /// Sliding speed v_T along the tangent, m/s.
    pub sliding: f64,
}

/// Forces of a contact on the journal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BearingContact {
    /// Normal force F_N ≥ 0, N.
    pub normal: f64,
    /// Tangential force F_T along the tangent, N.
    pub tangential: f64,
    /// Force on the journal in the plane's coordinates, N.
    pub force: [f64; 2],
    /// Moment on the journal about the joint's axis, N·m.
    pub moment: f64,
}

impl Journal {
    /// The position and velocity of the journal relative to a bearing with the clearance `clearance`.
    ///
    /// The plane's coordinates have e₂ = e₁ × axis, so that axis × e₁ = −e₂, axis × e₂ = e₁ and the tangent
    /// axis × n is (n₂, −n₁).
    #[inline]
    pub fn approach(&self, clearance: &Clearance) -> Approach {
        let [x, z] = self.offset;
        let eccentricity = x.hypot(z);
        // A journal in the very centre has no direction; any direction is valid, since it has no contact there.
        let normal = if eccentricity > 0.0 { [x / eccentricity, z / eccentricity] } else { [1.0, 0.0] };
        let tangent = [normal[1], -normal[0]];
        let along = |d: [f64; 2]| self.velocity[0] * d[0] + self.velocity[1] * d[1];
        Approach {
            eccentricity,
            penetration: eccentricity - clearance.clearance,
            rate: along(normal),
            normal,
            sliding: along(tangent) + clearance.journal_radius() * self.turning,
        }
    }
}

/// Force and moment on a journal that approaches its bearing, zero out of contact.
///
/// `impact_speed` is the approach speed latched at first contact, m/s; the clearance's own floor bounds it from below.
#[inline]
pub fn bearing_contact(clearance: &Clearance, approach: &Approach, impact_speed: f64) -> BearingContact {
    if approach.penetration <= 0.0 {
        return BearingContact::default();
    }
    let speed = impact_speed.max(clearance.impact_speed_floor);
    let normal = clearance.normal.force(approach.penetration, approach.rate, speed);
    let tangential = clearance.friction.force(normal, approach.sliding);
    let [nx, nz] = approach.normal;
    BearingContact {
        normal,
        tangential,
        force: [-normal * nx + tangential * nz, -normal * nz - tangential * nx],
        moment: tangential * clearance.journal_radius(),
    }
}

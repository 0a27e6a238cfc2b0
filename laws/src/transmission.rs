//! A spring–damper with a gap between motor and link.
//!
//! Law: with the twist φ = θ − q between motor and link, full gap b, stiffness k and damping d, τ = k dead(φ) + d φ̇, dead(φ) = φ ∓ b/2
//! beyond the gap's ends, and τ = 0 within the gap. Flanks push and never pull: in a gap with two flanks, the damping cannot reverse the
//! torque of the touching one.
//! Units: rad, N·m, s; for prismatic joints m and N.
//!
//! Source: Spong 1987, J. Dyn. Syst. Meas. Control 109:310; Nordin & Gutman 2002, Automatica 38:1633, §2 (dead zone with damping).
//! The law is continuous in φ for d = 0; with damping it steps by d φ̇ at the contact with a flank.

use crate::Transmission;

impl Transmission {
    /// Torque from the motor onto its link at the twist `twist`, rad, that changes by `rate`, rad/s; N·m.
    #[inline]
    pub fn torque(&self, twist: f64, rate: f64) -> f64 {
        if self.gap == 0.0 {
            return self.stiffness * twist + self.damping * rate;
        }
        let wound = self.spring_twist(twist);
        if wound == 0.0 {
            return 0.0;
        }
        let torque = self.stiffness * wound + self.damping * rate;
        if wound > 0.0 { torque.max(0.0) } else { torque.min(0.0) }
    }

    /// The part of the twist that deflects the spring: the twist beyond the gap, rad.
    #[inline]
    pub fn spring_twist(&self, twist: f64) -> f64 {
        let half = 0.5 * self.gap;
        twist - twist.clamp(-half, half)
    }

    /// Energy in the spring, J.
    #[inline]
    pub fn energy(&self, twist: f64) -> f64 {
        let wound = self.spring_twist(twist);
        0.5 * self.stiffness * wound * wound
    }

    /// The twist at which the spring carries `torque`, N·m, at rest; rad. For zero torque, the middle of the gap.
    pub fn twist(&self, torque: f64) -> f64 {
        let side = if torque == 0.0 { 0.0 } else { torque.signum() };
        torque / self.stiffness + side * 0.5 * self.gap
    }
}

#[cfg(test)]
mod tests {
    use crate::Transmission;

    #[test]
    fn a_gap_is_free_and_its_flanks_only_push() {
        let gear = Transmission { stiffness: 1e4, damping: 20.0, gap: 2e-3 };
        assert_eq!(gear.torque(0.9e-3, 5.0), 0.0);
        let pressed = gear.torque(1.5e-3, 0.1);
        assert!((pressed - 7.0).abs() < 1e-12, "1e4 · 0.5e-3 + 20 · 0.1 = 7: {pressed}");
        assert_eq!(gear.torque(1.5e-3, -10.0), 0.0, "a flank that is left fast does not pull");
        assert_eq!(gear.torque(-1.5e-3, -0.1), -pressed, "odd");
        for torque in [-30.0, 0.0, 12.5] {
            let back = gear.torque(gear.twist(torque), 0.0);
            assert!((back - torque).abs() < 1e-11, "{back} of {torque}");
        }
    }

    #[test]
    fn without_a_gap_the_law_is_a_spring_and_a_damper_both_ways() {
        let shaft = Transmission { stiffness: 1e4, damping: 20.0, gap: 0.0 };
        assert_eq!(shaft.torque(1e-3, -10.0), -190.0);
        assert_eq!(shaft.energy(-2e-3), 0.02);
        // The energy's derivative is the torque.
        let slope = (shaft.energy(1.001e-3) - shaft.energy(0.999e-3)) / 2e-6;
        assert!((slope - shaft.torque(1e-3, 0.0)).abs() < 1e-6, "{slope}");
    }
}

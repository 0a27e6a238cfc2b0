//! The transmission between motor and link: a spring, with or without a gap.
//!
//! Motor and link have separate coordinates. Beyond half the gap the teeth push with k p (1 + d ṗ), p the penetration, and never pull (Hunt & Crossley 1975
//! with exponent 1), so that damping starts and ends at zero; without a gap the spring is linear with a linear damper.

/// A transmission of one joint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Transmission {
    /// The joint, index from 0.
    pub joint: usize,
    /// Inertia on the motor side, kg·m². It is part of the data sheet's inertia: motor and link together are the rigid arm.
    pub rotor: f64,
    /// The whole gap, rad.
    pub gap: f64,
    /// k, N·m/rad.
    pub stiffness: f64,
    /// Damping: N·m·s/rad without a gap, s/rad with one.
    pub damping: f64,
}

impl Transmission {
    /// Torque from motor to link, N·m, when the motor leads by `twist` rad at the rate `rate` rad/s.
    pub fn torque(&self, twist: f64, rate: f64) -> f64 {
        if self.gap == 0.0 {
            return self.stiffness * twist + self.damping * rate;
        }
        let side = twist.signum();
        let depth = twist.abs() - 0.5 * self.gap;
        if depth <= 0.0 {
            return 0.0;
        }
        side * (self.stiffness * depth * (1.0 + self.damping * side * rate)).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::Transmission;

    /// The range without torque is exactly the gap, and torque is continuous at its edges.
    #[test]
    fn the_window_without_torque_is_the_gap() {
        let law = Transmission { joint: 0, rotor: 0.1, gap: 2e-3, stiffness: 1e4, damping: 0.5 };
        let step = 1e-7;
        let free = (-50_000..50_000).filter(|k| law.torque(f64::from(*k) * step, 0.3) == 0.0).count();
        let width = free as f64 * step;
        println!("force-free window {width:.7} rad, gap 0.002 rad");
        assert!((width - 2e-3).abs() < 3e-7);
        assert!(law.torque(1.5e-3, 0.0) > 4.9 && law.torque(-1.5e-3, 0.0) < -4.9);
        assert!(law.torque(1e-3 + 1e-9, 1.0) < 2e-5);
    }

    /// The teeth dissipate energy: the work over an impact is never negative.
    #[test]
    fn an_impact_loses_energy() {
        let law = Transmission { joint: 0, rotor: 0.1, gap: 1e-3, stiffness: 1e4, damping: 2.0 };
        let (mut x, mut v, h, mass) = (5e-4, 0.2, 1e-6, 0.5);
        while x >= 5e-4 {
            v -= h / mass * law.torque(x, v);
            x += h * v;
        }
        println!("speed 0.2 in, {v:.4} out");
        assert!(v < 0.0 && v > -0.2 * 0.95);
    }
}

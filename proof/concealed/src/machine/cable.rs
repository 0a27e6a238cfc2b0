//! A dragged cable: it pulls as a spring, sticks by static friction and slips by a jump.

/// The cable of one joint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cable {
    /// N·m/rad.
    pub stiffness: f64,
    /// Pull at which it slips, N·m.
    pub stick: f64,
    /// Pull after a slip, N·m; below `stick`.
    pub slip: f64,
}

impl Cable {
    /// Torque on the joint at `q`; `anchor` is the position with a slack cable, rad, and moves at each slip.
    pub fn torque(&self, q: f64, anchor: &mut f64) -> f64 {
        let pull = self.stiffness * (q - *anchor);
        if pull.abs() > self.stick {
            *anchor = q - pull.signum() * self.slip / self.stiffness;
        }
        -self.stiffness * (q - *anchor)
    }
}

#[cfg(test)]
mod tests {
    use super::Cable;

    /// In steady motion the pull is a sawtooth between `slip` and `stick` with the period (stick − slip)/k.
    #[test]
    fn the_pull_is_a_saw() {
        let cable = Cable { stiffness: 50.0, stick: 5.0, slip: 3.0 };
        let mut anchor = 0.0;
        let mut jumps = Vec::new();
        let mut before = 0.0;
        for k in 0..100_000 {
            let q = f64::from(k) * 1e-5;
            let torque = cable.torque(q, &mut anchor);
            assert!(torque.abs() <= 5.0 + 1e-9);
            if torque > before + 1.0 {
                jumps.push(q);
            }
            before = torque;
        }
        let period = jumps[5] - jumps[4];
        println!("period {period:.5} rad, closed form 0.04");
        assert!((period - 0.04).abs() < 2e-5);
    }
}

//! Dry friction in presliding: LuGre's bristles (Canudas de Wit, Olsson, Åström & Lischinsky 1995).
//!
//! ż = v − σ₀|v| z / g, friction σ₀ z + σ₁ ż. In steady sliding, σ₀ z = g sign v: the same curve as the set-valued law.

/// The bristles of one drive.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bristles {
    /// σ₀, N·m/rad.
    pub stiffness: f64,
    /// σ₁, N·m·s/rad.
    pub damping: f64,
}

impl Bristles {
    /// Friction torque against the motion over one step of `h` s at speed `v`, with the size `g` (N·m) of sliding friction; advances the bristles' deflection
    /// `z`, rad, exactly for constant `v` and `g`.
    pub fn step(&self, z: &mut f64, v: f64, g: f64, h: f64) -> f64 {
        let rate = self.stiffness * v.abs() / g.max(1e-12);
        let before = *z;
        let rate_h = rate * h;
        // The exact solution of ż = v − rate z; its series for a small exponent.
        let gained = if rate_h < 1e-6 { h } else { -(-rate_h).exp_m1() / rate };
        *z = before + (v - rate * before) * gained;
        self.stiffness * 0.5 * (before + *z) + self.damping * (*z - before) / h
    }
}

#[cfg(test)]
mod tests {
    use super::Bristles;

    /// In steady sliding, the friction equals `g`, whatever the speed and the step: the closed form.
    #[test]
    fn steady_sliding_is_the_sliding_friction() {
        let law = Bristles { stiffness: 2000.0, damping: 3.0 };
        let mut worst = 0.0_f64;
        for v in [-1.0, -0.05, 0.03, 0.5] {
            let g = 4.0 + (-(v / 0.05_f64).powi(2)).exp();
            let mut z = 0.0;
            let mut first = 0.0;
            let mut last = 0.0;
            for k in 0..20_000 {
                last = law.step(&mut z, v, g, 1e-4);
                if k == 0 {
                    first = last;
                }
            }
            assert!((first - last).abs() > 0.1 * g, "the start is not yet sliding: {first} {last}");
            worst = worst.max((last - g * v.signum()).abs() / g);
        }
        println!("steady sliding differs by {worst:.1e}");
        assert!(worst < 1e-9);
    }

    /// Small motions about zero act against a spring of stiffness σ₀.
    #[test]
    fn small_motions_feel_a_spring() {
        let law = Bristles { stiffness: 2000.0, damping: 0.0 };
        let (mut z, mut force) = (0.0, 0.0);
        let (v, h, steps) = (1e-4, 1e-4, 500);
        for _ in 0..steps {
            force = law.step(&mut z, v, 5.0, h);
        }
        let spring = 2000.0 * v * h * f64::from(steps);
        println!("{force:.6} against {spring:.6}");
        assert!((force / spring - 1.0).abs() < 2e-3);
    }
}

//! A link on the spring of its joint, excited by its motor.
//!
//! Law: the motor leads its link by δ. τ is the torque that the link would need to follow the motor exactly. Of this torque the link's own
//! inertia M takes M δ̈, and the change of its weight with the position takes κ δ: M δ̈ + d δ̇ + (k + κ) δ = τ with κ = ∂τ/∂q. Units: rad,
//! s, N·m, kg·m²; for prismatic joints m, N and kg.
//! Source: Spong 1987, J. Dyn. Sys. Meas. Control 109:310, Eqs. 3–4, for the one joint, with the others at their encoder positions. Over
//! each sample τ is linear in time and M and κ are constant. The solution is exact for this input, so that a stiff joint follows its load
//! at once. Departure: the damping ratio is at least 2 %.

/// Least damping, as a share of the critical damping.
const LEAST_DAMPED: f64 = 0.02;
/// Least total stiffness with the weight, as a share of the spring's.
const LEAST_LEFT: f64 = 0.1;

/// Lead of a motor over its link.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Resonance {
    /// k and d.
    stiffness: f64,
    damping: f64,
    /// Motor minus link, and its rate of change.
    place: f64,
    rate: f64,
}

impl Resonance {
    /// A link in quasi-static equilibrium on the spring, under `load`, which changes at `slope` per second; κ = `yielding`.
    pub fn settled([stiffness, damping]: [f64; 2], load: f64, slope: f64, yielding: f64) -> Resonance {
        let all = total(stiffness, yielding);
        let rate = slope / all;
        Resonance { stiffness, damping, place: (load - damping * rate) / all, rate }
    }

    /// The lead of the motor.
    pub fn place(&self) -> f64 {
        self.place
    }

    /// Advances by `step` s, over which the load goes from the first to the second of `loads`, with the `inertia` M and κ = `yielding`.
    pub fn advance(&mut self, loads: [f64; 2], inertia: f64, yielding: f64, step: f64) {
        let stiffness = total(self.stiffness, yielding);
        // A link without inertia follows at once.
        let inertia = inertia.max(1e-12 * stiffness * step * step);
        let damping = self.damping.max(2.0 * LEAST_DAMPED * (stiffness * inertia).sqrt());
        let rate = (loads[1] - loads[0]) / step / stiffness;
        let behind = damping * rate / stiffness;
        let (x, v) = (self.place - loads[0] / stiffness + behind, self.rate - rate);
        let (decay, square) = (0.5 * damping / inertia, stiffness / inertia);
        let [c, s] = swing(decay, square - decay * decay, step);
        self.place = loads[1] / stiffness - behind + (c + decay * s) * x + s * v;
        self.rate = rate + (c - decay * s) * v - square * s * x;
    }
}

/// k + κ; bounded from below, since the weight does not tip the spring of a real joint over.
fn total(stiffness: f64, yielding: f64) -> f64 {
    (stiffness + yielding).max(LEAST_LEFT * stiffness)
}

/// e^(−γh) cos ωh and e^(−γh) sin ωh/ω for γ = `decay`, ω² = `square` (cosh and sinh where that is negative) and h = `step`.
fn swing(decay: f64, square: f64, step: f64) -> [f64; 2] {
    let w = square.abs().sqrt();
    if w * step < 1e-9 {
        let decayed = (-decay * step).exp();
        return [decayed, decayed * step];
    }
    if square > 0.0 {
        let decayed = (-decay * step).exp();
        return [decayed * (w * step).cos(), decayed * (w * step).sin() / w];
    }
    let [slow, fast] = [((w - decay) * step).exp(), (-(w + decay) * step).exp()];
    [0.5 * (slow + fast), 0.5 * (slow - fast) / w]
}

#[cfg(test)]
mod tests {
    use super::Resonance;

    const STIFFNESS: f64 = 80.0;
    const INERTIA: f64 = 0.05;

    /// A load that oscillates at Ω deflects the spring by 1/|k − MΩ² + i d Ω|: below, at and above the resonance, and with strong damping.
    #[test]
    fn the_amplitude_is_that_of_the_transfer_function() {
        for damping in [0.3, 1.0, 12.0] {
            for pace in [0.3, 1.0, 1.7] {
                let speed = pace * (STIFFNESS / INERTIA).sqrt();
                let (step, load) = (1e-3, |k: u32| (speed * 1e-3 * f64::from(k)).sin());
                let mut link = Resonance::settled([STIFFNESS - 30.0, damping], 0.0, speed, 30.0);
                let mut greatest = 0.0_f64;
                for k in 0..20_000 {
                    link.advance([load(k), load(k + 1)], INERTIA, 30.0, step);
                    if k > 10_000 {
                        greatest = greatest.max(link.place());
                    }
                }
                let expected = 1.0 / (STIFFNESS - INERTIA * speed * speed).hypot(damping * speed);
                let off = greatest / expected - 1.0;
                println!(
                    "d {damping}, {pace} of the resonance: {greatest:.5} against {expected:.5} ({off:.1e})"
                );
                assert!(off.abs() < 2e-3, "margin 2e-3");
            }
        }
    }

    #[test]
    fn a_stiff_or_weightless_link_follows_its_load_at_once() {
        let load = |k: u32| (0.02 * f64::from(k)).sin();
        for (stiffness, inertia) in [(1e8, 0.7), (80.0, 0.0)] {
            let mut link = Resonance::settled([stiffness, 0.0], 0.0, 20.0, 0.0);
            let mut off = 0.0_f64;
            for k in 0..2000 {
                link.advance([load(k), load(k + 1)], inertia, 0.0, 1e-3);
                off = off.max((link.place() * stiffness - load(k + 1)).abs());
            }
            println!("k {stiffness:.0e}, M {inertia}: {off:.1e} of the load off, margin 1e-3");
            assert!(off < 1e-3);
        }
    }
}

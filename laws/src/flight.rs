//! A link between the flanks of a gap: it rests on the flank to which the load presses it, leaves it when the load changes sign, and flies
//! to the other.
//!
//! Law: the motor leads its link by p, |p| ≤ j/2. The link needs the torque τ_L to follow its motor; the flanks carry τ_c, and M p̈ = τ_L −
//! τ_c, with M the inertia that the joint moves beyond the gap. Between the flanks τ_c = 0. A flank absorbs the whole of ṗ at contact, so
//! that τ_c contains an impulse M ṗ there. The recorded motion, and so τ_L, includes the motor's recoil. Units: rad, s, N·m, kg·m²; for
//! prismatic joints m, N and kg.
//! Source: Nordin & Gutman 2002, Automatica 38:1633, §2 (dead zone), with flanks as rigid as the recording's period is long.

/// Parts of a sample's period; contact with a flank occurs at the end of a part.
const PARTS: u32 = 8;

/// Lead of the motor over a link in a gap.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Flight {
    /// Half the gap.
    half: f64,
    /// Motor minus link, and its rate of change.
    place: f64,
    rate: f64,
}

impl Flight {
    /// A link at rest on the flank to which `load` presses it.
    pub fn resting(gap: f64, load: f64) -> Flight {
        let side = if load == 0.0 { 0.0 } else { load.signum() };
        Flight { half: 0.5 * gap, place: 0.5 * gap * side, rate: 0.0 }
    }

    /// The lead of the motor.
    pub fn place(&self) -> f64 {
        self.place
    }

    /// Advances by `step` s, over which the load goes from the first to the second of `loads`, with the `inertia` M. Returns the mean
    /// torque of the flanks beyond the load, τ_c − τ_L.
    pub fn advance(&mut self, loads: [f64; 2], inertia: f64, step: f64) -> f64 {
        // A link without inertia reaches the other flank at once.
        let inertia = inertia.max(f64::MIN_POSITIVE);
        let (before, part) = (self.rate, step / f64::from(PARTS));
        for k in 0..PARTS {
            let share = (f64::from(k) + 0.5) / f64::from(PARTS);
            let a = (loads[0] + (loads[1] - loads[0]) * share) / inertia;
            self.place += (self.rate + 0.5 * a * part) * part;
            self.rate += a * part;
            if self.place.abs() >= self.half {
                (self.place, self.rate) = (self.half.copysign(self.place), 0.0);
            }
        }
        -inertia * (self.rate - before) / step
    }
}

#[cfg(test)]
mod tests {
    use super::Flight;

    const GAP: f64 = 2e-3;
    const INERTIA: f64 = 0.7;

    /// A load that falls steadily through zero: with p̈ = −s t from the flank at j/2, the link reaches the other flank after (6 j/s)^(1/3).
    #[test]
    fn the_flight_takes_as_long_as_the_closed_form_says() {
        for (slope, step) in [(10.0, 1e-3), (10.0, 4e-3), (200.0, 1e-3)] {
            let load = |t: f64| -INERTIA * slope * t;
            let mut flight = Flight::resting(GAP, 1.0);
            let (mut t, mut impulse, mut missing) = (0.0, 0.0, 0.0);
            while flight.place() > -0.5 * GAP {
                let extra = flight.advance([load(t), load(t + step)], INERTIA, step);
                t += step;
                impulse += extra * step;
                missing -= 0.5 * (load(t) + load(t - step)) * step;
            }
            let expected = (6.0 * GAP / slope).cbrt();
            println!("slope {slope}, step {step}: {t:.4} s, closed form {expected:.4} s, margin {step} s");
            assert!((t - expected).abs() <= step);
            // At rest before and after: the landing returns the impulse missing during the flight, except for the rest of a sample.
            let left = INERTIA * slope * t * step / 8.0;
            println!("impulse left {impulse:.2e} of {missing:.2e}, margin {left:.1e}");
            assert!(impulse.abs() <= left);
        }
    }

    #[test]
    fn pressed_to_a_flank_it_stays_and_carries_the_load() {
        let mut flight = Flight::resting(GAP, -3.0);
        for k in 0..100 {
            let load = -3.0 + 0.02 * f64::from(k);
            assert_eq!(flight.advance([load, load + 0.02], INERTIA, 1e-3), 0.0);
        }
        assert_eq!(flight.place(), -0.5 * GAP);
    }

    #[test]
    fn without_inertia_it_goes_over_at_once() {
        let mut flight = Flight::resting(GAP, 1.0);
        assert!(flight.advance([1.0, -1.5], 0.0, 1e-3).is_finite());
        assert_eq!(flight.place(), -0.5 * GAP);
    }
}

//! The low-pass filter that every column passes, and derivatives on a uniform grid.

use biquad::{Biquad, Coefficients, DirectForm2Transposed, ToHertz, Type};

use crate::error::ResidualError;

/// Settling time of the filter, in periods of the cutoff: the slowest pole decays as exp(−0.383·2πf_c·t), which is 6·10⁻⁶ after five periods.
pub(crate) const SETTLING_PERIODS: f64 = 5.0;

/// A zero-phase low-pass: a fourth-order Butterworth filter run forward, then backward.
///
/// Its gain at the frequency f is 1/(1 + (tan(πf/f_s)/tan(πf_c/f_s))⁸): one half (−6 dB) at the cutoff f_c, with a slope of order eight above it. Its phase is
/// zero at every frequency, so that filtered columns stay synchronous (Gustafsson 1996, "Determining the initial states in forward-backward filtering"; our
/// initial states are the steady state of the padded first sample).
#[derive(Debug, Clone)]
pub struct LowPass {
    sections: [Coefficients<f64>; 2],
    rate_hz: f64,
    cutoff_hz: f64,
}

/// Quality factors of the two second-order sections of a fourth-order Butterworth low-pass: 1/(2 sin((2k + 1)π/8)).
fn butterworth() -> [f64; 2] {
    [1.0, 3.0].map(|odd| 0.5 / (odd * std::f64::consts::PI / 8.0).sin())
}

impl LowPass {
    /// A filter for signals of `rate_hz` samples a second with the cutoff `cutoff_hz`, both Hz.
    ///
    /// # Errors
    /// [`ResidualError::Cutoff`] unless 0 < `cutoff_hz` < `rate_hz`/2.
    pub fn new(rate_hz: f64, cutoff_hz: f64) -> Result<Self, ResidualError> {
        let bad = || ResidualError::Cutoff { cutoff_hz, rate_hz, most_hz: rate_hz / 2.0 };
        if !(cutoff_hz > 0.0 && cutoff_hz < rate_hz / 2.0 && rate_hz.is_finite()) {
            return Err(bad());
        }
        let section = |quality| {
            Coefficients::<f64>::from_params(Type::LowPass, rate_hz.hz(), cutoff_hz.hz(), quality)
                .map_err(|_| bad())
        };
        let [first, second] = butterworth();
        Ok(Self { sections: [section(first)?, section(second)?], rate_hz, cutoff_hz })
    }

    /// The cutoff f_c, Hz.
    pub fn cutoff_hz(&self) -> f64 {
        self.cutoff_hz
    }

    /// Gain at `frequency_hz` by the closed form; the phase is zero.
    pub fn gain(&self, frequency_hz: f64) -> f64 {
        let warped = |f: f64| (std::f64::consts::PI * f / self.rate_hz).tan();
        1.0 / (1.0 + (warped(frequency_hz) / warped(self.cutoff_hz)).powi(8))
    }

    /// Standard deviation of filtered white noise of unit deviation, by Parseval's theorem.
    pub fn noise_gain(&self) -> f64 {
        mean_over_band(self.rate_hz, |frequency_hz| self.gain(frequency_hz).powi(2)).sqrt()
    }

    /// Time at each end of a signal over which the filter output depends on the missing continuation, s.
    pub fn settling_time(&self) -> f64 {
        SETTLING_PERIODS / self.cutoff_hz
    }

    /// Filters `signal`, keeping its length. The filter continues the ends by point reflection at the first and last sample (odd padding), so that a constant
    /// and a ramp pass unchanged.
    pub fn apply(&self, signal: &[f64]) -> Vec<f64> {
        let Some(reach) = signal.len().checked_sub(1) else { return Vec::new() };
        let padding = reach.min((self.settling_time() * self.rate_hz).ceil() as usize);
        let mut padded = odd_extension(signal, padding);
        self.pass(padded.iter_mut());
        self.pass(padded.iter_mut().rev());
        padded.drain(..padding);
        padded.truncate(signal.len());
        padded
    }

    /// Filters each stretch of `column` on its own; the stretches have these `lengths`.
    pub(crate) fn apply_to_each(&self, lengths: impl Iterator<Item = usize>, column: &[f64]) -> Vec<f64> {
        let mut out = Vec::with_capacity(column.len());
        for length in lengths {
            out.extend(self.apply(&column[out.len()..out.len() + length]));
        }
        out
    }

    /// One pass of the filter in place, from the steady state of the first sample.
    ///
    /// Once the signal is zero, the state becomes zero, too, as soon as it is below the rounding of the signal's largest sample.
    fn pass<'a>(&self, signal: impl Iterator<Item = &'a mut f64>) {
        let mut signal = signal.peekable();
        let Some(first) = signal.peek().map(|sample| **sample) else { return };
        let [mut slow, mut fast] = self.sections.map(|section| settled(section, first));
        let (mut largest, mut is_over) = (first.abs(), first == 0.0);
        for sample in signal {
            if *sample != 0.0 {
                (largest, is_over) = (largest.max(sample.abs()), false);
            } else if is_over {
                continue;
            } else {
                let past = [slow.s1, slow.s2, fast.s1, fast.s2];
                is_over = past.iter().all(|state| state.abs() < f64::EPSILON * largest);
                if is_over {
                    [slow, fast] = self.sections.map(|section| settled(section, 0.0));
                    continue;
                }
            }
            *sample = fast.run(slow.run(*sample));
        }
    }
}

/// Mean of `power` over the frequencies from zero to half of `rate_hz`, by the midpoint rule.
pub(crate) fn mean_over_band(rate_hz: f64, power: impl Fn(f64) -> f64) -> f64 {
    /// Frequencies of the rule: the gain of the lowest cutoff, a hundredth of the band, falls over many of them.
    const POINTS: usize = 4096;
    let at = |k: usize| (k as f64 + 0.5) / POINTS as f64 * 0.5 * rate_hz;
    (0..POINTS).map(|k| power(at(k))).sum::<f64>() / POINTS as f64
}

/// A section in the steady state of a constant input `level` (its gain at zero frequency is one).
fn settled(section: Coefficients<f64>, level: f64) -> DirectForm2Transposed<f64> {
    let mut filter = DirectForm2Transposed::<f64>::new(section);
    filter.s2 = (section.b2 - section.a2) * level;
    filter.s1 = (section.b1 - section.a1) * level + filter.s2;
    filter
}

/// `signal` with `padding` more samples at each end, point-reflected at the end sample; `padding` < its length.
fn odd_extension(signal: &[f64], padding: usize) -> Vec<f64> {
    let (first, last) = (signal[0], signal[signal.len() - 1]);
    let before = signal[1..=padding].iter().rev().map(|sample| 2.0 * first - sample);
    let after = signal.iter().rev().skip(1).take(padding).map(|sample| 2.0 * last - sample);
    before.chain(signal.iter().copied()).chain(after).collect()
}

/// First and second derivative of `signal` on a grid of `step` s, by the centred five-point formulas
/// f′ ≈ (f₋₂ − 8f₋₁ + 8f₁ − f₂)/12h and f″ ≈ (−f₋₂ + 16f₋₁ − 30f₀ + 16f₁ − f₂)/12h² (Fornberg 1988, table 1):
/// both of fourth order in h. The two samples at each end use the odd continuation and are of lower order.
pub fn derivatives(signal: &[f64], step: f64) -> (Vec<f64>, Vec<f64>) {
    if signal.len() < 3 {
        return (vec![0.0; signal.len()], vec![0.0; signal.len()]);
    }
    let padded = odd_extension(signal, 2);
    let first = padded.windows(5).map(|f| (f[0] - f[4] + 8.0 * (f[3] - f[1])) / (12.0 * step)).collect();
    let second = padded
        .windows(5)
        .map(|f| (16.0 * (f[1] + f[3]) - f[0] - f[4] - 30.0 * f[2]) / (12.0 * step * step))
        .collect();
    (first, second)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::{LowPass, derivatives};

    #[test]
    fn coefficients_are_butterworth() {
        for (k, quality) in super::butterworth().into_iter().enumerate() {
            let exact = 0.5 / ((2 * k + 1) as f64 * PI / 8.0).sin();
            println!("section {k}: off by {:.1e}", quality - exact);
            assert!((quality - exact).abs() < 1e-14);
        }
    }

    /// Amplitude and phase of a filtered sine in its settled middle, against the closed form.
    #[test]
    fn gain_and_phase_match_the_closed_form() {
        let (rate, cutoff) = (250.0, 10.0);
        let filter = LowPass::new(rate, cutoff).expect("a filter");
        assert!((filter.gain(cutoff) - 0.5).abs() < 1e-12, "half at the cutoff: −6 dB");
        let (mut worst_gain, mut worst_phase) = (0.0_f64, 0.0_f64);
        for frequency in [0.5, 2.0, 5.0, 8.0, 10.0, 12.5, 20.0] {
            let phase = |k: usize| 2.0 * PI * frequency * k as f64 / rate;
            let sine: Vec<f64> = (0..4000).map(|k| phase(k).sin()).collect();
            let filtered = filter.apply(&sine);
            // 2000 samples are a whole number of periods of every frequency above.
            let (mut along, mut across) = (0.0, 0.0);
            for (k, sample) in filtered.iter().enumerate().take(3000).skip(1000) {
                along += sample * phase(k).sin() / 1000.0;
                across += sample * phase(k).cos() / 1000.0;
            }
            worst_gain = worst_gain.max((along - filter.gain(frequency)).abs());
            worst_phase = worst_phase.max((across / along).abs());
        }
        println!("gain off by {worst_gain:.1e}, phase by {worst_phase:.1e} rad");
        assert!(worst_gain < 1e-9 && worst_phase < 1e-9);
    }

    #[test]
    fn constants_and_ramps_pass_to_their_ends() {
        let filter = LowPass::new(1000.0, 40.0).expect("a filter");
        let ramp: Vec<f64> = (0..500).map(|k| 3.0 - 0.01 * f64::from(k)).collect();
        let worst = |signal: &[f64]| {
            filter.apply(signal).iter().zip(signal).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        println!("constant off by {:.1e}, ramp by {:.1e}", worst(&[7.0; 300]), worst(&ramp));
        assert!(worst(&[7.0; 300]) < 1e-12);
        assert!(worst(&ramp) < 1e-5, "what is left of the padding's own ends after five periods");
        for few in 0..4 {
            assert_eq!(filter.apply(&ramp[..few]).len(), few);
        }
    }

    #[test]
    fn cutoffs_outside_the_band_are_refused() {
        for (rate, cutoff) in
            [(100.0, 50.0), (100.0, 0.0), (100.0, -1.0), (100.0, f64::NAN), (f64::INFINITY, 1.0)]
        {
            assert!(LowPass::new(rate, cutoff).is_err(), "{cutoff} of {rate}");
        }
    }

    #[test]
    fn derivatives_converge_with_the_fourth_power_of_the_step() {
        let error = |points: usize| {
            let step = 2.0 / points as f64;
            let at = |k: usize| k as f64 * step;
            let (v, a) = derivatives(&(0..points).map(|k| (3.0 * at(k)).sin()).collect::<Vec<_>>(), step);
            (2..points - 2).fold((0.0_f64, 0.0_f64), |(ev, ea), k| {
                let (sin, cos) = (3.0 * at(k)).sin_cos();
                (ev.max((v[k] - 3.0 * cos).abs()), ea.max((a[k] + 9.0 * sin).abs()))
            })
        };
        let (coarse, fine) = (error(50), error(100));
        let order = |coarse: f64, fine: f64| (coarse / fine).log2();
        let (v, a) = (order(coarse.0, fine.0), order(coarse.1, fine.1));
        println!("velocity {:.1e} → {:.1e}, order {v:.2}; acceleration order {a:.2}", coarse.0, fine.0);
        assert!((v - 4.0).abs() < 0.1 && (a - 4.0).abs() < 0.1);
    }
}

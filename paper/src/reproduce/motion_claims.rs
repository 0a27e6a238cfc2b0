//! The paper's claims about deviation, forces and peaks, judged by the runs.
//!
//! Every rule states when a situation agrees with a claim. The thresholds are the differences between two simulators of the same equations (`freeplay
//! reference-runs`: 1 % of the deviation on smooth paths, 5 % on sharp ones, 2 % of peak forces), so that no verdict depends on a difference below the accuracy
//! of the simulation. If corners make a run chaotic, "greater" must be true of all indistinguishable clearances.

use freeplay_harness::scenario::Drive;
use freeplay_laws::FrictionLaw;
use freeplay_path::PathKind;
use freeplay_plant::DeviationStatistics;

use super::case::{
    CLEARANCES, Case, LAPS, PERIODS, PERTURBATIONS, Scope, drive_name, lapping, path_name, rubbing, smooth,
};
use super::claim::{Claim, Quantity, Row, Tag};
use super::reference::{Independent, WEIGHTLESS_PEAKS, friction_spread};
use super::trace::{Figures, Outcome, Runs};
use crate::simulation::TICK;

/// Smaller growth does not count: the simulators' agreement on the deviation of sharp runs.
const DEVIATION_MARGIN: f64 = 0.05;
/// The same for peak forces.
const FORCE_MARGIN: f64 = 0.02;
/// More peaks means at least so many more, and at least that share: two simulators' contacts differ by one.
const MORE_PEAKS: (f64, f64) = (2.0, 0.1);
/// A lap repeats if its deviation differs by less than this mean square from the lap before, mm²: 1 µm, the best resolution of a tracker.
const REPEATS: f64 = 1e-6;
/// A step across rest may feed in this share of the energy that friction dissipates.
const FED_IN: f64 = 0.01;
/// More chaos at one period than at the other means at least that factor.
const MORE_CHAOS: f64 = 10.0;

/// The runs and references for the verdicts.
pub struct Evidence<'a> {
    /// The runs.
    pub runs: &'a Runs,
    /// The independent results.
    pub independent: &'a Independent,
    /// The simulated runs.
    pub scope: &'a Scope,
}

/// Least and greatest value of a number over runs with indistinguishable clearances.
type Extent = (f64, f64);

/// True if each extent lies above the one before by the share `margin`.
fn grows(extents: &[Extent], margin: f64) -> bool {
    extents.windows(2).all(|pair| pair[1].0 > pair[0].1 * (1.0 + margin))
}

/// True if `many` exceeds `few` by a significant number and share.
fn more(many: Extent, few: Extent) -> bool {
    many.0 >= few.1 + MORE_PEAKS.0 && many.0 >= few.1 * (1.0 + MORE_PEAKS.1)
}

/// True if a force that fed in the energy `fed` and dissipated `lost` in all is a friction.
fn opposes(fed: f64, lost: f64) -> bool {
    lost > 0.0 && fed < FED_IN * lost
}

fn tags(case: &Case) -> Vec<Tag> {
    let path = match case.path {
        PathKind::SquareSharp => "the path has sharp corners",
        _ => "the path is smooth",
    };
    let drive = match case.drive {
        Drive::Driven => "the motion is prescribed",
        Drive::Torque => "torques drive the joints",
        Drive::Servo => "servos drive the joints",
    };
    let weight = if case.gravity { "there is gravity" } else { "there is no gravity" };
    let period = if case.period == PERIODS[0] { "T = 6 s" } else { "T = 12 s" };
    vec![("path", path), ("drive", drive), ("gravity", weight), ("period", period)]
}

impl Evidence<'_> {
    fn figures(&self, case: &Case) -> Option<&Figures> {
        self.runs.get(case).map(|outcome| &outcome.figures)
    }

    /// The extent of a number over `case` and the runs with indistinguishable clearances.
    fn extent(&self, case: &Case, number: impl Fn(&Figures) -> f64) -> Option<Extent> {
        let first = number(self.figures(case)?);
        let others = PERTURBATIONS.iter().filter_map(|&nudge| self.figures(&Case { nudge, ..*case }));
        let both = |(low, high): Extent, value: f64| (low.min(value), high.max(value));
        Some(others.map(number).fold((first, first), both))
    }

    /// One case for each drive, path and period, with the smallest clearance; and the smooth path without gravity.
    fn ladders(&self) -> Vec<Case> {
        let of_pair = |(drive, path)| PERIODS.map(|period| Case::new(drive, path, period, CLEARANCES[0]));
        let weightless = PERIODS.map(|period| smooth(period, CLEARANCES[0]).weightless());
        self.scope.pairs().flat_map(of_pair).chain(weightless).collect()
    }

    /// A row with a number for each clearance, which must grow by `margin`.
    fn ladder(
        &self,
        first: &Case,
        margin: f64,
        number: impl Fn(&Figures) -> f64,
        theirs: impl Fn(&crate::reference_pair::Figures) -> Option<f64>,
    ) -> Option<Row> {
        let cases = CLEARANCES.map(|clearance| Case { clearance, ..*first });
        let extents: Option<Vec<Extent>> = cases.iter().map(|case| self.extent(case, &number)).collect();
        let values: Option<Vec<f64>> = cases.iter().map(|case| self.figures(case).map(&number)).collect();
        Some(Row {
            situation: first.situation(),
            tags: tags(first),
            values: values?,
            reference: cases.iter().map(|case| self.independent.run(case).and_then(&theirs)).collect(),
            holds: grows(&extents?, margin),
        })
    }

    /// All claims about the motion that the runs can judge.
    pub fn claims(&self) -> Vec<Claim> {
        let mut claims = vec![
            self.deviation_grows(),
            self.force_grows(),
            self.imperfect_joint_costs(),
            self.peaks_at_the_beginning(),
            self.shorter_is_peakier(),
            self.shorter_is_more_chaotic(),
            self.friction_opposes(),
        ];
        claims.retain(|claim| !claim.situations.is_empty());
        claims
    }

    fn deviation_grows(&self) -> Claim {
        let ladders = self.ladders();
        let rows = ladders.iter().filter_map(|first| {
            self.ladder(first, DEVIATION_MARGIN, |f| f.deviation[0].rms, |r| Some(r.norm_rms))
        });
        let situations: Vec<Row> = rows.collect();
        let ratios = ladders.iter().copied().filter(|case| case.gravity && case.path == PathKind::Lissajous);
        let ratios = ratios.flat_map(|first| CLEARANCES.map(|clearance| Case { clearance, ..first }));
        let off =
            ratios.filter_map(|case| Some(self.figures(&case)?.deviation[0].rms / case.clearance - 1.0));
        let off = off.fold(0.0, |most: f64, ratio| most.max(ratio.abs()));
        Claim::judged(
            "deviation_grows_with_clearance",
            "The deviation of the tool grows with the clearance",
            format!(
                "agrees where each RMS of the norm exceeds that of the next smaller clearance by {:.0} %, the agreement of two simulators on sharp paths",
                DEVIATION_MARGIN * 100.0
            ),
            CLEARANCES.iter().map(|c| Quantity::new(format!("RMS, c = {c} mm"), "mm")).collect(),
            situations,
        )
        .remark(format!(
            "On smooth paths the RMS is the clearance itself to within {:.1} %: the journal rests on one side of its bearing, and the deviation is an offset in the direction of the load.",
            off * 100.0
        ))
    }

    fn force_grows(&self) -> Claim {
        let mut situations = Vec::new();
        for first in self.ladders() {
            let whole = self.ladder(
                &first,
                FORCE_MARGIN,
                |f| f.contact.map_or(f64::NAN, |contact| contact.peak_normal_force),
                |r| r.peak_normal,
            );
            let later = self.ladder(&first, FORCE_MARGIN, |f| f.peak_normal_after_start, |_| None);
            for (row, when, condition) in [
                (whole, "whole run", "the first drop of the centred journal is counted"),
                (later, "after 0.5 s", "the first drop is left out"),
            ] {
                situations.extend(row.map(|row| Row {
                    situation: format!("{}, {when}", row.situation),
                    tags: std::iter::once(("window", condition)).chain(row.tags).collect(),
                    ..row
                }));
            }
        }
        Claim::judged(
            "contact_force_grows_with_clearance",
            "The contact force in the joint grows with the clearance",
            format!(
                "agrees where each peak normal force exceeds that of the next smaller clearance by {:.0} %, the agreement of two simulators; on sharp paths for all clearances within 0.002 %",
                FORCE_MARGIN * 100.0
            ),
            CLEARANCES.iter().map(|c| Quantity::new(format!("peak force, c = {c} mm"), "N")).collect(),
            situations,
        )
        .remark("The first drop usually causes the peak of a run: the journal starts in the middle of its bearing and falls over the clearance (Hertz: about c^0.4).")
    }

    fn imperfect_joint_costs(&self) -> Claim {
        let mut situations = Vec::new();
        for (drive, path) in self.scope.pairs() {
            for period in PERIODS {
                let perfect = Case::new(drive, path, period, 0.0);
                let worst = Case { clearance: CLEARANCES[2], ..perfect };
                let Some((ideal, real)) = self.figures(&perfect).zip(self.figures(&worst)) else { continue };
                let torque = |figures: &Figures| figures.torque.map(|joint| joint.peak);
                let [one, two] = [0, 1].map(|joint| torque(real)[joint] - torque(ideal)[joint]);
                let theirs = |case: &Case| self.independent.run(case).map(|run| run.peak_base);
                situations.push(Row {
                    situation: perfect.situation(),
                    tags: tags(&perfect),
                    values: vec![ideal.peak_base, real.peak_base, one, two],
                    reference: vec![theirs(&perfect), theirs(&worst), None, None],
                    holds: grows(
                        &[(ideal.peak_base, ideal.peak_base), (real.peak_base, real.peak_base)],
                        FORCE_MARGIN,
                    ),
                });
            }
        }
        Claim::judged(
            "imperfect_joint_raises_forces",
            "The joint with play raises the forces in joint 1",
            format!("agrees where the peak force of joint 1 at c = 0.6 mm exceeds the perfect joint's by {:.0} %", FORCE_MARGIN * 100.0),
            vec![
                Quantity::new("peak force of joint 1, perfect", "N"),
                Quantity::new("c = 0.6 mm", "N"),
                Quantity::new("peak torque of joint 1, change", "N·m"),
                Quantity::new("peak torque of joint 2, change", "N·m"),
            ],
            situations,
        )
        .remark("The increase depends on the drives: with a prescribed motion, the whole arm must bear the impact; with torques, the arm gives way.")
    }

    fn peaks_at_the_beginning(&self) -> Claim {
        let mut situations = Vec::new();
        for first in self.ladders() {
            for case in CLEARANCES.map(|clearance| Case { clearance, ..first }) {
                let Some(figures) = self.figures(&case) else { continue };
                let is_early = |time: f64| time < DeviationStatistics::START_DURATION;
                let early = figures.peaks.iter().filter(|peak| is_early(peak.time)).count() as f64;
                let late = figures.peaks.len() as f64 - early;
                let greatest = figures.peaks.iter().max_by(|a, b| a.force.total_cmp(&b.force));
                situations.push(Row {
                    situation: format!("{}, c = {} mm", case.situation(), case.clearance),
                    tags: tags(&case),
                    values: vec![early, late, greatest.map_or(f64::NAN, |peak| peak.time)],
                    reference: vec![None; 3],
                    holds: greatest.is_some_and(|peak| is_early(peak.time)) && early > late,
                });
            }
        }
        Claim::judged(
            "peaks_at_the_beginning",
            "The peaks of the force occur at the beginning of the motion",
            "agrees where the greatest peak of the normal force and more than half of all peaks (above 50 N, twice the force at rest; 20 N without gravity) come in the first 0.5 s",
            vec![
                Quantity::new("peaks before 0.5 s", ""),
                Quantity::new("peaks after", ""),
                Quantity::new("greatest peak at", "s"),
            ],
            situations,
        )
    }

    fn shorter_is_peakier(&self) -> Claim {
        let mut situations = Vec::new();
        for first in self.ladders().into_iter().filter(|case| case.period == PERIODS[0]) {
            for (place, clearance) in CLEARANCES.into_iter().enumerate() {
                let [short, long] = PERIODS.map(|period| Case { clearance, period, ..first });
                let count = |f: &Figures| f.peaks.len() as f64;
                let Some((many, few)) = self.extent(&short, count).zip(self.extent(&long, count)) else {
                    continue;
                };
                let theirs = |period: usize| (!first.gravity).then_some(WEIGHTLESS_PEAKS[period][place]);
                let values = [&short, &long].map(|case| self.figures(case).map_or(f64::NAN, count));
                situations.push(Row {
                    situation: short.situation().replace(", T = 6 s", &format!(", c = {clearance} mm")),
                    tags: tags(&short),
                    values: values.to_vec(),
                    reference: vec![theirs(0), theirs(1)],
                    holds: more(many, few),
                });
            }
        }
        Claim::judged(
            "shorter_period_more_peaks",
            "A shorter period gives more peaks of the force",
            format!(
                "agrees where T = 6 s has at least {:.0} and {:.0} % more peaks of the normal force than T = 12 s: two simulators' contacts differ by one",
                MORE_PEAKS.0,
                MORE_PEAKS.1 * 100.0
            ),
            PERIODS.iter().map(|t| Quantity::new(format!("peaks, T = {t} s"), "")).collect(),
            situations,
        )
        .remark("Drawn against the share of the lap, the same bounces of the first drop fill twice as much of the shorter record: that is not more peaks.")
    }

    fn shorter_is_more_chaotic(&self) -> Claim {
        let mut situations = Vec::new();
        for (drive, path) in self.scope.pairs() {
            let runs = PERIODS.map(|period| self.runs.get(&lapping(drive, path, period)));
            let [Some(six), Some(twelve)] = runs else { continue };
            let laps = [lap_difference(six, PERIODS[0]), lap_difference(twelve, PERIODS[1])];
            let [short, long] = laps;
            let theirs = match (drive, path) {
                (Drive::Driven, PathKind::SquareSharp) => [Some(1.1e-2), Some(5e-14)],
                _ => [None; 2],
            };
            situations.push(Row {
                situation: format!("{}, {}", path_name(path), drive_name(drive)),
                tags: tags(&Case::new(drive, path, PERIODS[0], CLEARANCES[2])),
                values: laps.to_vec(),
                reference: theirs.to_vec(),
                holds: short > REPEATS && short > MORE_CHAOS * long,
            });
        }
        Claim::judged(
            "shorter_period_more_chaotic",
            "A shorter period makes the deviation more chaotic",
            format!(
                "agrees where lap {LAPS} of T = 6 s differs from the lap before by a mean square above 1e-6 mm² (1 µm, the best resolution of a tracker) and {MORE_CHAOS:.0} times that of T = 12 s; a motion that repeats is not chaotic"
            ),
            PERIODS.iter().map(|t| Quantity::new(format!("lap to lap, T = {t} s"), "mm²")).collect(),
            situations,
        )
    }

    fn friction_opposes(&self) -> Claim {
        let mut situations = Vec::new();
        for &coefficient in &self.scope.frictions {
            for law in [FrictionLaw::Printed, FrictionLaw::Corrected] {
                let Some(run) = self.runs.get(&rubbing(law, coefficient)) else { continue };
                let (lost, fed) = (run.figures.ledger.contact_friction, run.figures.friction_fed);
                let name = if law == FrictionLaw::Printed { "as printed" } else { "corrected" };
                let tag: Tag = match law {
                    FrictionLaw::Printed => ("law", "the law is taken as printed"),
                    _ => ("law", "the law is corrected"),
                };
                situations.push(Row {
                    situation: format!("{name}, μ = {coefficient}"),
                    tags: vec![tag],
                    values: vec![fed * 1e3, lost * 1e3, early_spread(run)],
                    reference: vec![None, None, friction_spread(law, coefficient)],
                    holds: opposes(fed, lost),
                });
            }
        }
        Claim::judged(
            "friction_opposes_sliding",
            "The friction of the joint (Eqs. 6 and 7) opposes the sliding",
            format!("agrees where the friction in the bearing feeds in less than {:.0} % of the energy that it takes out in all, tick by tick (c = 0.4 mm, smooth path, T = 6 s): friction feeds nothing in, but a step that crosses rest is evaluated on one side of it", FED_IN * 100.0),
            vec![
                Quantity::new("energy fed in by friction", "mJ"),
                Quantity::new("lost to friction, in all", "mJ"),
                Quantity::new("std of x in 0.8–1.0 s", "mm"),
            ],
            situations,
        )
        .remark("As printed, Eq. 7 already carries the sign that Eq. 6 multiplies in once more, so that the force points along the sliding; its middle branch runs from μ_d to μ_s. Above v_s the reversed branch brakes again, so that the journal rattles about v_s. How much it rattles depends on how the printed signs are read, so that the reference's numbers differ. All other runs here use the corrected law.")
    }
}

/// Mean square of the difference between the deviation in the last lap and in the lap before, mm².
fn lap_difference(run: &Outcome, period: f64) -> f64 {
    let lap = (period / TICK).round() as usize;
    let last = run.trace.ticks().saturating_sub(lap);
    if last < lap {
        return f64::NAN;
    }
    let square = |tick: usize| {
        run.trace.deviation.iter().map(|axis| (axis[tick] - axis[tick - lap]).powi(2)).sum::<f64>()
    };
    (last..run.trace.ticks()).map(square).sum::<f64>() / lap as f64
}

/// Standard deviation of the x deviation in 0.8–1.0 s, mm.
fn early_spread(run: &Outcome) -> f64 {
    let at = |time: f64| (time / TICK).round() as usize;
    let x = run.trace.deviation[0].get(at(0.8)..at(1.0)).unwrap_or_default();
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    (x.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / x.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::{DEVIATION_MARGIN, FORCE_MARGIN, grows, more, opposes};

    #[test]
    fn growth_is_more_than_the_simulators_disagree() {
        let exact = |values: [f64; 3]| values.map(|value| (value, value));
        assert!(grows(&exact([0.2, 0.4, 0.6]), DEVIATION_MARGIN));
        assert!(!grows(&exact([0.2, 0.4, 0.41]), DEVIATION_MARGIN), "2.5 % is within the disagreement");
        assert!(!grows(&exact([204.0, 58.0, 48.0]), FORCE_MARGIN), "falling");
        assert!(grows(&[(1500.0, 1550.0), (1600.0, 1700.0)], FORCE_MARGIN));
        assert!(!grows(&[(1500.0, 1650.0), (1600.0, 1700.0)], FORCE_MARGIN), "the extents overlap");
        assert!(!grows(&[(f64::NAN, f64::NAN), (1.0, 1.0)], FORCE_MARGIN));
    }

    #[test]
    fn friction_that_feeds_energy_in_is_none() {
        assert!(opposes(0.0, 1e-3) && opposes(5e-6, 1e-3));
        assert!(!opposes(5e-4, 1e-3), "half of what it takes out");
        assert!(!opposes(0.0, 0.0) && !opposes(0.0, -1e-3));
    }

    #[test]
    fn more_peaks_are_more_than_one_contact() {
        assert!(more((79.0, 79.0), (33.0, 33.0)));
        assert!(!more((24.0, 24.0), (23.0, 23.0)), "one contact more");
        assert!(!more((105.0, 110.0), (100.0, 101.0)), "4 %");
        assert!(!more((2.0, 9.0), (1.0, 1.0)), "the least of the chaotic runs has one more only");
    }
}

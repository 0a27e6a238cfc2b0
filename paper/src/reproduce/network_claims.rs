//! The paper's claims about its network, judged by the trainings.
//!
//! A training depends on its seed (split and start weights), so that each question is asked several times and a difference counts if nearly all pairs of
//! trainings agree on it.

use freeplay_harness::scenario::Drive;
use freeplay_path::PathKind;

use super::case::{PERIODS, drive_name, path_name};
use super::claim::{Claim, Quantity, Row, Tag};
use super::dataset::TrainingRuns;
use super::network::{Cut, Experiment, Scores, Study, Trial, median, total};
use super::reference;

/// Share of all pairs of trainings that must agree on an order: four of five.
const AGREEMENT: f64 = 0.8;
/// A network is better than a baseline if it reduces the squared error by at least this share: smaller differences are within the scatter of seeds.
const LEAST_SKILL: f64 = 0.1;
/// A prediction counts as good from this R on.
const GOOD_R: f64 = 0.99;
/// The axes.
const AXES: [&str; 3] = ["x", "y", "z"];

/// Share of the pairs of a `greater` and a `smaller` value in which the first exceeds the second; ties count half.
fn superiority(greater: &[f64], smaller: &[f64]) -> f64 {
    let wins: f64 = greater
        .iter()
        .flat_map(|a| smaller.iter().map(move |b| (a, b)))
        .map(|(a, b)| {
            if a > b {
                1.0
            } else if a == b {
                0.5
            } else {
                0.0
            }
        })
        .sum();
    wins / (greater.len() * smaller.len()) as f64
}

/// R of each axis; 0 if one of the two is constant.
fn r(scores: &Scores, axis: usize) -> f64 {
    scores.test.get(axis).and_then(|score| score.r).unwrap_or(0.0)
}

fn least_r(scores: &Scores) -> f64 {
    (0..AXES.len()).map(|axis| r(scores, axis)).fold(f64::INFINITY, f64::min)
}

fn tags(setting: &Experiment, closed: bool) -> Vec<Tag> {
    let path = match setting.path {
        PathKind::SquareSharp => "the path has sharp corners",
        _ => "the path is smooth",
    };
    let drive = match setting.drive {
        Drive::Driven => "the motion is prescribed",
        Drive::Torque => "torques drive the joints",
        Drive::Servo => "servos drive the joints",
    };
    let cut = match setting.cut {
        Cut::Random => "the test samples lie between training samples",
        Cut::Block => "the test comes after the training",
    };
    let reach = if closed {
        "the network runs freely"
    } else {
        "measured deviations are at hand up to the sample before"
    };
    let pool = match setting.pool {
        TrainingRuns::Single => "one run is learnt from",
        TrainingRuns::Clearances => "all clearances are learnt from",
        TrainingRuns::Laps => "a lap was seen before",
    };
    vec![("cut", cut), ("reach", reach), ("path", path), ("drive", drive), ("pool", pool)]
}

fn situation(setting: &Experiment, closed: bool) -> String {
    let reach = if closed { "free run" } else { "one step" };
    format!(
        "{}, {}, {}, {} split, {reach}",
        path_name(setting.path),
        drive_name(setting.drive),
        setting.pool.name(),
        setting.cut.name()
    )
}

/// The two studies of a setting that differ in the period: T = 6 s, T = 12 s.
fn pairs(studies: &[Study]) -> impl Iterator<Item = (&Study, &Study)> {
    studies.iter().filter(|study| study.setting.period == PERIODS[0]).filter_map(|short| {
        let same = |study: &&Study| study.setting == Experiment { period: PERIODS[1], ..short.setting };
        studies.iter().find(same).map(|long| (short, long))
    })
}

/// All claims about the network.
pub fn claims(studies: &[Study]) -> Vec<Claim> {
    vec![error_falls(studies), correlation_rises(studies), correlation_tells(studies), predicts(studies)]
}

fn error_falls(studies: &[Study]) -> Claim {
    let mut situations = Vec::new();
    for (short, long) in pairs(studies).filter(|(short, _)| short.setting.pool != TrainingRuns::Laps) {
        for closed in [false, true] {
            let errors =
                |study: &Study| study.trials.iter().map(|trial| trial.error(closed)).collect::<Vec<f64>>();
            let known = |study: &Study, name| study.median(|trial| baseline(trial, name, closed));
            let Experiment { drive, path, cut, pool, .. } = short.setting;
            let theirs = reference::network_errors(drive, path, cut == Cut::Random)
                .filter(|_| pool == TrainingRuns::Single && !closed);
            let of = |values: Option<[f64; 2]>| {
                values.map_or([None; 2], |[six, twelve]| [Some(six), Some(twelve)])
            };
            let theirs = [theirs.map(|t| t.narx), theirs.map(|t| t.persistence), theirs.map(|t| t.arx)];
            situations.push(Row {
                situation: situation(&short.setting, closed),
                tags: tags(&short.setting, closed),
                values: vec![
                    median(errors(short)),
                    median(errors(long)),
                    known(short, "persistence"),
                    known(long, "persistence"),
                    known(short, "ridge ARX"),
                    known(long, "ridge ARX"),
                ],
                reference: theirs.into_iter().flat_map(of).collect(),
                holds: superiority(&errors(short), &errors(long)) >= AGREEMENT,
            });
        }
    }
    let agreeing =
        situations.iter().filter(|row| (row.values[0] > row.values[1]) == (row.values[2] > row.values[3]));
    let (agreeing, all) = (agreeing.count(), situations.len());
    let so = if 2 * agreeing > all { ": the order is a property of the data" } else { "" };
    Claim::judged(
        "network_error_falls_with_period",
        "The network's mean squared error is greater at T = 6 s than at T = 12 s",
        format!("agrees where at least {:.0} % of all pairs of trainings have the greater test error (sum over the axes) at T = 6 s", AGREEMENT * 100.0),
        ["network", "persistence", "ridge ARX"]
            .iter()
            .flat_map(|name| PERIODS.map(|period| Quantity::new(format!("{name}, T = {period} s"), "mm²")))
            .collect(),
        situations,
    )
    .remark(format!(
        "Persistence, which learns nothing, has the same order as the network in {agreeing} of {all} situations{so}."
    ))
}

/// The total test error of the baseline `name`, mm².
fn baseline(trial: &Trial, name: &str, closed: bool) -> f64 {
    let found = trial.baselines.iter().find(|baseline| baseline.name == name);
    found.map_or(f64::NAN, |baseline| total(if closed { &baseline.closed.test } else { &baseline.open.test }))
}

fn correlation_rises(studies: &[Study]) -> Claim {
    let mut situations = Vec::new();
    for (short, long) in pairs(studies).filter(|(short, _)| short.setting.pool != TrainingRuns::Laps) {
        for (axis, name) in AXES.into_iter().enumerate() {
            let values =
                |study: &Study| study.trials.iter().map(|trial| r(&trial.open, axis)).collect::<Vec<f64>>();
            let mut tags = tags(&short.setting, false);
            tags.push(("axis", ["the axis is x", "the axis is y", "the axis is z"][axis]));
            situations.push(Row {
                situation: format!("{}, {name}", situation(&short.setting, false)),
                tags,
                values: vec![median(values(short)), median(values(long))],
                reference: vec![None; 2],
                holds: superiority(&values(long), &values(short)) >= AGREEMENT,
            });
        }
    }
    Claim::judged(
        "network_correlation_rises_with_period",
        "The network's R is higher at T = 12 s than at T = 6 s",
        format!(
            "agrees where at least {:.0} % of all pairs of trainings have the higher R of the test, one sample ahead, at T = 12 s",
            AGREEMENT * 100.0
        ),
        PERIODS.iter().map(|t| Quantity::new(format!("R, T = {t} s"), "")).collect(),
        situations,
    )
}

fn correlation_tells(studies: &[Study]) -> Claim {
    let rows = studies.iter().map(|study| {
        let network = study.median(|trial| least_r(&trial.open));
        let persistence = study.median(|trial| {
            let found = trial.baselines.iter().find(|baseline| baseline.name == "persistence");
            found.map_or(f64::NAN, |baseline| least_r(&baseline.open))
        });
        Row {
            situation: format!("{}, T = {} s", situation(&study.setting, false), study.setting.period),
            tags: tags(&study.setting, false),
            values: vec![network, persistence],
            reference: vec![None; 2],
            holds: network >= GOOD_R && persistence < GOOD_R,
        }
    });
    Claim::judged(
        "correlation_shows_prediction",
        "An R close to 1 shows that the network predicts the deviation",
        format!(
            "agrees where the network's R is at least {GOOD_R} in every axis and that of persistence is not: an R that repeating the last value reaches shows nothing"
        ),
        ["network", "persistence"].map(|name| Quantity::new(format!("least R, {name}"), "")).to_vec(),
        rows.collect(),
    )
}

fn predicts(studies: &[Study]) -> Claim {
    let mut situations = Vec::new();
    for study in studies {
        for closed in [false, true] {
            let best = study.median(|trial| trial.best_baseline(closed).1);
            let name = study.trials.first().map_or("none", |trial| trial.best_baseline(closed).0);
            let skill = study.skill(closed);
            situations.push(Row {
                situation: format!(
                    "{}, T = {} s; best baseline: {name}",
                    situation(&study.setting, closed),
                    study.setting.period
                ),
                tags: tags(&study.setting, closed),
                values: vec![study.median(|trial| trial.error(closed)), best, skill],
                reference: vec![None; 3],
                holds: skill >= LEAST_SKILL,
            });
        }
    }
    let negative = situations.iter().filter(|row| row.values[2] < 0.0).count();
    let all = situations.len();
    Claim::judged(
        "network_predicts",
        "The network predicts the deviation",
        format!("agrees where the median test error is at least {:.0} % below that of the best of persistence, ridge ARX on the same regressors, the quasi-static prediction and, where there is one, the previous lap", LEAST_SKILL * 100.0),
        vec![
            Quantity::new("network", "mm²"),
            Quantity::new("best baseline", "mm²"),
            Quantity::new("skill", ""),
        ],
        situations,
    )
    .remark(format!("In {negative} of {all} situations the network is worse than a baseline without learning."))
}

#[cfg(test)]
mod tests {
    use super::{claims, least_r, superiority};
    use crate::reproduce::case::PERIODS;
    use crate::reproduce::claim::Ruling;
    use crate::reproduce::dataset::TrainingRuns;
    use crate::reproduce::network::{Baseline, Cut, Experiment, Prediction, Scores, Study, Trial};
    use freeplay_harness::scenario::Drive;
    use freeplay_path::PathKind;
    use freeplay_predictor::metrics::{Parts, Score};

    fn scores(mse: f64, r: f64) -> Scores {
        let axes = vec![Score { count: 10, mse, r: Some(r), max: 1.0 }; 3];
        Parts { train: axes.clone(), validation: axes.clone(), test: axes }
    }

    /// A study whose trainings have the errors `mse`, with a persistence baseline of error `known` and correlation `r`.
    fn study(period: f64, mse: [f64; 3], known: f64, r: f64) -> Study {
        let trial = |(seed, mse): (usize, f64)| Trial {
            seed: seed as u64,
            epochs: 5,
            open: scores(mse, 0.995),
            closed: scores(mse, 0.995),
            baselines: vec![Baseline {
                name: "persistence",
                open: scores(known, r),
                closed: scores(known, r),
            }],
        };
        let setting = Experiment {
            drive: Drive::Driven,
            path: PathKind::Lissajous,
            period,
            pool: TrainingRuns::Single,
            cut: Cut::Random,
        };
        let trials = mse.into_iter().enumerate().map(trial).collect();
        Study { setting, windows: [5, 2, 3], weights: 703, trials, shown: Prediction::default() }
    }

    fn ruling(studies: &[Study], id: &str) -> Ruling {
        claims(studies).into_iter().find(|claim| claim.id == id).expect("the claim").ruling
    }

    #[test]
    fn superiority_counts_pairs() {
        assert_eq!(superiority(&[3.0, 4.0], &[1.0, 2.0]), 1.0);
        assert_eq!(superiority(&[1.0], &[1.0]), 0.5);
        assert_eq!(superiority(&[1.0, 4.0], &[2.0, 3.0]), 0.5);
        assert_eq!(superiority(&[f64::NAN], &[1.0]), 0.0, "what is no number wins nothing");
        assert_eq!(least_r(&scores(1.0, 0.5)), 0.5);
    }

    #[test]
    fn the_error_must_fall_in_nearly_all_pairs_of_trainings() {
        let id = "network_error_falls_with_period";
        let [six, twelve] = PERIODS;
        let long = study(twelve, [1.0, 1.1, 1.2], 2.0, 0.9);
        assert_eq!(ruling(&[study(six, [2.0, 2.1, 2.2], 2.0, 0.9), long.clone()], id), Ruling::Holds);
        assert_eq!(ruling(&[study(six, [0.9, 1.15, 2.2], 2.0, 0.9), long], id), Ruling::DoesNotHold);
    }

    #[test]
    fn a_network_predicts_only_if_it_beats_what_needs_no_learning() {
        let id = "network_predicts";
        assert_eq!(ruling(&[study(6.0, [1.0, 1.1, 1.2], 2.0, 0.9)], id), Ruling::Holds);
        assert_eq!(ruling(&[study(6.0, [1.0, 1.1, 1.2], 1.15, 0.9)], id), Ruling::DoesNotHold);
    }

    #[test]
    fn an_r_that_persistence_reaches_shows_nothing() {
        let id = "correlation_shows_prediction";
        assert_eq!(ruling(&[study(6.0, [1.0; 3], 2.0, 0.9)], id), Ruling::Holds);
        assert_eq!(ruling(&[study(6.0, [1.0; 3], 2.0, 0.999)], id), Ruling::DoesNotHold);
    }
}

//! Tables of the report: cost of the imperfect joint, network, compensation, agreement with the independent reference.

use freeplay_predictor::metrics::Score;
use freeplay_report::{Cell, Column, Content, Table, Verdict};

use super::case::{CLEARANCES, Case, PERIODS, Scope, drive_name, path_name};
use super::claim::{Claim, Ruling};
use super::compensation::{Played, reference};
use super::network::{Study, Trial, total};
use super::reference::Independent;
use super::trace::{Outcome, Runs};

/// Display of a verdict on the paper.
pub fn shown(claim: &Claim) -> Verdict {
    match claim.ruling {
        Ruling::Holds => Verdict::Ok,
        Ruling::HoldsOnlyIf(_) => Verdict::Warn,
        Ruling::DoesNotHold => Verdict::Fail,
    }
}

/// All claims with their verdicts.
pub fn claims(claims: &[Claim]) -> Table {
    let mut table = Table::new("The paper's claims")
        .column(Column::text("claim").wrapping())
        .column(Column::text("verdict"))
        .column(Column::text("condition").wrapping())
        .column(Column::text("situations that agree"));
    for claim in claims {
        let condition = match &claim.ruling {
            Ruling::HoldsOnlyIf(condition) => condition.clone(),
            _ => String::new(),
        };
        let (agreeing, all) = claim.count();
        table = table.row([
            claim.claim.into(),
            Cell::verdict_in_words(shown(claim), claim.verdict()),
            condition.into(),
            format!("{agreeing} of {all}").into(),
        ]);
    }
    table
}

/// The numbers behind a claim, with those of the independent reference if it has any.
pub fn situations(claim: &Claim) -> Table {
    let mut table = Table::new("").column(Column::text("situation"));
    let has_reference = |place: usize| claim.situations.iter().any(|row| row.reference[place].is_some());
    for (place, quantity) in claim.quantities.iter().enumerate() {
        let both = has_reference(place);
        let column =
            |title: &str| Column::number(title, quantity.unit).significant(3).group(quantity.name.as_str());
        if both {
            table = table.column(column("ours")).column(column("reference"));
        } else {
            table = table.column(Column::number(quantity.name.as_str(), quantity.unit).significant(3));
        }
    }
    table = table.column(Column::text("agrees"));
    for row in &claim.situations {
        let mut cells = vec![Cell::from(row.situation.as_str())];
        for (place, value) in row.values.iter().enumerate() {
            cells.push((*value).into());
            if has_reference(place) {
                cells.push(row.reference[place].unwrap_or(f64::NAN).into());
            }
        }
        cells.push(if row.holds {
            Cell::verdict_in_words(Verdict::Ok, "yes")
        } else {
            Cell::verdict_in_words(Verdict::Fail, "no")
        });
        table = table.row(cells);
    }
    table
}

/// The cost of the imperfect joint.
pub fn cost(runs: &Runs, scope: &Scope) -> Table {
    let mut table = Table::new("The imperfect joint beside the perfect one")
        .column(Column::text("run"))
        .column(Column::number("c", "mm").fixed(1))
        .column(Column::number("RMS", "mm").fixed(4).group("deviation"))
        .column(Column::number("max", "mm").fixed(4).group("deviation"))
        .column(Column::number("peak", "N").fixed(0).group("force of joint 1"))
        .column(Column::number("change", "N").fixed(0).group("force of joint 1"))
        .column(Column::number("peak, joint 1", "N·m").fixed(1).group("torque"))
        .column(Column::number("peak, joint 2", "N·m").fixed(1).group("torque"))
        .column(Column::number("put in", "J").fixed(2).group("energy"))
        .column(Column::number("change", "J").fixed(3).group("energy"))
        .column(Column::number("lost in the bearing", "mJ").fixed(2).group("energy"));
    for (drive, path) in scope.pairs() {
        for period in PERIODS {
            let perfect = Case::new(drive, path, period, 0.0);
            let Some(ideal) = runs.get(&perfect) else { continue };
            let cases = std::iter::once(0.0).chain(CLEARANCES).map(|clearance| Case { clearance, ..perfect });
            for run in cases.filter_map(|case| runs.get(&case)) {
                table = table.row(cost_row(run, ideal));
            }
        }
    }
    table.note("Forces are the greatest within each millisecond, torques those at its end. Energy put in: the energy from the motors, without the energy that they take back.")
}

fn cost_row(run: &Outcome, ideal: &Outcome) -> Vec<Cell> {
    let (of, perfect) = (&run.figures, &ideal.figures);
    let lost = (of.ledger.damping + of.ledger.contact_friction) * 1e3;
    vec![
        run.case.situation().into(),
        run.case.clearance.into(),
        of.deviation[0].rms.into(),
        of.deviation[0].max.into(),
        of.peak_base.into(),
        (of.peak_base - perfect.peak_base).into(),
        of.torque[0].peak.into(),
        of.torque[1].peak.into(),
        of.work.into(),
        (of.work - perfect.work).into(),
        lost.into(),
    ]
}

/// Network and baselines on the test windows, one step and free run.
pub fn networks(studies: &[Study], closed: bool) -> Table {
    let title = if closed { "Free run (closed loop)" } else { "One sample ahead (open loop)" };
    let mut table = Table::new(format!("{title}: mean squared test error, sum over the axes"))
        .column(Column::text("runs"))
        .column(Column::text("learnt from"))
        .column(Column::text("split"))
        .column(Column::number("network", "mm²"))
        .column(Column::number("persistence", "mm²"))
        .column(Column::number("ridge ARX", "mm²"))
        .column(Column::number("quasi-static", "mm²"))
        .column(Column::number("previous lap", "mm²"))
        .column(Column::number("skill of the network", "").fixed(2));
    for study in studies {
        let setting = &study.setting;
        let error = |name: &str| {
            study.median(|trial| {
                let found = trial.baselines.iter().find(|baseline| baseline.name == name);
                found.map_or(f64::NAN, |b| total(if closed { &b.closed.test } else { &b.open.test }))
            })
        };
        let mut cells = vec![
            format!("{}, {}, T = {} s", path_name(setting.path), drive_name(setting.drive), setting.period)
                .into(),
            setting.pool.name().into(),
            setting.cut.name().into(),
            study.median(|trial| trial.error(closed)).into(),
        ];
        cells.extend(
            ["persistence", "ridge ARX", "quasi-static", "previous lap"].map(|name| Cell::from(error(name))),
        );
        cells.push(study.skill(closed).into());
        table = table.row(cells);
    }
    table.note("Medians over the trainings. Skill: 1 − MSE / MSE of the best baseline; below zero the network is worse than a baseline without learning. Quasi-static: the physics prediction from the reference motion, one step with the last residual added. The previous lap exists where a lap was run before.")
}

/// The network's error and R by axis and part.
pub fn by_axis(studies: &[Study]) -> Table {
    let mut table = Table::new(
        "The network by axis: MSE and R in training, validation and test, one sample ahead; test in free run",
    )
    .column(Column::text("runs"))
    .column(Column::text("learnt from"))
    .column(Column::text("split"))
    .column(Column::text("axis"));
    for part in ["training", "validation", "test", "test, free run"] {
        table = table
            .column(Column::number("MSE", "mm²").group(part))
            .column(Column::number("R", "").fixed(4).group(part));
    }
    for study in studies {
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let setting = &study.setting;
            let mut cells: Vec<Cell> = vec![
                format!(
                    "{}, {}, T = {} s",
                    path_name(setting.path),
                    drive_name(setting.drive),
                    setting.period
                )
                .into(),
                setting.pool.name().into(),
                setting.cut.name().into(),
                name.into(),
            ];
            let parts: [fn(&Trial) -> &Vec<Score>; 4] =
                [|t| &t.open.train, |t| &t.open.validation, |t| &t.open.test, |t| &t.closed.test];
            for part in parts {
                cells.push(study.median(|trial| part(trial)[axis].mse).into());
                cells.push(study.median(|trial| part(trial)[axis].r.unwrap_or(f64::NAN)).into());
            }
            table = table.row(cells);
        }
    }
    table
}

/// Size of each training.
pub fn sizes(studies: &[Study]) -> Table {
    let mut table = Table::new("Trainings")
        .column(Column::text("runs"))
        .column(Column::text("learnt from"))
        .column(Column::text("split"))
        .column(Column::number("weights", ""))
        .column(Column::number("training", "").group("windows"))
        .column(Column::number("validation", "").group("windows"))
        .column(Column::number("test", "").group("windows"))
        .column(Column::text("epochs of each seed"));
    for study in studies {
        let setting = &study.setting;
        let [train, validation, test] = study.windows.map(|count| Cell::from(Content::Count(count as u64)));
        let epochs: Vec<String> = study.trials.iter().map(|trial| trial.epochs.to_string()).collect();
        table = table.row([
            format!("{}, {}, T = {} s", path_name(setting.path), drive_name(setting.drive), setting.period)
                .into(),
            setting.pool.name().into(),
            setting.cut.name().into(),
            Content::Count(study.weights as u64).into(),
            train,
            validation,
            test,
            epochs.join(", ").into(),
        ]);
    }
    table
}

/// The remaining deviation with the built-in controllers.
pub fn compensation(played: &[Played]) -> Table {
    let mut table =
        Table::new("Deviation left by the built-in controllers after 0.5 s, torque-driven, true model")
            .column(Column::text("path"))
            .column(Column::number("T", "s"))
            .column(Column::number("c", "mm").fixed(1));
    let names: Vec<&str> =
        played.first().map_or(Vec::new(), |first| first.left.iter().map(|l| l.controller.as_str()).collect());
    for what in ["RMS", "max"] {
        for name in &names {
            table = table.column(Column::number(*name, "mm").fixed(4).group(what));
        }
    }
    table = table.column(Column::number("feed-forward", "mm").fixed(4).group("reference, RMS"));
    for Played { task, left } in played {
        let mut cells = vec![path_name(task.path).into(), task.period.into(), task.clearance.into()];
        let judged = |value: f64, finished: bool| {
            let cell = Cell::from(value);
            if finished { cell } else { cell.judged(Verdict::Warn) }
        };
        cells.extend(left.iter().map(|one| judged(one.rms, one.finished)));
        cells.extend(left.iter().map(|one| judged(one.max, one.finished)));
        cells.push(reference(task).unwrap_or(f64::NAN).into());
        table = table.row(cells);
    }
    table.note("`computed-torque` compensates nothing. \"warn\" marks runs that did not end under control. Reference: an independent simulation with a feed-forward of its own that leaves friction out. The paper itself compensates nothing: this is a possible use of its prediction.")
}

/// Our runs compared with those of the independent reference.
pub fn agreement(runs: &Runs, independent: &Independent) -> Table {
    let mut table = Table::new("Runs of the independent reference beside ours")
        .column(Column::text("run"))
        .column(Column::number("c", "mm").fixed(1));
    for (group, unit, digits) in [
        ("RMS", "mm", 4),
        ("max", "mm", 3),
        ("peak force of joint 1", "N", 0),
        ("peak normal force", "N", 0),
        ("contacts", "", 0),
    ] {
        for whose in ["reference", "ours"] {
            table = table.column(Column::number(whose, unit).fixed(digits).group(group));
        }
    }
    for run in &runs.0 {
        let Some(theirs) = independent.run(&run.case) else { continue };
        let ours = &run.figures;
        let known = |value: Option<f64>| Cell::from(value.unwrap_or(f64::NAN));
        table = table.row([
            run.case.situation().into(),
            run.case.clearance.into(),
            theirs.norm_rms.into(),
            ours.deviation[0].rms.into(),
            theirs.norm_max.into(),
            ours.deviation[0].max.into(),
            theirs.peak_base.into(),
            ours.peak_base.into(),
            known(theirs.peak_normal),
            known(ours.contact.map(|contact| contact.peak_normal_force)),
            known(theirs.n_contacts),
            known(ours.contact.map(|contact| contact.contacts as f64)),
        ]);
    }
    table.note("`freeplay reference-runs` judges these and more by tolerances. At sharp corners in 6 s a run is chaotic: clearances within 0.002 % differ as much as the two simulators do.")
}

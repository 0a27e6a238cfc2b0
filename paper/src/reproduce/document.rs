//! The report: verdicts first, then the numbers and pictures behind them.

use freeplay_harness::scenario::Drive;
use freeplay_path::PathKind;
use freeplay_report::{Block, Document, Figure, Section};
use freeplay_terminal::exit::Failure;

use super::case::{CLEARANCES, PERIODS};
use super::claim::{Claim, Ruling};
use super::dataset::TrainingRuns;
use super::network::{Cut, Study};
use super::{Reproduction, figures, parameters, tables};

/// The whole report.
///
/// # Errors
/// Impossible parameters.
pub fn document(done: &Reproduction) -> Result<Document, Failure> {
    let mut document = Document::new("Erkaya (2018), reproduced")
        .subtitle("A six-axis arm whose joint 5 has play: the claims of the paper, the results of its equations, and its open choices")
        .overview(counts(&done.claims))
        .overview(tables::claims(&done.claims))
        .section(verdicts(&done.claims))
        .section(parameters()?)
        .section(joint(done))
        .section(forces(done))
        .section(deviations(done))
        .section(
            Section::new("Cost of the imperfect joint").with(tables::cost(&done.runs, &done.scope)),
        );
    if !done.studies.is_empty() {
        document = document.section(network(&done.studies));
    }
    document = document.section(compensation(done)).section(
        Section::new("Agreement with an independent simulator")
            .with(tables::agreement(&done.runs, &done.independent)),
    );
    Ok(document.footer(format!("made by `{}`", done.command)).footer("figures: plotters, MIT licence"))
}

fn counts(claims: &[Claim]) -> Block {
    let count = |is: fn(&Ruling) -> bool| claims.iter().filter(|claim| is(&claim.ruling)).count().to_string();
    Block::Figures(vec![
        Figure::new("claims that hold", count(|r| *r == Ruling::Holds), ""),
        Figure::new("hold only if …", count(|r| matches!(r, Ruling::HoldsOnlyIf(_))), ""),
        Figure::new("do not hold", count(|r| *r == Ruling::DoesNotHold), ""),
    ])
}

fn verdicts(claims: &[Claim]) -> Section {
    let mut section = Section::new("The claims one by one").with(
        "Every verdict is computed from the runs of this very command; a situation is a path, a drive, a period or another condition of the claim. If an independent simulator or training has the same number, the table shows it beside ours.",
    );
    for claim in claims {
        let words = match &claim.ruling {
            Ruling::HoldsOnlyIf(condition) => format!("{condition}: {}.", claim.claim),
            _ => format!("{}.", claim.claim),
        };
        let (agreeing, all) = claim.count();
        section = section.with(Block::Judged {
            verdict: tables::shown(claim),
            word: claim.verdict().to_owned(),
            text: words,
        });
        if !claim.remark.is_empty() {
            section = section.with(claim.remark.clone());
        }
        section = section.with(Block::Details {
            summary: format!("Numbers: {agreeing} of {all} situations agree"),
            blocks: vec![format!("A situation {}.", claim.rule).into(), tables::situations(claim).into()],
        });
    }
    section
}

fn parameters() -> Result<Section, Failure> {
    Ok(Section::new("Parameters and open choices")
        .with(parameters::links())
        .with(parameters::simulation()?)
        .with(parameters::left_open()))
}

fn joint(done: &Reproduction) -> Section {
    let mut section = Section::new("The joint with play").with(
        "The content of the paper's Fig. 2: the journal in its bearing flies freely, hits, or stays in contact. A contact shorter than 2 ms is an impact; a Hertz impact here lasts 0.5 ms.",
    );
    for (title, caption, orbit) in &done.orbits {
        section = section.with(figures::orbit(title, caption, orbit, CLEARANCES[2]));
    }
    section
}

fn forces(done: &Reproduction) -> Section {
    let mut section = Section::new("Forces of joint 1, torques of joints 1 and 2").with(
        "The quantities of Figs. 5 to 13 of the paper, according to its text; a comparison with the figures themselves was not possible.",
    );
    for (drive, path) in done.scope.pairs() {
        section = section.with(figures::base_force(&done.runs, drive, path));
    }
    for (drive, path) in done.scope.pairs() {
        section = section.with(figures::torques(&done.runs, drive, path, PERIODS[0]));
    }
    section
}

fn deviations(done: &Reproduction) -> Section {
    let mut section = Section::new("Deviation of the tool");
    for path in &done.scope.paths {
        for period in PERIODS {
            section = section.with(figures::deviation(&done.runs, Drive::Driven, *path, period));
        }
    }
    section.with(figures::friction(&done.runs))
}

fn network(studies: &[Study]) -> Section {
    let mut section = Section::new("The network")
        .with("The paper's network: 4 hidden layers of 10 sigmoid units; torques of six joints and three path components now and two samples back, deviations two samples back; where it learns from several clearances also their size, the number and the place of joints with play. Levenberg–Marquardt by MATLAB's rule, stopped early on the validation part. Only the seeds 1, 2, … are random: the same command gives the same networks.")
        .with(tables::networks(studies, false))
        .with(tables::networks(studies, true));
    let is_shown = |study: &&Study| {
        let setting = &study.setting;
        let pool = if studies.iter().any(|study| study.setting.pool == TrainingRuns::Clearances) {
            TrainingRuns::Clearances
        } else {
            TrainingRuns::Single
        };
        setting.drive == Drive::Driven && setting.cut == Cut::Random && setting.pool == pool
    };
    let shown: Vec<&Study> = studies.iter().filter(is_shown).collect();
    for study in shown
        .iter()
        .filter(|study| study.setting.path == PathKind::Lissajous || study.setting.period == PERIODS[0])
    {
        section = section.with(figures::prediction(study));
    }
    for study in &shown {
        section = section.with(figures::scatter(study));
    }
    section.with(Block::Details {
        summary: "By axis and part; sizes and epochs".into(),
        blocks: vec![tables::by_axis(studies).into(), tables::sizes(studies).into()],
    })
}

fn compensation(done: &Reproduction) -> Section {
    let section = Section::new("Deviation that compensation leaves");
    if done.played.is_empty() {
        return section.with("Left out in this run: see `--skip`.");
    }
    section.with(tables::compensation(&done.played))
}

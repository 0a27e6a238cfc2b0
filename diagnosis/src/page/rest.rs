//! The end of the page: alternatives, untestable effects, the model, next steps, and the evidence.

use freeplay_model::to_toml;
use freeplay_report::units::power_of_ten;
use freeplay_report::{Block, Cell, Column, Section, Table, Verdict};

use super::Subject;
use super::findings::{kind_title, title};
use crate::Diagnosis;

/// The alternatives; `None` without any.
pub fn alternatives(diagnosis: &Diagnosis) -> Option<Section> {
    if diagnosis.alternatives.is_empty() {
        return None;
    }
    let mut table = Table::new("Alternatives to the named effects, the closest first")
        .column(Column::text("named effect").wrapping())
        .column(Column::text("alternative").wrapping())
        .column(Column::text(""))
        .column(Column::text("odds against it"))
        .column(Column::text("reason").wrapping())
        .note("Odds below 20 : 1 do not separate two effects.");
    for other in &diagnosis.alternatives {
        let (verdict, why) = if other.indistinguishable {
            let why = format!("{}. To separate the two: {}", other.why_not, other.what_would_separate);
            (Cell::verdict_in_words(Verdict::Warn, "indistinguishable"), why)
        } else {
            (Cell::verdict_in_words(Verdict::Ok, "ruled out"), other.why_not.clone())
        };
        table = table.row([
            Cell::from(in_words(&other.instead_of)),
            title(other.kind, other.joint.as_deref()).into(),
            verdict,
            format!("{} : 1", power_of_ten(other.log_odds_against)).into(),
            why.into(),
        ]);
    }
    Some(Section::new("Alternatives").with(table))
}

/// `coulomb_friction of elbow` in the form of [`title`].
pub fn in_words(effect: &str) -> String {
    let (kind, place) = effect.split_once(' ').unwrap_or((effect, ""));
    let place = place.strip_prefix("of ").unwrap_or(place);
    if place == "the whole arm" || place.is_empty() { title(kind, None) } else { title(kind, Some(place)) }
}

/// The effects that these recordings can't show, with the reason.
pub fn untestable(diagnosis: &Diagnosis) -> Option<Section> {
    if diagnosis.untestable.is_empty() && diagnosis.quality.is_empty() {
        return None;
    }
    let mut section = Section::new("Limits of this recording");
    if !diagnosis.quality.is_empty() {
        section = section.with(Block::List(diagnosis.quality.clone()));
    }
    let reasons = reasons(diagnosis);
    if reasons.is_empty() {
        return Some(section);
    }
    let mut table = Table::new("Untestable effects")
        .column(Column::text("because").wrapping())
        .column(Column::text("effects").wrapping());
    for (because, names) in reasons {
        table = table.row([Cell::from(because), names.join(", ").into()]);
    }
    Some(section.with(table))
}

/// The reasons why kinds are untestable, each once, with the kinds that share it.
pub fn reasons(diagnosis: &Diagnosis) -> Vec<(&str, Vec<&str>)> {
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    for one in &diagnosis.untestable {
        let name = kind_title(one.kind);
        match reasons.iter_mut().find(|(because, _)| *because == one.because) {
            Some((_, names)) if names.contains(&name) => {}
            Some((_, names)) => names.push(name),
            None => reasons.push((&one.because, vec![name])),
        }
    }
    reasons
}

/// The model with the findings, and its use; `None` if the program compared nothing with it.
pub fn model(subject: &Subject) -> Option<Section> {
    if !subject.diagnosis.has_model() {
        return None;
    }
    let text = to_toml(&subject.diagnosis.model);
    let effects = text.find("[[effect]]").map_or("", |at| &text[at..]);
    let mut section = Section::new("The model");
    let changes = subject.diagnosis.changes_model();
    section = if !changes {
        section.with("The diagnosis adds nothing to the model: `model.toml` is the model as given.")
    } else if effects.is_empty() {
        section.with("`model.toml` is the model with the gravity that the recording shows.")
    } else {
        section
            .with("`model.toml` is the model with these effects; its masses, lengths and friction are tuned within their tolerances. `compare`, `run` and the controllers read this file directly.")
            .with(Block::Code(effects.trim_end().to_owned()))
    };
    if changes {
        section = section.with(Block::Code(subject.commands.join("\n")));
    }
    Some(
        section
            .with(Block::Details { summary: "The whole file".to_owned(), blocks: vec![Block::Code(text)] }),
    )
}

/// The next steps; `None` without any.
pub fn next(diagnosis: &Diagnosis) -> Option<Section> {
    (!diagnosis.next.is_empty()).then(|| Section::new("Next steps").with(Block::List(diagnosis.next.clone())))
}

/// The evidence: every kind at every place, and the tolerances that the fit used.
pub fn judged(diagnosis: &Diagnosis) -> Option<Section> {
    diagnosis.fit.as_ref()?;
    let mut evidence = Table::new("Evidence for every kind at every place")
        .column(Column::text("effect"))
        .column(Column::number("alone", ""))
        .column(Column::number("beside the findings", ""))
        .note("Natural logarithm of the odds that the effect is missing from the model, prior odds included: 3 means 20 to 1, and below 0 the effect is improbable.");
    for row in &diagnosis.evidence {
        evidence = evidence.row([
            Cell::from(title(row.kind, row.joint.as_deref())),
            row.alone.into(),
            row.beside.into(),
        ]);
    }
    let mut tuned = Table::new("Tuning of the model within its tolerances, beside the findings")
        .column(Column::text("tolerance"))
        .column(Column::number("standard deviations", "").significant(2))
        .note("A tolerance is 1.7 standard deviations wide.");
    for one in &diagnosis.tuned {
        tuned = tuned.row([Cell::from(one.name.as_str()), one.deviations.into()]);
    }
    let mut followed = Table::new("Accuracy of the laws, with the findings in the model")
        .column(Column::text("channel"))
        .column(Column::number("off by", "%").significant(2))
        .column(Column::number("noise of the instruments", "").significant(2))
        .note(
            "Error of the laws as a share of the local size of the channel: some per cent on real machines.",
        );
    for (channel, discrepancy) in &diagnosis.discrepancy {
        let cells =
            [Cell::from(channel.as_str()), (100.0 * discrepancy.share).into(), discrepancy.noise.into()];
        followed = followed.row(cells);
    }
    let text = "The data were cut into three parts. The fit part shows which effects are missing. The choice part decides between sets of effects that fit equally well, and helps to estimate their parameters. No law was fitted to the test part: it only decided which laws remain, and gave the errors and gains of this report. The search for transients, such as pushes, used all parts; their rows are not in the test.";
    let blocks = vec![followed.into(), evidence.into(), tuned.into()];
    Some(
        Section::new("Method")
            .with(text)
            .with(Block::Details { summary: "Evidence and tolerances".to_owned(), blocks }),
    )
}

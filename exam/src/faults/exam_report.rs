//! An exam in words, as JSON, as JUnit XML and as HTML.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use comfy_table::CellAlignment;
use freeplay_harness::plant_command::pace_name;
use freeplay_harness::scenario::Scenario;
use freeplay_report::{Block, Cell, Column, Document, Section, Table, Verdict as Mark};
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::write;
use freeplay_terminal::layout::text_table;
use serde_json::json;

use crate::faults::environment_faults::EnvironmentFault;
use crate::faults::findings::Verdict;
use crate::faults::kinds::Expected;

/// The schema of `faults.json`.
const SCHEMA: &str = "freeplay.faults/1";

/// The report of one exam.
pub struct Report<'a> {
    /// The controller that was examined.
    pub examined: &'a str,
    /// The standby controller.
    pub standby: &'a str,
    /// The scenario with the values measured for the exam.
    pub scenario: &'a Scenario,
    /// The verdicts on the kinds of fault.
    pub verdicts: &'a [Verdict],
    /// Faults outside the controller.
    pub surroundings: &'a [EnvironmentFault],
}

/// `name` or, of several, `name 3, other 2`.
fn counted<Name: AsRef<str>>(counts: &BTreeMap<Name, usize>) -> String {
    if let [(name, _)] = counts.iter().collect::<Vec<_>>()[..] {
        return name.as_ref().replace('_', " ");
    }
    let each = counts.iter().map(|(name, count)| format!("{} {count}", name.as_ref().replace('_', " ")));
    each.collect::<Vec<_>>().join(", ")
}

fn expected(verdict: &Verdict) -> String {
    match verdict.kind.expected() {
        Expected::Detected { ticks: 1 } => "detected at the next tick".to_owned(),
        Expected::Detected { ticks } => format!("detected within {ticks} ticks"),
        Expected::Compared => "detected by comparison, or harmless".to_owned(),
        Expected::Harmless => "no harm".to_owned(),
    }
}

/// Number of detected faults among the judged ones, and number of faults during a stall.
fn detected(verdict: &Verdict) -> String {
    let judged = format!("{} of {}", verdict.detected, verdict.judged);
    match verdict.stalled {
        0 => judged,
        stalled => format!("{judged} (+{stalled})"),
    }
}

/// Number of detected faults after which the standby was in force, at once and soon.
fn taken_over(verdict: &Verdict) -> String {
    match verdict.detected {
        0 => "–".to_owned(),
        _ => format!("{}, {}", verdict.taken_over_at_once, verdict.taken_over_soon),
    }
}

fn slowest(verdict: &Verdict) -> String {
    verdict.slowest.map_or_else(|| "–".to_owned(), |ticks| ticks.to_string())
}

fn word(holds: bool) -> &'static str {
    if holds { "holds" } else { "FAILS" }
}

impl<'a> Report<'a> {
    /// True if all outcomes met the expectations; kinds that could not be tried do not count.
    pub fn holds(&self) -> bool {
        self.failures() == 0
    }

    fn failures(&self) -> usize {
        let of_kinds = self.verdicts.iter().filter(|verdict| !verdict.holds).count();
        of_kinds + self.surroundings.iter().filter(|found| found.holds == Some(false)).count()
    }

    /// All results.
    ///
    /// # Errors
    /// Never for these values; the library's error is passed on.
    pub fn json(&self) -> Result<String, Failure> {
        let report = json!({
            "schema": SCHEMA, "freeplay": env!("CARGO_PKG_VERSION"), "controller": self.examined,
            "standby": self.standby, "scenario": self.scenario, "machine": freeplay_shm::Machine::read(),
            "verdicts": self.verdicts, "surroundings": self.surroundings,
        });
        serde_json::to_string_pretty(&report).map_err(Failure::internal)
    }

    /// Writes `faults.json`, `faults.xml` (JUnit) and `faults.html` into `out`.
    ///
    /// # Errors
    /// A file that can't be written.
    pub fn write(&self, out: &Path) -> Result<(), Failure> {
        write(&out.join("faults.json"), &self.json()?)?;
        write(&out.join("faults.xml"), &self.junit())?;
        write(&out.join("faults.html"), &self.html())
    }

    /// The text for the terminal.
    pub fn in_words(&self, out: &Path) -> String {
        let mut table = text_table();
        table.set_header([
            "\nfault",
            "\nfaults",
            "in\ncontact",
            "\ndetected",
            "slowest\n[ticks]",
            "standby applied\nat once, soon",
            "\nas",
            "\napplied",
            "active\nnext",
            "held\n[ticks]",
            "deviation\nof usual",
            "\nverdict",
        ]);
        for verdict in self.verdicts {
            table.add_row([
                verdict.kind.name().to_owned(),
                verdict.count.to_string(),
                verdict.in_contact.to_string(),
                detected(verdict),
                slowest(verdict),
                taken_over(verdict),
                counted(&verdict.reasons),
                counted(&verdict.applied),
                counted(&verdict.next_in_charge),
                verdict.most_held.to_string(),
                format!("{:.2}", verdict.deviation_ratio),
                word(verdict.holds).to_owned(),
            ]);
        }
        for column in [1, 2, 3, 4, 5, 9, 10] {
            if let Some(column) = table.column_mut(column) {
                column.set_cell_alignment(CellAlignment::Right);
            }
        }
        let sum = |of: &dyn Fn(&Verdict) -> u64| self.verdicts.iter().map(of).sum::<u64>();
        let mut surroundings = String::new();
        for found in self.surroundings {
            let verdict = found.holds.map_or("–", word);
            let _ = writeln!(surroundings, " {:<17} {verdict:<6} {}", found.fault, found.found);
        }
        format!(
            "Exam of {} with the standby {}, {}: the faults and their handling\n\n{table}\n\n{surroundings}\napplied values beyond a limit or not \
             finite: {}\nticks at which the plant woke up late: {}; ticks missing in recordings: {}\nfaults during a stall of the machine, counted \
             separately (+): {}\nruns left by killed processes and removed by the next run: {}\n\nreport   {}\nall      {}, faults.xml (JUnit)\n",
            self.examined,
            self.standby,
            pace_name(self.scenario.pace),
            sum(&|verdict| verdict.bad_applied),
            sum(&|verdict| verdict.plant_late),
            sum(&|verdict| verdict.unrecorded),
            sum(&|verdict| verdict.stalled as u64),
            sum(&|verdict| verdict.swept as u64),
            out.join("faults.html").display(),
            out.join("faults.json").display(),
        )
    }

    /// The results as tests: a case for each kind.
    fn junit(&self) -> String {
        let failures = self.failures();
        let mut xml = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuite name=\"freeplay faults {}\" tests=\"{}\" failures=\"{failures}\">\n",
            escaped(self.examined),
            self.verdicts.len() + self.surroundings.len(),
        );
        for verdict in self.verdicts {
            let _ = write!(xml, "  <testcase classname=\"faults\" name=\"{}\"", verdict.kind.name());
            if verdict.holds {
                xml += "/>\n";
                continue;
            }
            let words = format!(
                "{} of {} judged faults were not handled as expected ({}); applied values beyond a limit: {}",
                verdict.not_as_expected,
                verdict.judged,
                expected(verdict),
                verdict.bad_applied
            );
            let _ = writeln!(xml, "><failure message=\"{}\"/></testcase>", escaped(&words));
        }
        for found in self.surroundings {
            let _ = write!(xml, "  <testcase classname=\"faults\" name=\"{}\"", found.fault);
            let words = escaped(&found.found);
            let _ = match found.holds {
                Some(true) => writeln!(xml, "/>"),
                Some(false) => writeln!(xml, "><failure message=\"{words}\"/></testcase>"),
                None => writeln!(xml, "><skipped message=\"{words}\"/></testcase>"),
            };
        }
        xml + "</testsuite>\n"
    }

    fn html(&self) -> String {
        let failures = self.failures();
        let words = match failures {
            0 => "every kind of fault was handled as expected".to_owned(),
            _ => {
                format!("{failures} of {} kinds of fault were not handled as expected", self.verdicts.len())
            }
        };
        // Two tables: side by side the columns would be wider than most windows.
        let mut table = Table::new("Faults and their detection")
            .column(Column::text("fault"))
            .column(Column::text("verdict"))
            .column(Column::text("expected"))
            .column(Column::number("faults", ""))
            .column(Column::number("in contact", ""))
            .column(Column::text("detected"))
            .column(Column::text("slowest, ticks"))
            .column(Column::text("detected as").wrapping());
        let mut after = Table::new("What follows")
            .column(Column::text("fault"))
            .column(Column::text("standby at once, soon"))
            .column(Column::text("applied meanwhile").wrapping())
            .column(Column::text("active next"))
            .column(Column::number("held", "ticks"))
            .column(Column::number("deviation", "mm").fixed(4))
            .column(Column::number("of usual", "").fixed(2));
        for verdict in self.verdicts {
            table = table.row([
                Cell::from(verdict.kind.name()),
                Cell::verdict(Mark::passed(verdict.holds)),
                expected(verdict).into(),
                (verdict.count as u64).into(),
                (verdict.in_contact as u64).into(),
                detected(verdict).into(),
                slowest(verdict).into(),
                counted(&verdict.reasons).into(),
            ]);
            after = after.row([
                Cell::from(verdict.kind.name()),
                taken_over(verdict).into(),
                counted(&verdict.applied).into(),
                counted(&verdict.next_in_charge).into(),
                verdict.most_held.into(),
                verdict.deviation_peak_mm.into(),
                verdict.deviation_ratio.into(),
            ]);
        }
        let table = table.note(
            "A fault counts where the controller was active and the machine missed no deadline around it; the number in parentheses counts the faults \
             during such a stall. Ticks run from the first faulty answer to the first tick with another command: 1 is at once.",
        );
        let after = after.note(
            "The standby acts at once if its answer to the faulty tick was applied, and soon if the answer to one of the next two ticks was. \
             The deviation is the greatest of the tool until the next fault, over the greatest of either controller alone in the same ticks.",
        );
        let mut others = Table::new("Faults outside the controller")
            .column(Column::text("fault"))
            .column(Column::text("verdict"))
            .column(Column::text("found"));
        for found in self.surroundings {
            let verdict =
                found.holds.map_or_else(|| Cell::from("–"), |holds| Cell::verdict(Mark::passed(holds)));
            others = others.row([Cell::from(found.fault), verdict, found.found.as_str().into()]);
        }
        let mut section = Section::new("Faults").with(table).with(after);
        if !self.surroundings.is_empty() {
            section = section.with(others);
        }
        Document::new(format!("Exam of {}", self.examined))
            .subtitle(format!("beside {}, {}", self.standby, pace_name(self.scenario.pace)))
            .overview(Block::Verdict(Mark::passed(failures == 0), words))
            .section(section)
            .footer(format!("freeplay {}", env!("CARGO_PKG_VERSION")))
            .to_html()
    }
}

/// `text` as the value of an XML attribute.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

//! A claim of the paper, with the results of the runs.

use serde::Serialize;

/// Verdict on a claim.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "verdict", content = "condition")]
pub enum Ruling {
    /// The claim holds in every situation.
    Holds,
    /// The claim holds in some situations; the condition names them.
    HoldsOnlyIf(String),
    /// The claim holds in no situation.
    DoesNotHold,
}

/// A property of a situation: its subject ("path"), and the property as a condition ("the path has sharp corners").
pub type Tag = (&'static str, &'static str);

/// One situation in which the claim was tested.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The situation in words.
    pub situation: String,
    /// Its properties.
    #[serde(skip)]
    pub tags: Vec<Tag>,
    /// The numbers, as many as the claim has columns.
    pub values: Vec<f64>,
    /// The independent reference's value for each, if it has one.
    pub reference: Vec<Option<f64>>,
    /// True if the claim holds here.
    pub holds: bool,
}

/// Name and unit of a number of a claim.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Quantity {
    /// The quantity.
    pub name: String,
    /// Its unit; may be empty.
    pub unit: &'static str,
}

/// A claim with its verdict and the numbers behind it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Claim {
    /// A short name.
    pub id: &'static str,
    /// The claim of the paper.
    pub claim: &'static str,
    /// The verdict.
    #[serde(flatten)]
    pub ruling: Ruling,
    /// Criterion for agreement of a situation, and the reason for its threshold.
    pub rule: String,
    /// A further result in the numbers, in a sentence.
    pub remark: String,
    /// The numbers' quantities.
    pub quantities: Vec<Quantity>,
    /// The situations.
    pub situations: Vec<Row>,
}

impl Quantity {
    /// A quantity with its unit.
    pub fn new(name: impl Into<String>, unit: &'static str) -> Self {
        Self { name: name.into(), unit }
    }
}

impl Claim {
    /// A claim judged by its situations.
    pub fn judged(
        id: &'static str,
        claim: &'static str,
        rule: impl Into<String>,
        quantities: Vec<Quantity>,
        situations: Vec<Row>,
    ) -> Self {
        let ruling = rule_over(&situations);
        Self { id, claim, ruling, rule: rule.into(), remark: String::new(), quantities, situations }
    }

    /// Adds a remark on further results.
    pub fn remark(mut self, remark: impl Into<String>) -> Self {
        self.remark = remark.into();
        self
    }

    /// The verdict in words, without its condition.
    pub fn verdict(&self) -> &'static str {
        match self.ruling {
            Ruling::Holds => "holds",
            Ruling::HoldsOnlyIf(_) => "holds only if",
            Ruling::DoesNotHold => "does not hold",
        }
    }

    /// Number of situations in which the claim holds, and number of all situations.
    pub fn count(&self) -> (usize, usize) {
        (self.situations.iter().filter(|row| row.holds).count(), self.situations.len())
    }
}

/// The verdict over all situations. A claim that holds in few of them, and under no condition without exceptions, does not hold.
pub fn rule_over(rows: &[Row]) -> Ruling {
    let agreeing = rows.iter().filter(|row| row.holds).count();
    let few = agreeing as f64 <= EXCEPTIONS * rows.len() as f64;
    match (agreeing, condition(rows)) {
        (0, _) => Ruling::DoesNotHold,
        (count, _) if count == rows.len() => Ruling::Holds,
        (_, Some((0, words))) => Ruling::HoldsOnlyIf(words),
        _ if few => Ruling::DoesNotHold,
        (_, Some((1, words))) => Ruling::HoldsOnlyIf(format!("{words} (with one exception)")),
        (_, Some((wrong, words))) => Ruling::HoldsOnlyIf(format!("{words} (with {wrong} exceptions)")),
        (count, None) => Ruling::HoldsOnlyIf({
            let named: Vec<&str> =
                rows.iter().filter(|row| row.holds).map(|row| row.situation.as_str()).collect();
            if count <= 2 {
                format!("the situation is: {}", named.join("; or: "))
            } else {
                format!("one picks the situation: {count} of {} agree", rows.len())
            }
        }),
    }
}

/// Largest share of situations for which a condition may be wrong; it names these as exceptions.
const EXCEPTIONS: f64 = 0.2;

/// The simplest condition that is true exactly where the claim holds: one property, two together, or one of two. If there is none, the one with the fewest
/// exceptions, if those are few. Returns also the number of exceptions.
fn condition(rows: &[Row]) -> Option<(usize, String)> {
    let mut tags: Vec<Tag> = Vec::new();
    for tag in rows.iter().flat_map(|row| &row.tags) {
        if !tags.contains(tag) {
            tags.push(*tag);
        }
    }
    let wrong = |is_met: &dyn Fn(&Row) -> bool| rows.iter().filter(|row| row.holds != is_met(row)).count();
    let pairs = || {
        let all = tags.iter().enumerate().flat_map(|(i, a)| tags[i + 1..].iter().map(move |b| (a, b)));
        all.filter(|(a, b)| a.0 != b.0)
    };
    let one = tags.iter().map(|tag| (wrong(&|row| row.tags.contains(tag)), tag.1.to_owned()));
    let both = pairs().map(|(a, b)| {
        (wrong(&|row| row.tags.contains(a) && row.tags.contains(b)), format!("{} and {}", a.1, b.1))
    });
    let either = pairs().map(|(a, b)| {
        (wrong(&|row| row.tags.contains(a) || row.tags.contains(b)), format!("{}, or {}", a.1, b.1))
    });
    let best = one.chain(both).chain(either).min_by_key(|(wrong, _)| *wrong)?;
    (best.0 as f64 <= EXCEPTIONS * rows.len() as f64).then_some(best)
}

#[cfg(test)]
mod tests {
    use super::{Row, Ruling, Tag, rule_over};

    const SHARP: Tag = ("path", "the path has sharp corners");
    const SMOOTH: Tag = ("path", "the path is smooth");
    const DRIVEN: Tag = ("drive", "the motion is prescribed");
    const TORQUE: Tag = ("drive", "torques drive the joints");

    fn rows(holds: [bool; 4]) -> Vec<Row> {
        let tags = [[SMOOTH, DRIVEN], [SMOOTH, TORQUE], [SHARP, DRIVEN], [SHARP, TORQUE]];
        let row = |(tags, holds): ([Tag; 2], bool)| Row {
            situation: format!("{} {}", tags[0].1, tags[1].1),
            tags: tags.to_vec(),
            values: vec![],
            reference: vec![],
            holds,
        };
        tags.into_iter().zip(holds).map(row).collect()
    }

    #[test]
    fn all_none_and_what_parts_them() {
        let only_if = |text: &str| Ruling::HoldsOnlyIf(text.to_owned());
        assert_eq!(rule_over(&rows([true; 4])), Ruling::Holds);
        assert_eq!(rule_over(&rows([false; 4])), Ruling::DoesNotHold);
        assert_eq!(rule_over(&rows([false, false, true, true])), only_if("the path has sharp corners"));
        assert_eq!(rule_over(&rows([true, false, true, false])), only_if("the motion is prescribed"));
        let both = "torques drive the joints and the path has sharp corners";
        assert_eq!(rule_over(&rows([false, false, false, true])), only_if(both));
        let either = "the path is smooth, or the motion is prescribed";
        assert_eq!(rule_over(&rows([true, true, true, false])), only_if(either));
    }

    #[test]
    fn what_no_property_parts_is_counted() {
        let mut many = rows([true, false, false, true]);
        many.extend(rows([true, false, false, true]));
        let Ruling::HoldsOnlyIf(text) = rule_over(&many) else { panic!("some hold") };
        assert_eq!(text, "one picks the situation: 4 of 8 agree");
        let Ruling::HoldsOnlyIf(text) = rule_over(&rows([true, false, false, true])) else {
            panic!("some hold")
        };
        assert!(text.contains("; or: "), "{text}");
    }

    #[test]
    fn what_holds_here_and_there_does_not_hold() {
        let mut many = rows([true, false, false, false]);
        many.extend(rows([false, false, true, false]));
        for _ in 0..3 {
            many.extend(rows([false; 4]));
        }
        assert_eq!(rule_over(&many), Ruling::DoesNotHold, "2 of 20, with no property that parts them");
        let mut parted = rows([false, false, true, false]);
        parted.extend(rows([false, false, true, false]));
        for (at, row) in parted.iter_mut().enumerate() {
            row.tags.push(if at < 4 {
                ("gravity", "there is gravity")
            } else {
                ("gravity", "there is none")
            });
        }
        let Ruling::HoldsOnlyIf(_) = rule_over(&parted) else { panic!("2 of 8, and a property parts them") };
    }

    #[test]
    fn a_condition_names_its_few_exceptions() {
        let mut many = rows([true, true, false, false]);
        many.extend(rows([true, true, false, true]));
        let only_if = |text: &str| Ruling::HoldsOnlyIf(text.to_owned());
        assert_eq!(rule_over(&many), only_if("the path is smooth (with one exception)"));
    }
}

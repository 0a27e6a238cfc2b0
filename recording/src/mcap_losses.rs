//! Losses by damage in an MCAP file: number and time of the lost samples.
//!
//! A recorder numbers its messages (`sequence`, from 0), so that a gap gives the number of missing ones; the statistics of the summary give the number missing
//! at the end. The times are those of the samples on either side.

/// Largest number of damaged stretches with a line of their own.
const DESCRIBED: usize = 8;

/// An unreadable stretch, and the samples around it.
#[derive(Debug)]
struct Loss {
    offset: u64,
    what: String,
    after: Option<f64>,
    before: Option<f64>,
    /// Number of missing samples; `None` if messages have no numbers.
    samples: Option<u64>,
}

/// Collects the losses of a recording, message by message.
#[derive(Debug, Default)]
pub(crate) struct Losses {
    closed: Vec<Loss>,
    /// Stretches since the last sample.
    open: Vec<(u64, String)>,
    /// Number and time of the last sample.
    last: Option<(u32, f64)>,
    rows: u64,
    /// Two consecutive samples without damage between them have non-consecutive numbers.
    is_unnumbered: bool,
}

impl Losses {
    /// Records an unreadable stretch at `offset`.
    pub fn damage(&mut self, offset: u64, what: String) {
        self.open.push((offset, what));
    }

    /// The first unreadable stretch: its offset, and the fault.
    pub fn first(&self) -> Option<(u64, &str)> {
        let closed = self.closed.first().map(|loss| (loss.offset, loss.what.as_str()));
        closed.or_else(|| self.open.first().map(|(offset, what)| (*offset, what.as_str())))
    }

    /// Records a sample: its number and its time, s.
    pub fn sample(&mut self, number: u32, t: f64) {
        let expected = self.last.map_or(0, |(number, _)| number.wrapping_add(1));
        let missing = u64::from(number.wrapping_sub(expected));
        if self.open.is_empty() {
            self.is_unnumbered |= missing != 0;
        } else {
            self.close(Some(t), Some(missing));
        }
        self.last = Some((number, t));
        self.rows += 1;
    }

    /// Ends the open stretches at the sample of time `before`, with `samples` missing among all of them.
    fn close(&mut self, before: Option<f64>, samples: Option<u64>) {
        let after = self.last.map(|(_, t)| t);
        let more = self.open.len();
        let Some((offset, what)) = self.open.drain(..).next() else { return };
        let what = if more > 1 { format!("{what}, and {} more places", more - 1) } else { what };
        self.closed.push(Loss { offset, what, after, before, samples });
    }

    /// One line for each loss. `written` is the number of samples that the file claims.
    pub fn describe(mut self, written: Option<u64>) -> Vec<String> {
        let missing: u64 = self.closed.iter().filter_map(|loss| loss.samples).sum();
        self.close(None, written.map(|written| written.saturating_sub(self.rows + missing)));
        let is_numbered = !self.is_unnumbered && self.rows > 1;
        let mut lines: Vec<String> =
            self.closed.iter().take(DESCRIBED).map(|loss| loss.describe(is_numbered)).collect();
        let more = self.closed.len().saturating_sub(DESCRIBED);
        if more > 0 {
            lines.push(format!("{more} more stretches of the file are damaged"));
        }
        lines
    }
}

impl Loss {
    fn describe(&self, is_numbered: bool) -> String {
        let when = match (self.after, self.before) {
            (Some(after), Some(before)) => format!("between {after:.4} s and {before:.4} s"),
            (Some(after), None) => format!("after {after:.4} s"),
            (None, Some(before)) => format!("before {before:.4} s"),
            (None, None) => "of the recording".to_owned(),
        };
        let cost = match self.samples.filter(|_| is_numbered || self.before.is_none()) {
            Some(0) => "no sample is lost".to_owned(),
            Some(1) => format!("1 sample {when} is lost"),
            Some(samples) => format!("{samples} samples {when} are lost"),
            None => format!("samples {when} may be lost"),
        };
        format!("the file is damaged at byte {} ({}): {cost}; all others are read", self.offset, self.what)
    }
}

#[cfg(test)]
mod tests {
    use super::Losses;

    #[test]
    fn gaps_in_numbers_are_counted_and_dated() {
        let mut losses = Losses::default();
        (0..5).for_each(|k| losses.sample(k, f64::from(k)));
        losses.damage(99, "x".into());
        losses.sample(8, 8.0);
        losses.damage(200, "y".into());
        losses.damage(210, "z".into());
        let lines = losses.describe(Some(20));
        assert_eq!(
            lines,
            [
                "the file is damaged at byte 99 (x): 3 samples between 4.0000 s and 8.0000 s are lost; all others are read",
                "the file is damaged at byte 200 (y, and 1 more places): 11 samples after 8.0000 s are lost; all others are read",
            ]
        );
    }

    #[test]
    fn without_numbers_a_loss_is_possible() {
        let mut losses = Losses::default();
        (0..5).for_each(|k| losses.sample(0, f64::from(k)));
        losses.damage(99, "x".into());
        losses.sample(0, 8.0);
        assert!(losses.describe(None)[0].contains("samples between 4.0000 s and 8.0000 s may be lost"));
    }
}

//! The curves of a recording that is processed in parts, in bounded memory.

use std::ops::Range;

use crate::signals::channel::Channel;
use crate::signals::residual::Residuals;

/// Approximate number of points that the curves of a long recording keep: a chart has about a thousand pixels, and so stays sharp when it is enlarged a
/// hundredfold.
const MOST_POINTS: usize = 200_000;

/// The curves so far.
pub(crate) struct Curves {
    whole: Residuals,
    /// Length of a run of points. Of each run the curves keep the points where a channel is farthest from its model; a run of 1 keeps all points.
    run: usize,
    /// Two points farther apart have a gap between them, s.
    gap_s: f64,
    /// Time of the latest point, s.
    last: f64,
}

impl Curves {
    /// Curves of `points` points with a distance of `step_s`; thinned if they belong to a recording that `is_long`.
    pub fn new(points: usize, step_s: f64, is_long: bool) -> Self {
        let run = if is_long { points.div_ceil(MOST_POINTS) } else { 1 };
        let whole = Residuals { t: Vec::new(), stretches: Vec::new(), channels: Vec::new() };
        Self { whole, run, gap_s: 1.5 * step_s, last: f64::NEG_INFINITY }
    }

    /// Appends one part.
    pub fn add(&mut self, part: Residuals) {
        if self.run == 1 && self.whole.t.is_empty() {
            self.last = part.t.last().copied().unwrap_or(self.last);
            self.whole = part;
            return;
        }
        if self.whole.channels.is_empty() {
            self.whole.channels = part.channels.iter().map(without_points).collect();
        }
        for stretch in &part.stretches {
            self.append(&part, stretch);
        }
    }

    /// The complete curves.
    pub fn finish(self) -> Residuals {
        self.whole
    }

    fn append(&mut self, part: &Residuals, stretch: &Range<usize>) {
        let goes_on = part.t[stretch.start] - self.last < self.gap_s;
        self.last = part.t[stretch.end - 1];
        let begin = self.whole.t.len();
        // Each channel has a lowest and a highest point in a run.
        let run = self.run * if self.run > 1 { 2 * part.channels.len() } else { 1 };
        for start in stretch.clone().step_by(run) {
            let range = start..stretch.end.min(start + run);
            let kept = if self.run > 1 { extremes(&part.channels, range) } else { range.collect() };
            self.whole.t.extend(kept.iter().map(|&k| part.t[k]));
            for (whole, part) in self.whole.channels.iter_mut().zip(&part.channels) {
                take(whole, part, &kept);
            }
        }
        let end = self.whole.t.len();
        match self.whole.stretches.last_mut().filter(|_| goes_on) {
            Some(last) => last.end = end,
            None => self.whole.stretches.push(begin..end),
        }
    }
}

/// The points of `range` where a channel minus its model is lowest or highest, in order.
fn extremes(channels: &[Channel], range: Range<usize>) -> Vec<usize> {
    let mut kept = Vec::with_capacity(2 * channels.len());
    for channel in channels {
        let off = |k: &usize| channel.measured[*k] - channel.model[*k];
        kept.extend(range.clone().min_by(|a, b| off(a).total_cmp(&off(b))));
        kept.extend(range.clone().max_by(|a, b| off(a).total_cmp(&off(b))));
    }
    kept.sort_unstable();
    kept.dedup();
    kept
}

fn take(whole: &mut Channel, part: &Channel, kept: &[usize]) {
    whole.measured.extend(kept.iter().map(|&k| part.measured[k]));
    whole.model.extend(kept.iter().map(|&k| part.model[k]));
    let present = |k: usize| part.present.as_ref().is_none_or(|present| present[k]);
    if whole.present.is_some() || !kept.iter().all(|&k| present(k)) {
        let all = whole.present.get_or_insert_default();
        all.resize(whole.measured.len() - kept.len(), true);
        all.extend(kept.iter().map(|&k| present(k)));
    }
    if let (Some(whole), Some(part)) = (&mut whole.friction, &part.friction) {
        whole.extend(kept.iter().map(|&k| part[k]));
    }
}

fn without_points(channel: &Channel) -> Channel {
    Channel {
        name: channel.name.clone(),
        kind: channel.kind,
        unit: channel.unit,
        measured: Vec::new(),
        model: Vec::new(),
        present: None,
        friction: channel.friction.as_ref().map(|_| Vec::new()),
    }
}

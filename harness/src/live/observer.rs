//! Collects ticks into snapshots, on the recorder's thread of the plant's process.

use std::collections::BTreeMap;
use std::sync::mpsc::SyncSender;
use std::time::{Duration, Instant};

use freeplay_plant::{DeviationStatistics, Rejection, TickRecord};
use hdrhistogram::{CreationError, Histogram};

use super::{ContactMode, LiveSnapshot, PlaySnapshot, StageSnapshot};

/// Time between two snapshots: one for each picture.
const EVERY: Duration = super::PICTURE;
/// Ticks for each point of the trace.
const TRACE_TICKS: u64 = 10;
/// Ticks between points of an orbit.
const ORBIT_TICKS: u64 = 4;

/// Duration of a stage of this tick, ns; `None` without an answer.
type StageTime = fn(&TickRecord) -> Option<u64>;

/// Stages whose durations a record of a tick contains.
const STAGES: [(&str, StageTime); 5] = [
    ("state out", |record| Some(record.state.published_ns.saturating_sub(record.state.scheduled_ns))),
    ("state transport", |record| Some(record.command?.received_ns.saturating_sub(record.state.published_ns))),
    ("compute", |record| Some(record.command?.sent_ns.saturating_sub(record.command?.received_ns))),
    ("predict", |record| Some(record.command?.predict_ns).filter(|&took| took > 0)),
    ("QP", |record| Some(record.command?.qp_ns).filter(|&took| took > 0)),
];

/// Collects every tick and sends a snapshot from time to time.
pub struct Observer {
    to: SyncSender<LiveSnapshot>,
    /// Length of a tick, s.
    period: f64,
    /// True if there is a schedule, which only real time has.
    is_scheduled: bool,
    snapshot: LiveSnapshot,
    /// Greatest deviation since the last point of the trace, m.
    greatest: f64,
    stages: Vec<Histogram<u64>>,
    rejected: [u64; Rejection::ALL.len()],
    deviation: DeviationStatistics,
    told: Instant,
}

impl Observer {
    /// Creates an observer of a run with `plays` joints with play and ticks of `period` s, in real time or not; it sends
    /// snapshots to `to`.
    ///
    /// # Errors
    /// No error is possible for the bounds used here.
    pub fn new(
        to: SyncSender<LiveSnapshot>,
        plays: usize,
        period: f64,
        is_realtime: bool,
    ) -> Result<Self, CreationError> {
        let play = PlaySnapshot {
            mode: ContactMode::Free,
            ticks: [0; 3],
            peak_normal_force: 0.0,
            orbit: Vec::new(),
        };
        Ok(Self {
            to,
            period,
            is_scheduled: is_realtime,
            snapshot: LiveSnapshot {
                tick: 0,
                deviation: [0.0; 3],
                rms_max: [f64::NAN; 2],
                trace: Vec::new(),
                plays: vec![play; plays],
                in_charge: 0,
                applied: freeplay_plant::Applied::Guided,
                rejected: BTreeMap::new(),
                stages: Vec::new(),
                marks: 0,
            },
            greatest: 0.0,
            stages: vec![Histogram::new_with_bounds(1, 10_000_000_000, 3)?; STAGES.len()],
            rejected: [0; Rejection::ALL.len()],
            deviation: DeviationStatistics::new(DeviationStatistics::START_DURATION),
            told: Instant::now(),
        })
    }

    /// Adds a tick.
    pub fn see(&mut self, record: &TickRecord) {
        let tick = record.state.tick;
        let snapshot = &mut self.snapshot;
        (snapshot.tick, snapshot.deviation, snapshot.marks) = (tick, record.deviation, record.marks);
        (snapshot.applied, snapshot.in_charge) = (record.applied, record.state.active_slot() as usize);
        let time = tick as f64 * self.period;
        self.deviation.add(time, &record.deviation.into());
        self.greatest = self.greatest.max(snapshot.size());
        if (tick + 1).is_multiple_of(TRACE_TICKS) {
            snapshot.trace.push([time, std::mem::take(&mut self.greatest)]);
        }
        for (play, seen) in snapshot.plays.iter_mut().zip(&record.plays) {
            play.mode = ContactMode::of(seen.episode);
            play.ticks[play.mode as usize] += 1;
            play.peak_normal_force = play.peak_normal_force.max(seen.peak_normal_force);
            if tick.is_multiple_of(ORBIT_TICKS) {
                play.orbit.push(seen.offset);
            }
        }
        if let Some(reason) = record.rejection {
            self.rejected[reason as usize] += 1;
        }
        if tick == 0 {
            // Controllers may still be planning at this time.
            return;
        }
        let first = usize::from(!self.is_scheduled);
        for ((_, took), histogram) in STAGES.iter().zip(&mut self.stages).skip(first) {
            if let Some(took) = took(record) {
                histogram.saturating_record(took);
            }
        }
    }

    /// Sends a snapshot if one is due, or if this is the `last` call. A parent that does not listen misses it.
    pub fn send_if_due(&mut self, last: bool) {
        if !last && self.told.elapsed() < EVERY {
            return;
        }
        self.told = Instant::now();
        let [norm, ..] = self.deviation.components();
        self.snapshot.rms_max =
            [norm.rms_after_start, norm.max_after_start].map(|millimetres| millimetres * 1e-3);
        self.snapshot.rejected = Rejection::ALL
            .iter()
            .map(|&reason| (reason.name().to_owned(), self.rejected[reason as usize]))
            .filter(|&(_, count)| count > 0)
            .collect();
        self.snapshot.stages = STAGES
            .iter()
            .zip(&self.stages)
            .filter(|(_, histogram)| !histogram.is_empty())
            .map(|((name, _), histogram)| StageSnapshot {
                stage: (*name).to_owned(),
                percentiles: [0.5, 0.99, 0.999, 1.0]
                    .map(|quantile| histogram.value_at_quantile(quantile) as f64 * 1e-3),
            })
            .collect();
        if self.to.try_send(self.snapshot.clone()).is_ok() {
            self.snapshot.trace.clear();
            for play in &mut self.snapshot.plays {
                play.orbit.clear();
                play.peak_normal_force = 0.0;
            }
        }
    }
}

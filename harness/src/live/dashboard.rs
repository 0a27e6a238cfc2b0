//! State of the live view: the data of a run so far.

use std::collections::VecDeque;

use freeplay_plant::Applied;

use super::LiveSnapshot;

/// Number of stored points of the trace.
const TRACE: usize = 4000;
/// Number of stored points of an orbit.
const ORBIT: usize = 250;
/// Name of the rejection of a missing answer.
const MISSING: &str = "missing";
/// The view reports a pause without a tick longer than this, s.
const LONG: f64 = 1.0;
/// Number of stored events.
const EVENTS: usize = 64;

/// Description of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Title {
    /// Text with arm, path and pace.
    pub words: String,
    /// Length of the run, s.
    pub seconds: f64,
    /// Length of a tick, s.
    pub period: f64,
    /// Names of the controllers by slot.
    pub controllers: Vec<String>,
    /// The joints with play: name, and radial clearance in m.
    pub plays: Vec<(String, f64)>,
    /// Time for which the plant waits for a controller, s.
    pub patience: f64,
}

/// State of a controller's process.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ControllerState {
    /// The process runs, or waits for its turn.
    #[default]
    Runs,
    /// The process is stopped: it neither answers nor ends.
    Hangs,
    /// The process has ended.
    Ended,
}

/// The data so far.
#[derive(Clone, Debug)]
pub struct Dashboard {
    /// The run.
    pub title: Title,
    /// The last snapshot; `None` before the first.
    pub now: Option<LiveSnapshot>,
    /// Time, s, and size of the deviation, m.
    pub trace: VecDeque<(f64, f64)>,
    /// Last offsets of each journal, m.
    pub orbits: Vec<VecDeque<[f64; 2]>>,
    /// Time, s, and text of each event.
    pub events: VecDeque<(f64, String)>,
    /// States of the controllers' processes, by slot.
    pub fates: Vec<ControllerState>,
    /// Time since the last new snapshot, s.
    pub still: f64,
    /// True if the gate's substitute for missing answers is in force.
    is_unanswered: bool,
}

impl Dashboard {
    /// Creates an empty dashboard.
    pub fn new(title: Title) -> Self {
        let orbits = vec![VecDeque::with_capacity(ORBIT); title.plays.len()];
        let fates = vec![ControllerState::Runs; title.controllers.len()];
        Self {
            title,
            now: None,
            trace: VecDeque::new(),
            orbits,
            events: VecDeque::new(),
            fates,
            still: 0.0,
            is_unanswered: false,
        }
    }

    /// State of the controller in `slot`. An active controller that lives and does not answer hangs.
    pub fn controller_state(&self, slot: usize) -> ControllerState {
        let is_in_charge = self.now.as_ref().is_some_and(|now| now.in_charge == slot);
        match self.fates.get(slot).copied().unwrap_or_default() {
            ControllerState::Runs if is_in_charge && self.is_unanswered => ControllerState::Hangs,
            fate => fate,
        }
    }

    /// Text with the object that the run waits for, if there was no new snapshot for [`LONG`].
    pub fn waits(&self) -> Option<String> {
        let (still, patience) = (self.still, self.title.patience);
        let Some(now) = &self.now else {
            let who = self.title.controllers.join(", ");
            return Some(format!(
                "waiting for the plant and for {who} to start, for {still:.0} s so far; the plant, once it is ready, waits {patience} s for controllers"
            ));
        };
        let name = self.controller(now.in_charge);
        (still >= LONG).then(|| match self.controller_state(now.in_charge) {
            ControllerState::Hangs => format!(
                "no tick for {still:.0} s: {name} hangs, and the plant waits at most {patience} s for it"
            ),
            ControllerState::Ended => format!("no tick for {still:.0} s: {name} has ended"),
            _ => format!("no tick for {still:.0} s: waiting for an answer of {name}, at most {patience} s"),
        })
    }

    /// Time of the last snapshot, s.
    pub fn time(&self) -> f64 {
        self.now.as_ref().map_or(0.0, |snapshot| snapshot.tick as f64 * self.title.period)
    }

    /// Adds an event at the current time.
    pub fn note(&mut self, event: impl Into<String>) {
        let time = self.time();
        push(&mut self.events, (time, event.into()), EVENTS);
    }

    /// Name of the controller in `slot`.
    pub fn controller(&self, slot: usize) -> &str {
        self.title.controllers.get(slot).map_or("nobody", String::as_str)
    }

    /// Adds a snapshot.
    pub fn add_snapshot(&mut self, snapshot: LiveSnapshot) {
        for &[time, size] in &snapshot.trace {
            push(&mut self.trace, (time, size), TRACE);
        }
        for (orbit, play) in self.orbits.iter_mut().zip(&snapshot.plays) {
            for &offset in &play.orbit {
                push(orbit, offset, ORBIT);
            }
        }
        let before = self.now.replace(snapshot);
        self.note_changes(before.as_ref());
    }

    /// Adds an event for each difference from the snapshot `before`.
    fn note_changes(&mut self, before: Option<&LiveSnapshot>) {
        let (Some(before), Some(now)) = (before, &self.now) else { return };
        let mut events = Vec::new();
        if now.in_charge != before.in_charge {
            let [to, from] = [now.in_charge, before.in_charge].map(|slot| self.controller(slot));
            events.push(format!("{to} took over from {from}"));
        }
        if now.applied != before.applied {
            match now.applied {
                Applied::Guided => {}
                Applied::Command => events.push("the controller's commands are applied".to_owned()),
                Applied::Hold => events.push("the plant holds the last command".to_owned()),
                Applied::Brake => events.push("the brakes are closed".to_owned()),
            }
        }
        let missing = |snapshot: &LiveSnapshot| snapshot.rejected.get(MISSING).copied().unwrap_or(0);
        if now.applied == Applied::Command {
            self.is_unanswered = false;
        } else if missing(now) > missing(before) && !self.is_unanswered {
            self.is_unanswered = true;
            events.push(format!("{} does not answer", self.controller(now.in_charge)));
        }
        for (reason, &count) in &now.rejected {
            let more = count - before.rejected.get(reason).copied().unwrap_or(0);
            if more > 0 {
                events.push(format!("{more} × {}", reason.replace('_', " ")));
            }
        }
        if now.marks != before.marks {
            events.push(format!("mark {}", now.marks));
        }
        events.into_iter().for_each(|event| self.note(event));
    }

    /// The last snapshot as one line, for output without a terminal.
    pub fn status_line(&self) -> String {
        let Some(now) = &self.now else { return "no tick yet".to_owned() };
        let size = now.size() * 1e3;
        let plays: Vec<String> = self
            .title
            .plays
            .iter()
            .zip(&now.plays)
            .map(|((joint, _), play)| format!("{joint} in {}", play.mode.name()))
            .collect();
        let compute = now.stages.iter().find(|stage| stage.stage == "compute");
        let compute = compute.map_or_else(String::new, |stage| {
            format!(", compute p50 {:.0} p99 {:.0} µs", stage.percentiles[0], stage.percentiles[1])
        });
        let rejected: u64 = now.rejected.values().sum();
        format!(
            "{:7.3} s  deviation {size:.4} mm (rms {}, max {})  {}  {} active{compute}, {rejected} rejected by the gate",
            self.time(),
            millimetres(now.rms_max[0]),
            millimetres(now.rms_max[1]),
            plays.join(", "),
            self.controller(now.in_charge),
        )
    }
}

fn push<T>(queue: &mut VecDeque<T>, value: T, most: usize) {
    if queue.len() == most {
        queue.pop_front();
    }
    queue.push_back(value);
}

/// `metres` in mm; a dash for NaN.
pub(super) fn millimetres(metres: f64) -> String {
    if metres.is_nan() { "–".to_owned() } else { format!("{:.4}", metres * 1e3) }
}

#[cfg(test)]
pub mod tests {
    use std::collections::BTreeMap;

    use freeplay_plant::{Applied, Rejection};

    use super::{Dashboard, Title};
    use crate::live::{ContactMode, LiveSnapshot, PlaySnapshot, StageSnapshot};

    /// A run of two controllers, one joint with play.
    pub fn board() -> Dashboard {
        Dashboard::new(Title {
            words: "some arm · joint_5 c = 0.60 mm".to_owned(),
            seconds: 12.0,
            period: 1e-3,
            controllers: vec!["first".to_owned(), "second".to_owned()],
            plays: vec![("joint_5".to_owned(), 0.6e-3)],
            patience: 5.0,
        })
    }

    /// A snapshot at tick `tick` of that run.
    pub fn snapshot(tick: u64) -> LiveSnapshot {
        let play = PlaySnapshot {
            mode: ContactMode::Impact,
            ticks: [20, 10, 70],
            peak_normal_force: 12.0,
            orbit: vec![[0.0, -0.6e-3], [0.1e-3, -0.5e-3]],
        };
        LiveSnapshot {
            tick,
            deviation: [0.0, 0.3e-3, 0.4e-3],
            rms_max: [0.4e-3, 0.6e-3],
            trace: (0..20).map(|point| [(tick + 10 * point) as f64 * 1e-3, 5e-4]).collect(),
            plays: vec![play],
            in_charge: 0,
            applied: Applied::Command,
            rejected: BTreeMap::new(),
            stages: vec![StageSnapshot { stage: "compute".to_owned(), percentiles: [9.0, 31.5, 40.0, 77.0] }],
            marks: 0,
        }
    }

    #[test]
    fn what_changes_from_look_to_look_is_an_event_of_its_time() {
        let mut board = board();
        board.add_snapshot(snapshot(100));
        assert!(board.events.is_empty(), "the first look is no change: {:?}", board.events);
        let changed = LiveSnapshot {
            in_charge: 1,
            applied: Applied::Hold,
            rejected: [("not_finite".to_owned(), 3)].into(),
            marks: 1,
            ..snapshot(1500)
        };
        board.add_snapshot(changed);
        let events: Vec<&str> = board.events.iter().map(|(_, event)| event.as_str()).collect();
        assert_eq!(
            events,
            ["second took over from first", "the plant holds the last command", "3 × not finite", "mark 1"]
        );
        assert!(board.events.iter().all(|(time, _)| (time - 1.5).abs() < 1e-12));
    }

    #[test]
    fn what_a_run_waits_for_has_a_name() {
        let mut board = board();
        assert!(board.waits().is_some_and(|words| words.contains("first, second to start")));
        board.add_snapshot(snapshot(100));
        assert_eq!(board.waits(), None);
        board.still = 3.0;
        assert!(board.waits().is_some_and(|words| words.contains("waiting for an answer of first")));
        board.fates[0] = super::ControllerState::Hangs;
        assert!(board.waits().is_some_and(|words| words.contains("first hangs")));
        board.fates[0] = super::ControllerState::Runs;
        assert_eq!(board.controller_state(0), super::ControllerState::Runs);
        let missing = [(Rejection::Missing.name().to_owned(), 20)].into();
        board.add_snapshot(LiveSnapshot { applied: Applied::Hold, rejected: missing, ..snapshot(200) });
        assert_eq!(board.controller_state(0), super::ControllerState::Hangs, "it lives and does not answer");
        board.add_snapshot(snapshot(300));
        assert_eq!(board.controller_state(0), super::ControllerState::Runs);
    }

    #[test]
    fn a_line_says_deviation_contact_charge_and_latency() {
        let mut board = board();
        board.add_snapshot(snapshot(2000));
        let line = board.status_line();
        for part in ["2.000 s", "0.5000 mm", "max 0.6000", "joint_5 in impact", "first active", "p99 32"] {
            assert!(line.contains(part), "{part:?} is not in {line:?}");
        }
    }

    #[test]
    fn a_long_run_keeps_its_last_part_only() {
        let mut board = board();
        for look in 0..1000 {
            board.add_snapshot(snapshot(look * 200));
        }
        assert_eq!(board.trace.len(), super::TRACE);
        assert_eq!(board.orbits[0].len(), super::ORBIT);
        let last = board.trace.back().map(|point| point.0);
        assert_eq!(last, Some(199.99), "the newest point is kept");
    }
}

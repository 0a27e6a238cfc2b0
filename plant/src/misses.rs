//! The record of missed deadlines. It gathers evidence when a deadline passes, and determines the cause when the answer arrives late or
//! when it is certain that no answer will arrive.

use serde::{Deserialize, Serialize};

use crate::cause::{Cause, Evidence, LEAST_EXCESS, ThreadDelays, TickLatencies, cause};
use crate::thread_watch::{StealWatch, ThreadWatch};
use crate::{Stage, Stages};

/// Misses that the list keeps; of more, the record counts the causes only.
pub const MOST_LISTED: usize = 1024;
/// Stalls of the machine that the list keeps.
const MOST_STALLS: usize = 16_384;
/// Misses in a row whose answers may still arrive.
const MOST_OPEN: usize = 64;
/// Ticks between two readings of the stolen time, which take longer than the other readings.
const STEAL_TICKS: u64 = 16;

/// A missed deadline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Miss {
    /// The tick whose answer was late, or at which the plant itself was more than a period late.
    pub tick: u64,
    /// The cause.
    pub cause: Cause,
    /// The evidence for it.
    pub evidence: Evidence,
}

/// A series of missed deadlines caused by the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Stall {
    /// Its first tick.
    pub first: u64,
    /// Its last tick.
    pub last: u64,
    /// Slot of the controller whose answers were missing; `None`: the plant itself was late.
    pub slot: Option<usize>,
}

/// The end of a tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ended {
    pub tick: u64,
    /// Slot of the active controller, which had to answer.
    pub in_charge: usize,
    /// True if its deadline passed without an answer.
    pub missed: bool,
    /// Slot of the standby that should have taken over at this tick and has not answered it.
    pub awaited: Option<usize>,
    /// Time since the publication of its state, ns: the known part of a missing answer's latency.
    pub unanswered_ns: u64,
    /// Time by which it ended after the next tick was due, ns; 0 if it ended before.
    pub over_ns: u64,
    /// Its latencies, as far as known.
    pub links: TickLatencies,
}

/// A watched thread.
#[derive(Debug, Default)]
struct Watched {
    /// `None` if the operating system gives no counters of the thread.
    watch: Option<ThreadWatch>,
    /// Its counters at the last reading.
    seen: ThreadDelays,
    /// Its counters when the plant was last in time.
    in_time: ThreadDelays,
}

impl Watched {
    /// A thread whose past does not count.
    fn new(watch: Option<ThreadWatch>) -> Self {
        let seen = watch.as_ref().map(ThreadWatch::read).unwrap_or_default();
        Self { watch, seen, in_time: seen }
    }

    fn read_counters(&mut self) {
        if let Some(watch) = &self.watch {
            self.seen = watch.read();
        }
    }

    /// Its delays since the plant was last in time.
    fn delays(&self) -> ThreadDelays {
        self.seen.since(&self.in_time)
    }
}

/// The answer to a miss.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LateAnswer {
    /// No answer has arrived.
    Missing,
    /// The answer arrived late, with these latencies.
    Late(TickLatencies),
    /// The controller answered a later tick instead; the state of that tick was in transit for `state_ns`.
    Skipped { later: u64, state_ns: u64 },
}

/// A miss whose answer may still arrive.
#[derive(Debug)]
struct Open {
    /// Slot of the controller that had to answer.
    slot: usize,
    /// True if it was active; otherwise a swap waited for it, and no deadline was missed.
    was_in_charge: bool,
    /// Its counters when the plant was last in time before the miss.
    in_time: ThreadDelays,
    answer: LateAnswer,
    miss: Miss,
}

/// The record; see the module. It allocates when it is created and when a process is replaced, and at no other time.
#[derive(Debug)]
pub struct Misses {
    period_ns: u64,
    plant: Watched,
    /// The controllers' processes by slot. The record watches standbys, too, so that their first active tick has evidence.
    controllers: Vec<Watched>,
    /// Slot of the active controller at the last tick.
    in_charge: usize,
    steal: Option<StealWatch>,
    stolen_seen: u64,
    /// Time stolen since the plant was last in time.
    stolen: u64,
    /// Excess latencies since then.
    backlog: TickLatencies,
    /// Lateness of the next tick because this one ended late, ns.
    over_ns: u64,
    open: Vec<Open>,
    listed: Vec<Miss>,
    stalls: Vec<Stall>,
    counts: [u64; Cause::ALL.len()],
    /// Slot, tick and cause of the last miss: a following miss of the same slot without an answer has the same cause.
    last: Option<(usize, u64, Cause)>,
}

impl Misses {
    /// An empty record for ticks of `period_ns`, on the calling thread and the controllers' `processes`, by slot.
    pub fn new(period_ns: u64, processes: &[Option<u32>]) -> Self {
        let of = |process: &Option<u32>| Watched::new(process.and_then(ThreadWatch::of_process));
        let mut book = Self {
            period_ns,
            plant: Watched::new(ThreadWatch::of_this_thread()),
            controllers: processes.iter().map(of).collect(),
            in_charge: 0,
            steal: StealWatch::open(),
            stolen_seen: 0,
            stolen: 0,
            backlog: TickLatencies::default(),
            over_ns: 0,
            open: Vec::with_capacity(MOST_OPEN),
            listed: Vec::with_capacity(MOST_LISTED),
            stalls: Vec::with_capacity(MOST_STALLS),
            counts: [0; Cause::ALL.len()],
            last: None,
        };
        book.read_stolen_time();
        book.forget();
        book
    }

    /// Watches another process, `process`, in `slot` from now on.
    pub(crate) fn replace(&mut self, slot: usize, process: u32) {
        self.controllers[slot] = Watched::new(ThreadWatch::of_process(process));
        while let Some(at) = self.open.iter().position(|open| open.slot == slot) {
            self.close_one(at);
        }
    }

    /// Number of missed deadlines by cause.
    pub fn counts(&self) -> impl Iterator<Item = (Cause, u64)> {
        Cause::ALL.into_iter().zip(self.counts)
    }

    /// The first misses, one by one; sorted by tick once the record is closed.
    pub fn listed(&self) -> &[Miss] {
        &self.listed
    }

    /// The first stalls of the machine, up to some thousands; includes stalls of a standby that a swap waited for.
    pub fn stalls(&self) -> &[Stall] {
        &self.stalls
    }

    /// Records the end of a tick.
    pub(crate) fn end_tick(&mut self, ended: &Ended, stages: &Stages) {
        let Ended { tick, in_charge, missed, awaited, unanswered_ns, over_ns, links } = *ended;
        let unanswered = TickLatencies { compute_ns: unanswered_ns, ..links.of_the_plant() };
        self.in_charge = in_charge;
        if (links.wake_up_ns as f64) < LEAST_EXCESS * self.period_ns as f64 {
            self.forget();
        }
        let is_late = links.wake_up_ns > self.period_ns;
        self.read_counters();
        if missed || awaited.is_some() || is_late || tick.is_multiple_of(STEAL_TICKS) {
            self.read_stolen_time();
        }
        let usual = usual(stages);
        self.add_to_backlog(if missed { &unanswered } else { &links }, &usual);
        self.over_ns = over_ns;
        if is_late {
            self.note_lateness(tick, &usual);
        }
        let lacks = [missed.then_some((in_charge, true)), awaited.map(|slot| (slot, false))];
        for (slot, was_in_charge) in lacks.into_iter().flatten() {
            if self.open.len() == MOST_OPEN {
                self.close_one(0);
            }
            let evidence = self.evidence(slot, unanswered, usual, false);
            let miss = Miss { tick, cause: Cause::Unknown, evidence };
            let in_time = self.controllers.get(slot).map(|watched| watched.in_time).unwrap_or_default();
            self.open.push(Open { slot, was_in_charge, in_time, answer: LateAnswer::Missing, miss });
        }
        // Not at the arrival of each answer: only by now has the controller that answered gone back to sleep, so that its counters are
        // complete.
        while let Some(at) = self.open.iter().position(|open| open.answer != LateAnswer::Missing) {
            self.close_one(at);
        }
    }

    /// Records an answer to `tick` of the controller in `slot` with its `links`, for that tick and for earlier ones that it skipped.
    pub(crate) fn answered(&mut self, slot: usize, tick: u64, links: &TickLatencies) {
        let pending =
            self.open.iter_mut().filter(|open| open.answer == LateAnswer::Missing && open.slot == slot);
        for open in pending.filter(|open| open.miss.tick <= tick) {
            open.answer = match tick - open.miss.tick {
                0 => LateAnswer::Late(*links),
                later => LateAnswer::Skipped { later, state_ns: links.state_ns },
            };
        }
    }

    /// Closes the record: no more answers will arrive.
    pub(crate) fn close(&mut self) {
        while !self.open.is_empty() {
            self.close_one(0);
        }
        self.listed.sort_by_key(|miss| miss.tick);
        self.stalls.sort_unstable();
    }

    /// The evidence for a miss of the controller in `slot`.
    fn evidence(&self, slot: usize, links: TickLatencies, usual: TickLatencies, answered: bool) -> Evidence {
        Evidence {
            period_ns: self.period_ns,
            links,
            usual,
            plant: self.plant.delays(),
            controller: self.controllers.get(slot).map(Watched::delays).unwrap_or_default(),
            stolen_ns: self.stolen,
            answered,
            was_kept: false,
        }
    }

    /// Records that the plant was more than a period late for `tick`. The evidence is the excess of its latencies since it was last in
    /// time.
    fn note_lateness(&mut self, tick: u64, usual: &TickLatencies) {
        let excess = self.backlog;
        let links = TickLatencies {
            wake_up_ns: usual.wake_up_ns + excess.wake_up_ns,
            step_ns: usual.step_ns + excess.step_ns,
            state_ns: usual.state_ns + excess.state_ns,
            compute_ns: usual.compute_ns + excess.compute_ns,
            qp_ns: usual.qp_ns + excess.qp_ns,
            qp_iterations: usual.qp_iterations.saturating_add(excess.qp_iterations),
            command_ns: usual.command_ns + excess.command_ns,
        };
        let evidence = self.evidence(self.in_charge, links, *usual, true);
        let miss = Miss { tick, cause: cause(&evidence), evidence };
        self.enter(None, true, &miss);
    }

    /// Adds the excess of `links`. Of a late wake-up it adds the part that the end of the tick before does not explain.
    fn add_to_backlog(&mut self, links: &TickLatencies, usual: &TickLatencies) {
        let sum = &mut self.backlog;
        sum.wake_up_ns += links.wake_up_ns.saturating_sub(self.over_ns);
        for (sum, is, usual) in [
            (&mut sum.step_ns, links.step_ns, usual.step_ns),
            (&mut sum.state_ns, links.state_ns, usual.state_ns),
            (&mut sum.compute_ns, links.compute_ns, usual.compute_ns),
            (&mut sum.qp_ns, links.qp_ns, usual.qp_ns),
            (&mut sum.command_ns, links.command_ns, usual.command_ns),
        ] {
            *sum += is.saturating_sub(usual);
        }
        sum.qp_iterations = sum.qp_iterations.max(links.qp_iterations.saturating_sub(usual.qp_iterations));
    }

    fn forget(&mut self) {
        for watched in std::iter::once(&mut self.plant).chain(&mut self.controllers) {
            watched.in_time = watched.seen;
        }
        (self.stolen, self.backlog) = Default::default();
    }

    /// Closes the open miss `at` with the answer recorded for it.
    fn close_one(&mut self, at: usize) {
        let Open { slot, was_in_charge, in_time, answer, mut miss } = self.open.remove(at);
        let is_stopped = miss.evidence.controller.is_stopped;
        let evidence = &mut miss.evidence;
        if let (true, Some(watched)) = (answer != LateAnswer::Missing, self.controllers.get(slot)) {
            evidence.controller = watched.seen.since(&in_time);
        }
        let ThreadDelays { ran_ns, turns, .. } = evidence.controller;
        // A thread that goes to sleep by itself gets a core more often than there are states; a busy thread runs.
        let is_kept = |states: u64, lasted_ns: u64| {
            !is_stopped && (1..=states).contains(&turns) && ran_ns < lasted_ns / 2
        };
        match answer {
            LateAnswer::Missing => {}
            LateAnswer::Late(links) => {
                evidence.links = TickLatencies {
                    wake_up_ns: evidence.links.wake_up_ns,
                    step_ns: evidence.links.step_ns,
                    ..links
                };
                evidence.answered = true;
                evidence.was_kept = is_kept(1, links.state_ns + links.compute_ns);
            }
            LateAnswer::Skipped { later, state_ns } => {
                let lay_ns = later * self.period_ns + state_ns;
                evidence.was_kept = is_kept(later, lay_ns);
                if evidence.was_kept {
                    evidence.links = TickLatencies { state_ns: lay_ns, ..evidence.links.of_the_plant() };
                }
            }
        }
        miss.cause = match self.last {
            Some((last, before, same))
                if !miss.evidence.answered && last == slot && before + 1 == miss.tick =>
            {
                same
            }
            _ => cause(&miss.evidence),
        };
        self.last = Some((slot, miss.tick, miss.cause));
        self.enter(Some(slot), was_in_charge, &miss);
    }

    fn enter(&mut self, slot: Option<usize>, was_in_charge: bool, miss: &Miss) {
        if miss.cause.is_machine() {
            self.note_stall(miss.tick, slot);
        }
        if !was_in_charge {
            return;
        }
        self.counts[miss.cause as usize] += 1;
        if self.listed.len() < MOST_LISTED {
            self.listed.push(*miss);
        }
    }

    /// The record may enter a tick with a late answer after later ticks.
    fn note_stall(&mut self, tick: u64, slot: Option<usize>) {
        let has_room = self.stalls.len() < MOST_STALLS;
        match self.stalls.last_mut() {
            Some(stall) if stall.slot == slot && (stall.first..=stall.last + 1).contains(&tick) => {
                stall.last = tick.max(stall.last);
            }
            _ if has_room => self.stalls.push(Stall { first: tick, last: tick, slot }),
            _ => {}
        }
    }

    /// Reads the counters of all threads.
    fn read_counters(&mut self) {
        std::iter::once(&mut self.plant).chain(&mut self.controllers).for_each(Watched::read_counters);
    }

    fn read_stolen_time(&mut self) {
        let Some(steal) = &self.steal else { return };
        let now = steal.read();
        self.stolen += now.saturating_sub(self.stolen_seen);
        self.stolen_seen = now;
    }
}

/// The median latencies so far, ns.
fn usual(stages: &Stages) -> TickLatencies {
    let median = |stage: Stage| stages.histogram(stage).value_at_quantile(0.5);
    TickLatencies {
        wake_up_ns: median(Stage::WakeUp),
        step_ns: median(Stage::PlantStep),
        state_ns: median(Stage::StateTransport),
        compute_ns: median(Stage::Compute),
        qp_ns: median(Stage::Qp),
        qp_iterations: stages.usual_iterations(),
        command_ns: median(Stage::CommandTransport),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]
mod tests {
    use super::{Ended, Misses, Stall, Watched};
    use crate::cause::{Cause, TickLatencies};
    use crate::thread_watch::ThreadWatch;
    use crate::{Stage, Stages};

    const USUAL: TickLatencies = TickLatencies {
        wake_up_ns: 100,
        step_ns: 100_000,
        state_ns: 1_000,
        compute_ns: 50_000,
        qp_ns: 0,
        qp_iterations: 0,
        command_ns: 1_000,
    };

    fn stages() -> Stages {
        let mut stages = Stages::new().unwrap();
        for (stage, ns) in [
            (Stage::WakeUp, USUAL.wake_up_ns),
            (Stage::PlantStep, USUAL.step_ns),
            (Stage::StateTransport, USUAL.state_ns),
            (Stage::Compute, USUAL.compute_ns),
            (Stage::CommandTransport, USUAL.command_ns),
        ] {
            stages.record(stage, ns);
        }
        stages
    }

    /// A record that watches no thread, so that the load of the machine does not affect this test.
    fn book() -> Misses {
        let mut book = Misses::new(1_000_000, &[None]);
        (book.plant, book.steal) = (Watched::default(), None);
        book.forget();
        book
    }

    fn found(book: &Misses) -> Vec<(u64, Cause)> {
        book.listed().iter().map(|miss| (miss.tick, miss.cause)).collect()
    }

    /// The end of a normal tick.
    fn in_time(tick: u64) -> Ended {
        Ended { missed: false, ..unanswered(tick, 0, 0) }
    }

    /// The end of a tick without an answer.
    fn unanswered(tick: u64, in_charge: usize, unanswered_ns: u64) -> Ended {
        Ended { tick, in_charge, missed: true, awaited: None, unanswered_ns, over_ns: 0, links: USUAL }
    }

    #[test]
    fn a_late_answer_tells_why_and_those_that_were_passed_over_share_its_cause() {
        let (mut book, stages) = (book(), stages());
        for tick in 5..8 {
            book.end_tick(&unanswered(tick, 0, 950_000), &stages);
        }
        assert_eq!(found(&book), []);
        // The answer to tick 5 is late: it was in transit for long. The controller skips 6 and 7.
        book.answered(0, 5, &TickLatencies { command_ns: 2_500_000, ..USUAL });
        book.answered(0, 8, &USUAL);
        book.end_tick(&in_time(8), &stages);
        assert_eq!(found(&book), [5, 6, 7].map(|tick| (tick, Cause::Transport)));
        book.end_tick(&unanswered(20, 0, USUAL.compute_ns), &stages);
        book.close();
        assert_eq!(found(&book)[3], (20, Cause::Unknown), "nothing was longer than usual");
        assert_eq!(book.counts().map(|(_, count)| count).sum::<u64>(), 4);
    }

    /// The controller answered the tick before in time, and then none until a later one: it was not running. If it did not run at all, it
    /// was woken late.
    #[test]
    fn one_that_was_not_there_was_woken_late_unless_it_ran_or_was_stopped() {
        let stages = stages();
        let cause_of = |turns, ran_ns, is_stopped| {
            let mut book = book();
            book.controllers[0].seen.is_stopped = is_stopped;
            book.end_tick(&unanswered(5, 0, 950_000), &stages);
            let seen = &mut book.controllers[0].seen;
            (seen.turns, seen.ran_ns) = (seen.turns + turns, seen.ran_ns + ran_ns);
            book.answered(0, 7, &USUAL);
            book.end_tick(&in_time(7), &stages);
            found(&book)[0].1
        };
        assert_eq!(cause_of(1, 60_000, false), Cause::Clock);
        assert_eq!(cause_of(1, 1_900_000, false), Cause::ControllerCompute, "it was busy");
        assert_eq!(cause_of(3, 180_000, false), Cause::ControllerCompute, "it was there, and did not answer");
        assert_eq!(cause_of(1, 60_000, true), Cause::ControllerCompute, "it was stopped");
    }

    /// The controller was awake, took a millisecond and a half, and ran for a tenth of that without sleeping: another thread had its core.
    #[test]
    fn an_answer_during_which_its_core_was_taken_is_the_machines() {
        let stages = stages();
        let cause_of = |turns, ran_ns| {
            let mut book = book();
            book.end_tick(&unanswered(5, 0, 950_000), &stages);
            let seen = &mut book.controllers[0].seen;
            (seen.turns, seen.ran_ns) = (seen.turns + turns, seen.ran_ns + ran_ns);
            book.answered(0, 5, &TickLatencies { compute_ns: 1_500_000, ..USUAL });
            book.end_tick(&in_time(6), &stages);
            found(&book)[0].1
        };
        assert_eq!(cause_of(1, 150_000), Cause::Machine);
        assert_eq!(cause_of(2, 150_000), Cause::ControllerCompute, "it slept");
        assert_eq!(cause_of(1, 1_500_000), Cause::ControllerCompute, "it computed");
    }

    /// The failed controller is no longer active when its answer arrives; the answers of the other are no evidence for its miss.
    #[test]
    fn the_late_answer_of_one_that_was_relieved_tells_why_it_was() {
        let (mut book, stages) = (book(), stages());
        book.end_tick(&unanswered(5, 0, 950_000), &stages);
        book.answered(1, 6, &USUAL);
        book.end_tick(&in_time(6), &stages);
        assert_eq!(found(&book), []);
        book.answered(0, 5, &TickLatencies { command_ns: 2_500_000, ..USUAL });
        book.end_tick(&in_time(7), &stages);
        assert_eq!(found(&book), [(5, Cause::Transport)]);
    }

    /// A standby that a swap waited for has missed no deadline; but its delay is a stall of the machine.
    #[test]
    fn a_stall_that_held_up_a_swap_is_a_stall_and_no_miss() {
        let (mut book, stages) = (book(), stages());
        let of_standby = |tick| Ended { missed: false, awaited: Some(1), ..unanswered(tick, 0, 950_000) };
        book.end_tick(&of_standby(5), &stages);
        book.answered(1, 5, &TickLatencies { compute_ns: 1_500_000, ..USUAL });
        book.end_tick(&of_standby(9), &stages);
        book.controllers.push(Watched::default());
        book.controllers[1].seen.turns = 1;
        book.answered(1, 10, &USUAL);
        book.close();
        let stall = Stall { first: 9, last: 9, slot: Some(1) };
        assert_eq!((book.stalls(), found(&book)), ([stall].as_slice(), vec![]));
        assert_eq!(book.counts().map(|(_, count)| count).sum::<u64>(), 0);
    }

    /// After a swap the record examines the process of the new active controller, not that of the old one.
    #[test]
    fn the_process_in_charge_is_the_one_that_is_looked_at() {
        let stages = stages();
        // Slot 0 has no watched process, slot 1 this very thread: its page faults appear while slot 1 is active.
        let mut book = Misses::new(1_000_000, &[None, None]);
        (book.plant, book.steal) = (Watched::default(), None);
        book.controllers[1] = Watched::new(ThreadWatch::of_this_thread());
        let mut ends = |tick, in_charge| {
            let fresh = std::hint::black_box(vec![1_u8; 300 * 4096]);
            assert_eq!(fresh[4096], 1);
            book.end_tick(&unanswered(tick, in_charge, 2_000_000), &stages);
            book.close();
            book.listed().last().unwrap().evidence.controller
        };
        let [first, second, again] = [ends(3, 0), ends(4, 1), ends(5, 0)];
        println!("slot 0 {first:?}, slot 1 {second:?}, slot 0 again {again:?}");
        assert!(second.minor_faults > 0);
        assert_eq!((first.minor_faults, again.minor_faults), (0, 0));
        // The counters start anew for another process in the slot.
        book.replace(1, std::process::id());
        assert_eq!(book.controllers[1].delays().minor_faults, 0);
    }

    #[test]
    fn a_plant_that_falls_behind_bit_by_bit_is_late_for_what_it_fell_behind_by() {
        let (mut book, stages) = (book(), stages());
        let mut late = 0;
        for tick in 1..8 {
            let over_ns = late + 400_000;
            let links = TickLatencies { wake_up_ns: late, step_ns: 1_300_000, ..USUAL };
            book.end_tick(
                &Ended { tick, in_charge: 0, missed: false, awaited: None, unanswered_ns: 0, over_ns, links },
                &stages,
            );
            late = over_ns;
        }
        let first = found(&book)[0];
        assert_eq!(first, (4, Cause::PlantStep), "{:?}", book.listed()[0]);
        // In time again, and then immediately a late wake-up: an independent miss.
        let mut end = |tick, wake_up_ns, over_ns| {
            let links = TickLatencies { wake_up_ns, ..USUAL };
            book.end_tick(
                &Ended { tick, in_charge: 0, missed: false, awaited: None, unanswered_ns: 0, over_ns, links },
                &stages,
            );
        };
        end(30, 0, 0);
        end(31, 5_000_000, 4_200_000);
        end(32, 4_200_000, 3_400_000);
        assert_eq!(found(&book).last(), Some(&(32, Cause::Clock)));
    }
}

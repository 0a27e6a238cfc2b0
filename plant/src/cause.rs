//! The cause of a missed deadline: one rule, from evidence.
//!
//! A tick is a chain of links: the plant wakes, the state travels, the controller computes, the command travels back; meanwhile the plant
//! steps. Each link has a usual latency, the median of the run so far. The rule:
//!
//! 1. **Where.** The link with the greatest excess over its usual latency is responsible. Without an answer this is the state or the
//!    controller: the time until the deadline counts as the controller's, or as the state's if the controller was kept from running and
//!    answered a later tick. If the plant itself is a period late, the excesses of its links since it was last in time add up. An excess of
//!    less than [`LEAST_EXCESS`] of a period does not count; without a greater one, the cause is unknown.
//! 2. **Why.** The first of these that accounts for half of the link's excess: the thread of the link waited for a core (`schedstat`:
//!    scheduler); its page faults ([`MAJOR_NS`], [`MINOR_NS`] each: page fault); the hypervisor took time from this machine (`/proc/stat`), or
//!    step and computing both took more than [`SLOW_FACTOR`] times their usual latency (machine).
//! 3. **Else** the link itself is the cause. A late wake-up is the clock's, and so is a state that waited for a controller that was kept
//!    from running. Travelling is the transport's, stepping is the plant's. Computing is the machine's if the controller was kept from running
//!    meanwhile, the quadratic programme's if that took half of the excess and more iterations than usual, else the controller's.
//!
//! A miss without an answer that follows another such miss has the cause of that one: it is the same stall.

use serde::Serialize;

/// Least excess of a responsible link, as a share of the period.
pub const LEAST_EXCESS: f64 = 0.1;
/// On a slow machine a link takes at least this multiple of its usual latency.
pub const SLOW_FACTOR: u64 = 2;
/// Assumed least cost of a page fault that reads from a disk, ns.
pub const MAJOR_NS: u64 = 100_000;
/// Assumed cost of a page fault that finds its page in memory, ns.
pub const MINOR_NS: u64 = 2_000;

/// Cause of a missed deadline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// A thread of the loop was ready and had no core.
    Scheduler,
    /// A page was not in memory.
    PageFault,
    /// The hypervisor gave the cores to others, or everything was slow at once.
    Machine,
    /// The controller took longer than usual.
    ControllerCompute,
    /// The quadratic programme took more iterations than usual.
    QpIterations,
    /// A message was in transit for long.
    Transport,
    /// The plant's own step took longer than usual.
    PlantStep,
    /// A process of the loop was woken late, without evidence of a reason.
    Clock,
    /// No latency was longer than usual.
    Unknown,
}

impl Cause {
    /// All causes.
    pub const ALL: [Cause; 9] = [
        Self::Scheduler,
        Self::PageFault,
        Self::Machine,
        Self::ControllerCompute,
        Self::QpIterations,
        Self::Transport,
        Self::PlantStep,
        Self::Clock,
        Self::Unknown,
    ];

    /// True if the machine is the cause, not the loop itself: no core, a page not in memory, stolen time, a late wake-up.
    pub fn is_machine(self) -> bool {
        matches!(self, Self::Scheduler | Self::PageFault | Self::Machine | Self::Clock)
    }

    /// The name in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scheduler => "scheduler",
            Self::PageFault => "page_fault",
            Self::Machine => "machine",
            Self::ControllerCompute => "controller_compute",
            Self::QpIterations => "qp_iterations",
            Self::Transport => "transport",
            Self::PlantStep => "plant_step",
            Self::Clock => "clock",
            Self::Unknown => "unknown",
        }
    }
}

/// Delays of a thread in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ThreadDelays {
    /// Time on a core, ns; the system updates it when the thread leaves the core, and every few milliseconds.
    pub ran_ns: u64,
    /// Number of times that it got a core.
    pub turns: u64,
    /// True if a signal has stopped it.
    pub is_stopped: bool,
    /// Time ready, but without a core, ns.
    pub waited_ns: u64,
    /// Page faults that read from a disk.
    pub major_faults: u64,
    /// Page faults without a disk read.
    pub minor_faults: u64,
}

impl ThreadDelays {
    /// The increase since `earlier`; all fields are counts since the thread began.
    pub(crate) fn since(&self, earlier: &ThreadDelays) -> ThreadDelays {
        ThreadDelays {
            ran_ns: self.ran_ns.saturating_sub(earlier.ran_ns),
            turns: self.turns.saturating_sub(earlier.turns),
            is_stopped: self.is_stopped,
            waited_ns: self.waited_ns.saturating_sub(earlier.waited_ns),
            major_faults: self.major_faults.saturating_sub(earlier.major_faults),
            minor_faults: self.minor_faults.saturating_sub(earlier.minor_faults),
        }
    }

    /// Assumed cost of its page faults, ns.
    fn faults_ns(&self) -> u64 {
        self.major_faults.saturating_mul(MAJOR_NS).saturating_add(self.minor_faults.saturating_mul(MINOR_NS))
    }
}

/// Latencies of the links of a tick, ns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct TickLatencies {
    /// Schedule → the plant is awake.
    pub wake_up_ns: u64,
    /// Integrating the tick.
    pub step_ns: u64,
    /// Transit of the state.
    pub state_ns: u64,
    /// Time in the controller.
    pub compute_ns: u64,
    /// The quadratic programme's part of it.
    pub qp_ns: u64,
    /// Iterations of the quadratic programme.
    pub qp_iterations: u32,
    /// Transit of the command.
    pub command_ns: u64,
}

impl TickLatencies {
    /// Only the latencies that are known without an answer.
    pub(crate) fn of_the_plant(&self) -> Self {
        Self { wake_up_ns: self.wake_up_ns, step_ns: self.step_ns, ..Self::default() }
    }
}

/// The evidence for a missed deadline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Evidence {
    /// Length of a tick, ns.
    pub period_ns: u64,
    /// The latencies of this tick; without an answer, the controller's is the time from publication to the deadline.
    pub links: TickLatencies,
    /// The usual latencies.
    pub usual: TickLatencies,
    /// Delays of the plant's thread since the tick before.
    pub plant: ThreadDelays,
    /// Delays of the controller's thread from the tick before to its next answer.
    pub controller: ThreadDelays,
    /// Time that the hypervisor took from this machine, ns; in steps of 10 ms.
    pub stolen_ns: u64,
    /// True if an answer arrived, even late: without one, the controller's time is unknown.
    pub answered: bool,
    /// True if the controller was kept from running: from the tick before to its next answer it got a core at most as often as there were
    /// states, so that it did not sleep in between; it ran for less than half of the time; and no signal had stopped it.
    pub was_kept: bool,
}

/// The links of a tick; each belongs to a thread, and has a cause of its own if no other applies.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Link {
    WakeUp,
    Step,
    State,
    Compute,
    Command,
}

/// The cause of a miss; see the module for the rule.
pub fn cause(evidence: &Evidence) -> Cause {
    let (is, usual) = (&evidence.links, &evidence.usual);
    let excesses = [
        (Link::WakeUp, is.wake_up_ns.saturating_sub(usual.wake_up_ns)),
        (Link::Step, is.step_ns.saturating_sub(usual.step_ns)),
        (Link::State, is.state_ns.saturating_sub(usual.state_ns)),
        (Link::Compute, is.compute_ns.saturating_sub(usual.compute_ns)),
        (Link::Command, is.command_ns.saturating_sub(usual.command_ns)),
    ];
    let Some(&(link, excess)) = excesses.iter().max_by_key(|(_, excess)| *excess) else {
        return Cause::Unknown;
    };
    if (excess as f64) < LEAST_EXCESS * evidence.period_ns as f64 {
        return Cause::Unknown;
    }
    let explains = |ns: u64| ns >= excess.div_ceil(2);
    let thread = match link {
        Link::WakeUp | Link::Step | Link::Command => &evidence.plant,
        Link::State | Link::Compute => &evidence.controller,
    };
    if explains(thread.waited_ns) {
        return Cause::Scheduler;
    }
    if explains(thread.faults_ns()) {
        return Cause::PageFault;
    }
    let slow = |is: u64, usual: u64| usual > 0 && is > usual.saturating_mul(SLOW_FACTOR);
    let all_slow = slow(is.step_ns, usual.step_ns) && slow(is.compute_ns, usual.compute_ns);
    if explains(evidence.stolen_ns) || (all_slow && evidence.answered) {
        return Cause::Machine;
    }
    match link {
        Link::WakeUp => Cause::Clock,
        Link::State if evidence.was_kept => Cause::Clock,
        Link::Compute if evidence.was_kept => Cause::Machine,
        Link::Step => Cause::PlantStep,
        Link::State | Link::Command => Cause::Transport,
        Link::Compute => {
            let by_qp =
                explains(is.qp_ns.saturating_sub(usual.qp_ns)) && is.qp_iterations > usual.qp_iterations;
            if by_qp { Cause::QpIterations } else { Cause::ControllerCompute }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Cause, Evidence, ThreadDelays, TickLatencies, cause};

    /// A cause and evidence for it.
    type Case = (Cause, fn(&mut Evidence));

    /// A normal tick: no link is responsible.
    fn usual() -> Evidence {
        let links = TickLatencies {
            wake_up_ns: 100,
            step_ns: 90_000,
            state_ns: 1_000,
            compute_ns: 60_000,
            qp_ns: 30_000,
            qp_iterations: 8,
            command_ns: 1_000,
        };
        let none = ThreadDelays::default();
        Evidence {
            period_ns: 1_000_000,
            links,
            usual: links,
            plant: none,
            controller: none,
            stolen_ns: 0,
            answered: true,
            was_kept: false,
        }
    }

    #[test]
    fn each_cause_is_told_by_its_evidence() {
        let cases: [Case; 24] = [
            (Cause::Unknown, |_| {}),
            (Cause::Unknown, |e| e.links.wake_up_ns = 90_000),
            (Cause::Clock, |e| e.links.wake_up_ns = 2_000_000),
            (Cause::Scheduler, |e| {
                (e.links.wake_up_ns, e.plant.waited_ns) = (2_000_000, 1_900_000);
            }),
            (Cause::Clock, |e| {
                (e.links.wake_up_ns, e.controller.waited_ns) = (2_000_000, 1_900_000);
            }),
            (Cause::Clock, |e| (e.links.wake_up_ns, e.plant.waited_ns) = (2_000_000, 900_000)),
            (Cause::PageFault, |e| (e.links.wake_up_ns, e.plant.major_faults) = (200_000, 1)),
            (Cause::Machine, |e| (e.links.wake_up_ns, e.stolen_ns) = (12_000_000, 10_000_000)),
            (Cause::Machine, |e| (e.links.step_ns, e.links.compute_ns) = (800_000, 700_000)),
            (Cause::ControllerCompute, |e| {
                (e.links.step_ns, e.links.compute_ns, e.answered) = (300_000, 900_000, false);
            }),
            (Cause::Transport, |e| e.links.state_ns = 3_000_000),
            (Cause::Clock, |e| (e.links.state_ns, e.was_kept) = (3_000_000, true)),
            (Cause::Scheduler, |e| {
                (e.links.state_ns, e.controller.waited_ns) = (3_000_000, 2_000_000);
            }),
            (Cause::PageFault, |e| (e.links.state_ns, e.controller.minor_faults) = (801_000, 250)),
            (Cause::ControllerCompute, |e| e.links.compute_ns = 1_500_000),
            (Cause::ControllerCompute, |e| {
                (e.links.compute_ns, e.links.qp_ns) = (1_500_000, 1_400_000);
            }),
            (Cause::QpIterations, |e| {
                (e.links.compute_ns, e.links.qp_ns, e.links.qp_iterations) = (1_500_000, 1_400_000, 200);
            }),
            (Cause::ControllerCompute, |e| {
                (e.links.compute_ns, e.links.qp_ns, e.links.qp_iterations) = (1_500_000, 130_000, 12);
            }),
            (Cause::Machine, |e| (e.links.compute_ns, e.was_kept) = (1_500_000, true)),
            (Cause::Scheduler, |e| {
                (e.links.compute_ns, e.controller.waited_ns) = (1_500_000, 1_000_000);
            }),
            (Cause::PlantStep, |e| e.links.step_ns = 1_000_000),
            (Cause::Scheduler, |e| (e.links.step_ns, e.plant.waited_ns) = (1_000_000, 800_000)),
            (Cause::Transport, |e| e.links.command_ns = 1_000_000),
            // The link with the greatest excess is responsible, even if another is late, too.
            (Cause::ControllerCompute, |e| {
                (e.links.wake_up_ns, e.links.compute_ns, e.plant.waited_ns) = (300_000, 900_000, 300_000);
            }),
        ];
        for (number, (expected, change)) in cases.into_iter().enumerate() {
            let mut evidence = usual();
            change(&mut evidence);
            assert_eq!(cause(&evidence), expected, "case {number}: {evidence:?}");
        }
    }
}

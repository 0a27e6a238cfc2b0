//! Why a deadline was missed: one rule, from evidence.
//!
//! A tick is a chain: the plant wakes, the state travels, the controller computes, the command travels back; meanwhile the plant steps.
//! Each link has its usual length, the median of the run so far. The rule:
//!
//! 1. **Where.** The link that was longest beyond its usual is the guilty one. Without an answer the state or the controller is: what
//!    passed until the deadline counts as the controller's; as the state's where the controller was kept from running and answered a later
//!    one. Where the plant itself is a period late, its links since it was last in time are added up. A link that was less than [`LEAST`] of
//!    a period beyond its usual is not guilty of anything; where none was more, the cause is unknown.
//! 2. **Why.** The first of these that accounts for half of what the link was too long: the thread it belongs to waited for a core
//!    (`schedstat`: scheduler); its page faults ([`MAJOR_NS`], [`MINOR_NS`] each: page fault); the hypervisor took time from this
//!    machine (`/proc/stat`), or step and computing both took more than [`SLOW`] times their usual (machine).
//! 3. **Else** it is the link's own: waking late is the clock's, and so is a state that waited for a controller that was kept from running;
//!    travelling is the transport's, stepping is the plant's; computing is the machine's if the controller was kept from running meanwhile,
//!    the quadratic programme's if that took half of the excess and more iterations than usual, else the controller's.
//!
//! A miss that follows a miss without an answer of its own has the cause of the one before: it is the same stall.

use serde::Serialize;

/// Least excess of a guilty link, share of the period.
pub const LEAST: f64 = 0.1;
/// How many times its usual a link takes on a machine that is slow.
pub const SLOW: u64 = 2;
/// What a page fault that reads from a disk is taken to cost at least, ns.
pub const MAJOR_NS: u64 = 100_000;
/// What a page fault that finds its page in memory is taken to cost, ns.
pub const MINOR_NS: u64 = 2_000;

/// Why a deadline was missed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// A thread of the loop was ready and had no core.
    Scheduler,
    /// A page was not there.
    PageFault,
    /// The hypervisor gave the cores to others, or all was slow at once.
    Machine,
    /// The controller took longer than usual.
    ControllerCompute,
    /// The quadratic programme took more iterations than usual.
    QpIterations,
    /// A message was long under way.
    Transport,
    /// The plant's own step took longer than usual.
    PlantStep,
    /// A process of the loop was woken late, and nothing says why.
    Clock,
    /// Nothing was longer than usual.
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

    /// Whether it is the machine's, and none of the loop's own: no core, a page that was not there, time taken by the host, a clock that woke late.
    pub fn is_the_machines(self) -> bool {
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

/// What a thread went through in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ThreadDelays {
    /// On a core, ns; brought up to date as it leaves it, and every few milliseconds.
    pub ran_ns: u64,
    /// How often it got a core.
    pub turns: u64,
    /// Whether a signal has stopped it.
    pub is_stopped: bool,
    /// Ready, but without a core, ns.
    pub waited_ns: u64,
    /// Page faults that read from a disk.
    pub major_faults: u64,
    /// Page faults that did not.
    pub minor_faults: u64,
}

impl ThreadDelays {
    /// What came on top of `earlier`; all are counts since the thread began.
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

    /// What its page faults are taken to cost, ns.
    fn faults_ns(&self) -> u64 {
        self.major_faults.saturating_mul(MAJOR_NS).saturating_add(self.minor_faults.saturating_mul(MINOR_NS))
    }
}

/// How long the links of a tick were, ns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct TickLatencies {
    /// Schedule → the plant is awake.
    pub wake_up_ns: u64,
    /// Integrating the tick.
    pub step_ns: u64,
    /// The state's way.
    pub state_ns: u64,
    /// The controller's time.
    pub compute_ns: u64,
    /// Of this, the quadratic programme's.
    pub qp_ns: u64,
    /// Iterations of the quadratic programme.
    pub qp_iterations: u32,
    /// The command's way.
    pub command_ns: u64,
}

impl TickLatencies {
    /// Those that need no answer to be known.
    pub(crate) fn of_the_plant(&self) -> Self {
        Self { wake_up_ns: self.wake_up_ns, step_ns: self.step_ns, ..Self::default() }
    }
}

/// All that is known of a missed deadline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Evidence {
    /// Length of a tick, ns.
    pub period_ns: u64,
    /// The links of this tick; of one without an answer, the controller's is the time from publication to the deadline.
    pub links: TickLatencies,
    /// The usual links.
    pub usual: TickLatencies,
    /// Of the plant's thread, since the tick before.
    pub plant: ThreadDelays,
    /// Of the controller's thread, from the tick before to its next answer.
    pub controller: ThreadDelays,
    /// Taken from this machine by the hypervisor, ns; in steps of 10 ms.
    pub stolen_ns: u64,
    /// Whether an answer came, late as it may be: without one, the time of the controller is not known.
    pub answered: bool,
    /// Whether the controller was kept from running: from the tick before to its next answer it got a core no more often than there were
    /// states, so did not go to sleep over one, ran for less than half of the time, and no signal had stopped it.
    pub was_kept: bool,
}

/// Who a link belongs to, and what it is when nothing else is to blame.
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
    if (excess as f64) < LEAST * evidence.period_ns as f64 {
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
    let slow = |is: u64, usual: u64| usual > 0 && is > usual.saturating_mul(SLOW);
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

    /// A cause and what provokes it.
    type Case = (Cause, fn(&mut Evidence));

    /// A tick as usual: nothing is to blame.
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
            // The longest excess is the guilty one, be another link late, too.
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

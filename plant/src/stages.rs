//! Latency of each stage of the loop, in nanoseconds, as HdrHistograms.
//!
//! In real time the schedule is the reference for every latency, so that a stall of the loop counts for every tick that it delays (no
//! coordinated omission; Tene, "How NOT to measure latency", 2013).

use freeplay_shm::Arrival;
use hdrhistogram::Histogram;

/// A stage of the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Schedule → the loop is awake, for every tick: a tick of catching up after a stall is late by the rest of the stall. Real time only.
    WakeUp,
    /// The same for only those ticks that the loop waited for, asleep or spinning: the quality of the machine's wake-ups. It excludes ticks
    /// of catching up, which had no wake-up. Real time only.
    Woken,
    /// Integrating one tick.
    PlantStep,
    /// Plant publishes → controller has the state.
    StateTransport,
    /// The controller's prediction.
    Predict,
    /// The controller's quadratic programme.
    Qp,
    /// The same for only those ticks in which the solver iterated because a limit was active.
    QpIterated,
    /// Controller has the state → controller sends the command.
    Compute,
    /// Controller sends → plant has the command.
    CommandTransport,
    /// Schedule → plant has the command, for every tick: a tick without an answer waits until that to a later tick. Lockstep: from
    /// publication.
    RoundTrip,
    /// Publication → plant has the command, only for answers in time: the usual measurement, with coordinated omission. Real time only.
    Uncorrected,
    /// Handing the tick to the recorder.
    Record,
}

impl Stage {
    /// All stages in the order of the tick.
    pub const ALL: [Stage; 12] = [
        Self::WakeUp,
        Self::Woken,
        Self::PlantStep,
        Self::StateTransport,
        Self::Predict,
        Self::Qp,
        Self::QpIterated,
        Self::Compute,
        Self::CommandTransport,
        Self::RoundTrip,
        Self::Uncorrected,
        Self::Record,
    ];

    /// The name in `summary.json` and in `.hlog` tags.
    pub fn name(self) -> &'static str {
        match self {
            Self::WakeUp => "wake_up",
            Self::Woken => "wake_up_uncorrected",
            Self::PlantStep => "plant_step",
            Self::StateTransport => "state_transport",
            Self::Predict => "predict",
            Self::Qp => "qp",
            Self::QpIterated => "qp_iterated",
            Self::Compute => "compute",
            Self::CommandTransport => "command_transport",
            Self::RoundTrip => "round_trip",
            Self::Uncorrected => "round_trip_uncorrected",
            Self::Record => "record",
        }
    }
}

/// One histogram per stage, 1 ns to 100 s at three digits; recording allocates nothing.
#[derive(Clone, Debug)]
pub struct Stages {
    histograms: Vec<Histogram<u64>>,
    /// Iterations of the quadratic programme.
    iterations: Histogram<u64>,
}

impl Stages {
    /// The greatest distinct latency, ns; longer ones count as this.
    pub const LONGEST: u64 = 100_000_000_000;

    /// Empty histograms.
    ///
    /// # Errors
    /// None for these bounds; the function passes on the library's error.
    pub fn new() -> Result<Self, hdrhistogram::CreationError> {
        let one = Histogram::new_with_bounds(1, Self::LONGEST, 3)?;
        let iterations = Histogram::new_with_bounds(1, 1_000_000, 3)?;
        Ok(Self { histograms: vec![one; Stage::ALL.len()], iterations })
    }

    /// Counts a latency of `nanoseconds` in `stage`.
    #[inline]
    pub fn record(&mut self, stage: Stage, nanoseconds: u64) {
        self.histograms[stage as usize].saturating_record(nanoseconds.max(1));
    }

    /// Counts a quadratic programme of `iterations`.
    #[inline]
    pub fn record_iterations(&mut self, iterations: u32) {
        self.iterations.saturating_record(u64::from(iterations).max(1));
    }

    /// The median of the iterations of the quadratic programme; 0 without one.
    pub fn usual_iterations(&self) -> u32 {
        self.iterations.value_at_quantile(0.5) as u32
    }

    /// Records the arrival of the loop at a tick: in [`Stage::WakeUp`], and also in [`Stage::Woken`] if the loop waited for the tick.
    #[inline]
    pub fn record_arrival(&mut self, arrival: Arrival) {
        self.record(Stage::WakeUp, arrival.late_ns);
        if arrival.waited {
            self.record(Stage::Woken, arrival.late_ns);
        }
    }

    /// The histogram of `stage`, ns.
    pub fn histogram(&self, stage: Stage) -> &Histogram<u64> {
        &self.histograms[stage as usize]
    }
}

//! The errors of a system: construction and integration.

use freeplay_arm::Shortfall;
use freeplay_laws::LawError;
use thiserror::Error;

/// The longest sub-step for a system with contacts, s.
pub const MAX_CONTACT_STEP: f64 = 1e-4;

/// Reason why construction or integration of a system failed.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SystemError {
    /// The sub-step is too long for contacts.
    #[error(
        "a sub-step of {step:e} s can't resolve a contact (it lasts about 5e-4 s); take {MAX_CONTACT_STEP:e} s or less: more sub-steps a tick"
    )]
    StepTooLong {
        /// The requested step, s.
        step: f64,
    },
    /// There must be at least one sub-step, of a positive length.
    #[error("a tick of {period} s in {substeps} sub-steps is not possible; both must be above zero")]
    NoStep {
        /// The tick's length, s.
        period: f64,
        /// Its sub-steps.
        substeps: u32,
    },
    /// A transmission oscillates too fast for the sub-step.
    #[error(
        "the transmission of {joint} oscillates at {frequency:.0} Hz against a rotor inertia of {motor:.2e}: too fast for a sub-step of {step:e} s; take {needed} sub-steps a tick or more, or give the joint a larger rotor_inertia"
    )]
    TransmissionTooStiff {
        /// The joint.
        joint: String,
        /// Frequency of the oscillation of motor and link against each other, Hz.
        frequency: f64,
        /// The requested step, s.
        step: f64,
        /// Sufficient number of sub-steps per tick.
        needed: f64,
        /// Inertia on the motor's side, kg·m² (kg).
        motor: f64,
    },
    /// A joint has no servo.
    #[error(
        "joint `{joint}` has no position servo, which mode servo needs at each joint: give it an [[effect]] of the kind \"servo\" in the arm file; \
         freeplay diagnose writes them from a recording of commanded and measured positions"
    )]
    NoServo {
        /// The joint.
        joint: String,
    },
    /// A joint's commands would act before they are sent.
    #[error("joint `{joint}` has a command_delay of {delay} s; a simulation needs 0 or more")]
    NegativeDelay {
        /// The joint.
        joint: String,
        /// Its delay, s.
        delay: f64,
    },
    /// The links behind the transmissions have no inertia of their own.
    #[error(
        "a joint with a transmission moves no inertia beyond its rotor along this motion; give its link mass"
    )]
    NoInertiaLeft,
    /// The damping of a joint stops it faster than a sub-step.
    #[error(
        "joint `{joint}`: a damping of {damping} {} stops its inertia of {inertia:.1e} {} within {:.1e} s: too fast for a sub-step of \
         {step:.1e} s; correct the damping or the inertia, give the joint a rotor_inertia in an arm file, or take {needed} sub-steps a tick",
        units[0], units[1], inertia / damping
    )]
    DampingTooStiff {
        /// The joint.
        joint: String,
        /// Its damping.
        damping: f64,
        /// The least effective inertia along the motion, all other joints free.
        inertia: f64,
        /// Units of the two.
        units: [&'static str; 2],
        /// The sub-step, s.
        step: f64,
        /// Sufficient number of sub-steps per tick.
        needed: f64,
    },
    /// The arm of this file is not suitable for a simulation.
    #[error(transparent)]
    Unfit(#[from] Shortfall),
    /// The effects make the arm impossible.
    #[error(transparent)]
    Law(#[from] LawError),
    /// A coordinate is no longer finite.
    #[error(
        "coordinate {coordinate} is not finite at t = {time} s; the sub-steps are too long for this contact or the command is too wild"
    )]
    NotFinite {
        /// Name of the coordinate.
        coordinate: String,
        /// Simulated time, s.
        time: f64,
    },
}

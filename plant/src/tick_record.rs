//! The record of one tick; it leaves the loop through a queue.

use freeplay_shm::{Command, Joints, MAX_JOINTS, MAX_SLOTS, State};
use sha2::{Digest, Sha256};

use crate::{Applied, Rejection};

/// Most joints with play that a record can hold.
pub const MAX_PLAYS: usize = freeplay_shm::MAX_JOINTS;

/// The differences without standbys.
pub const NO_DIFFERENCES: [Joints; MAX_SLOTS - 1] = [[f64::NAN; MAX_JOINTS]; MAX_SLOTS - 1];

/// One joint's bearing at a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlayRecord {
    /// Offset of the journal in the plane across the axis, m.
    pub offset: [f64; 2],
    /// Greatest normal force during the tick that ended here, N.
    pub peak_normal_force: f64,
    /// Duration of the contact so far, s; zero in free flight.
    pub episode: f64,
}

/// One tick: the messages, the applied command, and the true state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TickRecord {
    /// The plant's message.
    pub state: State,
    /// The answer to it, if it arrived before its deadline.
    pub command: Option<Command>,
    /// Command source during this tick.
    pub applied: Applied,
    /// Reason of the rejection of the answer, if the gate rejected it.
    pub rejection: Option<Rejection>,
    /// True tool position minus that of the nominal arm at the desired joint positions, base frame, m.
    pub deviation: [f64; 3],
    /// True tool pose: x y z (m), qx qy qz qw.
    pub tool: [f64; 7],
    /// Position of each joint on the link's side of its transmission as its sensor measures it, rad (m).
    pub link: Joints,
    /// Greatest force of the base on the first moving body during the tick that ended here, N.
    pub peak_base_force: f64,
    /// The bearings, in the order of the arm's plays.
    pub plays: [PlayRecord; MAX_PLAYS],
    /// Answer of each slot from 1 on minus that of slot 0, see [`crate::ControllerManager::differences`].
    pub differences: [Joints; MAX_SLOTS - 1],
    /// Number of marks set so far, see [`crate::OperatorRequest::Mark`].
    pub marks: u32,
}

impl TickRecord {
    /// Feeds this tick's State and Command into `hash`: every field except the wall-clock times, little-endian, in the order of the layout.
    /// Two lockstep runs of one scenario give the same bytes.
    pub fn digest(&self, hash: &mut Sha256) {
        digest_state(&self.state, hash);
        if let Some(command) = &self.command {
            digest_command(command, hash);
        }
    }
}

fn feed(hash: &mut Sha256, values: &[f64]) {
    values.iter().for_each(|value| hash.update(value.to_bits().to_le_bytes()));
}

fn digest_state(state: &State, hash: &mut Sha256) {
    // `run` is random in every run, and the times are wall-clock times: neither is part of the motion.
    hash.update(state.tick.to_le_bytes());
    for word in [state.layout, state.joints, state.mode, state.flags] {
        hash.update(word.to_le_bytes());
    }
    for values in [&state.q, &state.qd, &state.tau, &state.applied] {
        feed(hash, values);
    }
    for reference in [&state.reference, &state.reference_next] {
        feed(hash, &reference.q);
        feed(hash, &reference.qd);
        feed(hash, &reference.qdd);
    }
    feed(hash, &state.tool);
}

fn digest_command(command: &Command, hash: &mut Sha256) {
    hash.update(command.tick.to_le_bytes());
    for word in
        [command.layout, command.joints, command.slot, command.status, command.qp_iterations, command.kind]
    {
        hash.update(word.to_le_bytes());
    }
    for values in [&command.value, &command.velocity, &command.acceleration] {
        feed(hash, values);
    }
    feed(hash, &command.deviation);
}

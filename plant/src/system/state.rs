//! The state of a system as an exact copy that can be restored to the last bit, in a time that does not depend on the simulated time.
//!
//! Each type of the state lists all its fields. A new field therefore does not compile before the code names it: as a state variable, or as
//! one that is fixed or recomputed in each sub-step.

use freeplay_laws::{Archive, BearingContact};

use super::{System, TickPeaks};

impl System {
    /// Saves all state variables to `archive`, or restores them, for a system with the same arm, effects, period and sub-steps.
    pub fn transfer_state(&mut self, archive: &mut Archive) {
        let System {
            play: _,
            workspace: _,
            drives,
            forces: _,
            bearings,
            contacts,
            period: _,
            substeps: _,
            ticks,
            q,
            v,
            a,
            middle_q: _,
            middle_v: _,
            drive: _,
            total: _,
            motor,
            braked: _,
            prescribed: _,
            peaks: TickPeaks { base_force },
            ledger,
            named_servos: _,
        } = self;
        archive.count(ticks);
        archive.real(base_force);
        [q, v, a, motor].into_iter().for_each(|values| archive.reals(values));
        drives.transfer_state(archive);
        bearings.iter_mut().for_each(|bearing| bearing.transfer_state(archive));
        for contact in contacts {
            let BearingContact { normal, tangential, force, moment } = contact;
            archive.reals([normal, tangential, moment]);
            archive.reals(force);
        }
        ledger.transfer_state(archive);
    }
}

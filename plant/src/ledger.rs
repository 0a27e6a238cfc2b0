//! The energy ledger: the complete energy balance.
//!
//! E(t) − E(0) = W_drives + W_tool − D_contact − D_friction − D_drives − D_transmissions, with E kinetic + potential + stored in the
//! contacts and in the springs of transmissions. The system integrates the dissipated parts as additional states, as Simbody does, so that
//! tests can check conservation although contacts lose energy. The remainder, [`Ledger::residual`], is the integrator's error.

use freeplay_laws::Archive;
use serde::Serialize;

/// Energies of one system, J.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Ledger {
    /// Energy at the start: kinetic + potential + elastic.
    pub initial: f64,
    /// Kinetic energy now.
    pub kinetic: f64,
    /// Potential energy now, zero at the base's origin.
    pub potential: f64,
    /// Energy stored in the contacts and in the transmissions now.
    pub elastic: f64,
    /// Work of the drives, prescribed joints included.
    pub drives: f64,
    /// Loss in the contacts' damping.
    pub damping: f64,
    /// Loss in the contacts' friction.
    pub contact_friction: f64,
    /// Loss in the drives' friction and in the laws of effects on the drives; a spring among these returns its energy.
    pub drive_friction: f64,
    /// Loss in the damping of transmissions.
    pub transmission: f64,
    /// Work of the forces on the tool.
    pub tool_force: f64,
}

impl Ledger {
    /// Saves all energies, or restores them.
    pub(crate) fn transfer_state(&mut self, archive: &mut Archive) {
        let Ledger {
            initial,
            kinetic,
            potential,
            elastic,
            drives,
            damping,
            contact_friction,
            drive_friction,
            transmission,
            tool_force,
        } = self;
        archive.reals([initial, kinetic, potential, elastic, drives]);
        archive.reals([damping, contact_friction, drive_friction, transmission, tool_force]);
    }

    /// Kinetic + potential + elastic energy now.
    pub fn total(&self) -> f64 {
        self.kinetic + self.potential + self.elastic
    }

    /// Imbalance of the entries; zero for an exact integrator.
    pub fn residual(&self) -> f64 {
        let lost = self.damping + self.contact_friction + self.drive_friction + self.transmission;
        self.total() - self.initial - self.drives - self.tool_force + lost
    }
}

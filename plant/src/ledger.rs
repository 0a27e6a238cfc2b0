//! The energy ledger: where every joule went.
//!
//! E(t) − E(0) = W_drives + W_tool − D_contact − D_friction − D_drives − D_transmissions, with E kinetic + potential + stored in
//! the contacts and in the springs of transmissions.
//! The dissipated parts are integrated as states beside the motion, so that conservation can be tested although
//! contacts lose energy (Simbody's way). What is left, [`Ledger::residual`], is the integrator's error.

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
    /// Lost in the contacts' damping.
    pub damping: f64,
    /// Lost in the contacts' friction.
    pub contact_friction: f64,
    /// Lost in the drives' friction and to the laws that effects put on the drives; a spring among these gives it back.
    pub drive_friction: f64,
    /// Lost in the damping of transmissions.
    pub transmission: f64,
    /// Work of the forces on the tool.
    pub tool_force: f64,
}

impl Ledger {
    /// Transfers all energies.
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

    /// What the entries leave unexplained; zero for an exact integrator.
    pub fn residual(&self) -> f64 {
        let lost = self.damping + self.contact_friction + self.drive_friction + self.transmission;
        self.total() - self.initial - self.drives - self.tool_force + lost
    }
}

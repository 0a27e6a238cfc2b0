//! The contact of one joint with play: its state, start, forces and statistics.

use freeplay_laws::{Approach, Archive, BearingContact, Clearance, bearing_contact};
use serde::Serialize;

/// A contact shorter than this is an impact, a longer one continuous, s (`PHYSICS`: 2 ms; a Hertz impact lasts about 0.5 ms).
pub const IMPACT_LIMIT: f64 = 2e-3;

/// Durations of a journal's contact states, and its impact speeds and forces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ContactTally {
    /// Time in free flight, s.
    pub free: f64,
    /// Time in contacts shorter than [`IMPACT_LIMIT`], s.
    pub impact: f64,
    /// Time in longer contacts, s.
    pub continuous: f64,
    /// Number of contacts.
    pub contacts: u64,
    /// Number of contacts that ended before [`IMPACT_LIMIT`].
    pub impacts: u64,
    /// Approach speed of the first contact, m/s.
    pub first_speed: f64,
    /// Greatest approach speed, m/s.
    pub peak_speed: f64,
    /// Greatest normal force, N.
    pub peak_normal_force: f64,
    /// Greatest penetration, m.
    pub peak_penetration: f64,
}

impl ContactTally {
    /// Shares of the time in free flight, impact and continuous contact; they add up to 1 once time has passed.
    pub fn fractions(&self) -> [f64; 3] {
        let total = self.free + self.impact + self.continuous;
        if total > 0.0 {
            [self.free, self.impact, self.continuous].map(|time| time / total)
        } else {
            [0.0; 3]
        }
    }
}

/// One joint's bearing: its law and the state of its contact.
#[derive(Clone, Debug)]
pub struct Bearing {
    clearance: Clearance,
    touching: bool,
    impact_speed: f64,
    episode: f64,
    recent_peak: f64,
    tally: ContactTally,
}

impl Bearing {
    /// A bearing whose journal has had no contact yet.
    pub fn new(clearance: Clearance) -> Self {
        Self {
            clearance,
            touching: false,
            impact_speed: 0.0,
            episode: 0.0,
            recent_peak: 0.0,
            tally: ContactTally::default(),
        }
    }

    /// The law of this bearing.
    pub fn clearance(&self) -> &Clearance {
        &self.clearance
    }

    /// True if the journal touches.
    pub fn touching(&self) -> bool {
        self.touching
    }

    /// Approach speed latched at the last contact, m/s.
    pub fn impact_speed(&self) -> f64 {
        self.impact_speed
    }

    /// Duration of the contact so far, s; zero in free flight.
    pub fn episode(&self) -> f64 {
        self.episode
    }

    /// The greatest normal force since the last call, N.
    pub fn take_peak(&mut self) -> f64 {
        std::mem::take(&mut self.recent_peak)
    }

    /// Force and moment on the journal at `approach`, for a sub-step of `step` s; latches the impact speed.
    #[inline]
    pub fn contact(&mut self, approach: &Approach, step: f64) -> BearingContact {
        if approach.penetration <= 0.0 {
            self.leave();
            self.tally.free += step;
            return BearingContact::default();
        }
        if !self.touching {
            self.touching = true;
            self.impact_speed = approach.rate;
            if self.tally.contacts == 0 {
                self.tally.first_speed = approach.rate;
            }
            self.tally.contacts += 1;
            self.tally.peak_speed = self.tally.peak_speed.max(approach.rate);
        }
        self.episode += step;
        let contact = bearing_contact(&self.clearance, approach, self.impact_speed);
        self.recent_peak = self.recent_peak.max(contact.normal);
        self.tally.peak_normal_force = self.tally.peak_normal_force.max(contact.normal);
        self.tally.peak_penetration = self.tally.peak_penetration.max(approach.penetration);
        contact
    }

    /// Ends the present contact, if there is one.
    fn leave(&mut self) {
        if self.touching {
            self.tally = self.settled();
            (self.touching, self.episode) = (false, 0.0);
        }
    }

    /// Saves the state variables of the contact, or restores them.
    pub(crate) fn transfer_state(&mut self, archive: &mut Archive) {
        let Bearing { clearance: _, touching, impact_speed, episode, recent_peak, tally } = self;
        let ContactTally {
            free,
            impact,
            continuous,
            contacts,
            impacts,
            first_speed,
            peak_speed,
            peak_normal_force,
            peak_penetration,
        } = tally;
        archive.flag(touching);
        archive.reals([impact_speed, episode, recent_peak, free, impact, continuous]);
        archive.count(contacts);
        archive.count(impacts);
        archive.reals([first_speed, peak_speed, peak_normal_force, peak_penetration]);
    }

    /// The tally including the present contact up to now.
    pub fn settled(&self) -> ContactTally {
        let mut tally = self.tally;
        if !self.touching {
            return tally;
        }
        if self.episode < IMPACT_LIMIT {
            tally.impact += self.episode;
            tally.impacts += 1;
        } else {
            tally.continuous += self.episode;
        }
        tally
    }
}

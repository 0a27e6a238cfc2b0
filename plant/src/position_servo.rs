//! Position servos of the joints: they turn the commands that reach them into torques.
//!
//! τ = k e′ − d q̇ within the torque limit, with e = r − q, e′ = e outside of the dead band less its half width, and zero inside. The
//! set-point r follows the command, rounded down to the servo's resolution and shifted by its offset, no faster than the speed limit; a
//! command takes effect a delay after its sending. Friction is the joint's own.
//! Source: Åström & Murray 2008, Feedback Systems, §10.

use std::collections::VecDeque;

use freeplay_laws::{Archive, ServoLaw};

/// The servo of one joint with its state.
#[derive(Clone, Debug)]
pub(crate) struct PositionServo {
    law: ServoLaw,
    /// Time from a command to its effect, s.
    delay: f64,
    /// Pending commands: the time at which each takes effect, s, and its set-point, rad (m).
    under_way: VecDeque<(f64, f64)>,
    asked: f64,
    set_point: f64,
    /// Torque in the last sub-step, N·m (N).
    torque: f64,
}

impl PositionServo {
    /// A servo whose commands arrive at least `period` s apart.
    pub fn new(law: ServoLaw, delay: f64, period: f64) -> Self {
        // Capacity for all commands that can be pending, so that the loop allocates nothing.
        let room = (delay / period).ceil() as usize + 2;
        let under_way = VecDeque::with_capacity(room);
        Self { law, delay, under_way, asked: 0.0, set_point: 0.0, torque: 0.0 }
    }

    /// The damping of its torque, N·m·s/rad (N·s/m).
    pub fn damping(&self) -> f64 {
        self.law.damping
    }

    /// Holds the joint at `q`.
    pub fn restart(&mut self, q: f64) {
        self.under_way.clear();
        (self.asked, self.set_point, self.torque) = (q, q, 0.0);
    }

    /// Sends it the command `q`, rad (m), at the time `t`, s.
    #[inline]
    pub fn command(&mut self, t: f64, q: f64) {
        let step = self.law.resolution;
        let rounded = if step > 0.0 { (q / step).floor() * step } else { q };
        self.under_way.push_back((t + self.delay, rounded + self.law.offset));
    }

    /// Saves the set-point and the pending commands, or restores them.
    pub fn transfer_state(&mut self, archive: &mut Archive) {
        let PositionServo { law: _, delay: _, under_way, asked, set_point, torque } = self;
        archive.reals([asked, set_point, torque]);
        let mut commands = under_way.len() as u64;
        archive.count(&mut commands);
        // No more commands can be pending than the capacity; a longer list of words is left incomplete.
        under_way.resize((commands as usize).min(under_way.capacity()), (0.0, 0.0));
        for (due, command) in under_way {
            archive.reals([due, command]);
        }
    }

    /// Its torque, N·m (N), in a sub-step of `step` s around the time `t`, s, at the position `q` and velocity `v`.
    #[inline]
    pub fn act(&mut self, t: f64, step: f64, [q, v]: [f64; 2]) -> f64 {
        while let Some(&(due, asked)) = self.under_way.front()
            && due <= t
        {
            self.asked = asked;
            self.under_way.pop_front();
        }
        let most = self.law.speed_limit * step;
        self.set_point += (self.asked - self.set_point).clamp(-most, most);
        let error = self.set_point - q;
        let beyond = error - error.clamp(-self.law.deadband, self.law.deadband);
        let torque = self.law.stiffness * beyond - self.law.damping * v;
        self.torque = torque.clamp(-self.law.torque_limit, self.law.torque_limit);
        self.torque
    }

    /// Torque in the last sub-step, N·m (N).
    pub fn torque(&self) -> f64 {
        self.torque
    }
}

#[cfg(test)]
mod tests {
    use freeplay_laws::ServoLaw;

    use super::PositionServo;

    const LAW: ServoLaw = ServoLaw {
        stiffness: 10.0,
        damping: 0.5,
        deadband: 0.0,
        torque_limit: f64::INFINITY,
        speed_limit: f64::INFINITY,
        resolution: 0.0,
        offset: 0.0,
    };

    #[test]
    fn a_command_acts_after_its_delay_and_room_is_enough() {
        let mut servo = PositionServo::new(LAW, 0.0104, 0.001);
        servo.restart(0.0);
        let room = servo.under_way.capacity();
        for tick in 0..100_u32 {
            let t = f64::from(tick) * 1e-3;
            servo.command(t, f64::from(tick));
            let torque = servo.act(t + 5e-4, 1e-3, [0.0; 2]);
            let acting = f64::from(tick.saturating_sub(10));
            assert!((torque - 10.0 * acting).abs() < 1e-9, "{tick}: {torque}");
        }
        assert_eq!(servo.under_way.capacity(), room);
    }

    #[test]
    fn limits_dead_band_and_rounding_act() {
        let given = |law: ServoLaw, command: f64, state: [f64; 2]| {
            let mut servo = PositionServo::new(law, 0.0, 0.001);
            servo.restart(0.0);
            servo.command(0.0, command);
            servo.act(0.0, 0.001, state)
        };
        assert_eq!(given(LAW, 0.5, [0.1, 2.0]), 10.0 * 0.4 - 0.5 * 2.0);
        assert_eq!(given(ServoLaw { torque_limit: 2.0, ..LAW }, 0.5, [0.0; 2]), 2.0);
        assert_eq!(given(ServoLaw { deadband: 0.1, ..LAW }, 0.05, [0.0; 2]), 0.0);
        assert!((given(ServoLaw { speed_limit: 3.0, ..LAW }, 0.5, [0.0; 2]) - 0.03).abs() < 1e-12);
        assert!(
            (given(ServoLaw { resolution: 0.2, offset: 0.01, ..LAW }, 0.5, [0.0; 2]) - 4.1).abs() < 1e-12
        );
    }
}

//! The parameters of one joint on a position servo.

/// A joint on a position servo: the servo, the friction that resists it, and the bounds of the joint. Units are those of a revolute joint;
/// for a prismatic joint read m for rad and N for N·m.
///
/// Law: τ = clamp(k e′ − d q̇, ± limit), with e = r − q the error against the set-point r, e′ = e outside of the dead band
/// less its half width, and zero inside. The set-point follows the command, which is held between its stamps, `delay` late and never
/// faster than the speed limit. Dry friction is set-valued: at rest it is anything between ± (coulomb + stiction), in motion
/// coulomb + stiction exp(−(q̇/stribeck_velocity)²) against the motion.
/// Source: Armstrong-Hélouvry, Dupont & Canudas de Wit 1994, Automatica 30:1083 (friction); Åström & Murray 2008, §10 (servo).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointServo {
    /// Torque per position error k, N·m/rad; above 0.
    pub stiffness: f64,
    /// Torque per speed d, N·m·s/rad, the servo's own and the viscous friction together; 0 or more.
    pub damping: f64,
    /// Error below which the servo gives no torque, rad; 0 or more.
    pub deadband: f64,
    /// Greatest torque of the servo, N·m; infinite if none.
    pub torque_limit: f64,
    /// Greatest speed of the set-point, rad/s; infinite if none.
    pub speed_limit: f64,
    /// Time from the stamp of a command to its effect on the encoder's reading, s; negative where the encoder samples later than the
    /// command acts.
    pub delay: f64,
    /// Set-point minus command, rad.
    pub offset: f64,
    /// Step of the set-point, rad: a command is rounded down to a multiple of it; 0 if none.
    pub resolution: f64,
    /// Sliding friction at speed, N·m; 0 or more.
    pub coulomb: f64,
    /// Friction at rest beyond the sliding friction, N·m; 0 or more.
    pub stiction: f64,
    /// Speed at which stiction has fallen to 1/e, rad/s; above 0.
    pub stribeck_velocity: f64,
    /// Rotor inertia through the gear, kg·m², in addition to that of the arm file; 0 or more.
    pub rotor_inertia: f64,
    /// Positions between which the joint can move, rad; infinite where there is no stop.
    pub stops: [f64; 2],
}

impl JointServo {
    /// A servo of `stiffness` (N·m/rad) without damping, friction, limits and delay.
    pub fn stiff(stiffness: f64) -> JointServo {
        JointServo {
            stiffness,
            damping: 0.0,
            deadband: 0.0,
            torque_limit: f64::INFINITY,
            speed_limit: f64::INFINITY,
            delay: 0.0,
            offset: 0.0,
            resolution: 0.0,
            coulomb: 0.0,
            stiction: 0.0,
            stribeck_velocity: 0.05,
            rotor_inertia: 0.0,
            stops: [f64::NEG_INFINITY, f64::INFINITY],
        }
    }

    /// Dry friction at the speed `v` (rad/s), N·m: at rest its maximum, in motion its magnitude.
    #[inline]
    pub fn dry_friction(&self, v: f64) -> f64 {
        if self.stiction == 0.0 {
            return self.coulomb;
        }
        let ratio = v / self.stribeck_velocity;
        let square = ratio * ratio;
        // Beyond this, e⁻⁴⁰ of the stiction is smaller than the rounding error of a holding torque.
        if square > 40.0 { self.coulomb } else { self.coulomb + self.stiction * (-square).exp() }
    }

    /// The servo's torque at the error `e` (rad) and speed `v` (rad/s), N·m.
    pub fn torque(&self, e: f64, v: f64) -> f64 {
        let line = self.linearized(e, v);
        line.constant + line.stiffness * e - line.damping * v
    }

    /// The servo's torque near the error `e` (rad) and speed `v` (rad/s) as a straight line of both.
    #[inline]
    pub fn linearized(&self, e: f64, v: f64) -> Linearization {
        let beyond = e - e.clamp(-self.deadband, self.deadband);
        let torque = self.stiffness * beyond - self.damping * v;
        if torque.abs() > self.torque_limit {
            return Linearization {
                stiffness: 0.0,
                damping: 0.0,
                constant: self.torque_limit.copysign(torque),
            };
        }
        if beyond == 0.0 {
            return Linearization { stiffness: 0.0, damping: self.damping, constant: 0.0 };
        }
        let constant = -self.stiffness * self.deadband.copysign(beyond);
        Linearization { stiffness: self.stiffness, damping: self.damping, constant }
    }
}

/// A piece of the servo's law: torque = constant + stiffness · error − damping · speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linearization {
    /// N·m/rad.
    pub stiffness: f64,
    /// N·m·s/rad.
    pub damping: f64,
    /// N·m.
    pub constant: f64,
}

impl Linearization {
    /// Placeholder before the first step. Its values are NaN, so no piece is equal to it.
    pub(crate) const UNSET: Linearization =
        Linearization { stiffness: f64::NAN, damping: f64::NAN, constant: f64::NAN };
}

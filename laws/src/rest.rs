//! The rest position of the journal of a joint with play in its bearing.
//!
//! A journal in permanent contact lies against its bearing where the contact force carries the outer links. With b the force that the
//! bearing must carry (the two slide rows of the inverse dynamics of the arm with play), the contact force is b; without friction its
//! normal n points along u = −b/|b|. Friction with the signed coefficient m = μ(v_T) turns the normal by atan m,
//!
//! `n = (u + m u⊥)/√(1 + m²),  u⊥ = (−u₂, u₁),  F_N = |b|/√(1 + m²)`,
//!
//! and loads the drive with the moment −m F_N R_j. The sliding speed is v_T = R_j q̇ + (c + δ) ṅ·t with the joint velocity q̇ and t = axis
//! × n. Since ṅ contains the change of atan m, m is the root of m = μ(v_T(m)), evaluated over the last tick. The displacement of the
//! journal is d = (c + δ) n, δ = (F_N/K)^(2/3).
//!
//! Source: the contact laws of Erkaya (2018), Eqs. 3–7, solved for rest. It fails where the journal detaches (|b| → 0).

use crate::Clearance;

/// Below this force, N, a journal has no defined rest position; it keeps the last one.
const LEAST_FORCE: f64 = 1e-9;
/// Halvings of the interval of friction coefficients: to 1e-9 of it.
const BISECTIONS: usize = 30;

/// The journal of one joint with play at rest in its bearing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rest {
    /// Force of the bearing on the journal, |b|, N.
    pub force: f64,
    /// Displacement d of the journal's centre along the two slides, m.
    pub displacement: [f64; 2],
    /// Moment of the contact friction on the joint, N·m.
    pub moment: f64,
    /// Direction u of the load; `None` without a load so far.
    load: Option<[f64; 2]>,
    /// Angle atan m by which friction turns the normal away from it, rad.
    tilt: f64,
}

impl Rest {
    /// Direction in which the load presses the journal, in the coordinates of the slides; `None` before the first load.
    pub fn direction(&self) -> Option<[f64; 2]> {
        self.load
    }
}

/// The rest of a journal in `clearance` under the force `b` (N, along the two slides) of its bearing, while its joint turns at `turning`,
/// rad/s; `last` is the rest one tick of `period` seconds before.
pub fn settle(clearance: &Clearance, b: [f64; 2], turning: f64, last: &Rest, period: f64) -> Rest {
    let force = b[0].hypot(b[1]);
    if force.is_nan() || force <= LEAST_FORCE {
        return Rest { force, moment: 0.0, ..*last };
    }
    let u = [-b[0] / force, -b[1] / force];
    let surface_speed = clearance.journal_radius() * turning;
    let m = match last.load {
        None => clearance.friction.coefficient(surface_speed),
        Some(before) => {
            // (c + δ) times the turning rate of u towards t = (u₂, −u₁) is the speed of a journal that does not tilt.
            let turned = (u[0] - before[0]) * u[1] - (u[1] - before[1]) * u[0];
            let reach = clearance.clearance + clearance.normal.static_penetration(force);
            tilt(clearance, surface_speed + reach * turned / period, reach / period, last.tilt)
        }
    };
    let root = (1.0 + m * m).sqrt();
    let normal_force = force / root;
    let reach = clearance.clearance + clearance.normal.static_penetration(normal_force);
    Rest {
        force,
        displacement: [reach * (u[0] - m * u[1]) / root, reach * (u[1] + m * u[0]) / root],
        moment: -m * normal_force * clearance.journal_radius(),
        load: Some(u),
        tilt: m.atan(),
    }
}

/// The signed friction coefficient m of a journal that tilts by atan m and slides at `speed − lever (atan m − before)`, m/s: the root of `m
/// = μ(v_T)` by bisection. The time for tilting back matters: without it the journal would jump where the sliding changes its sign.
fn tilt(clearance: &Clearance, speed: f64, lever: f64, before: f64) -> f64 {
    let friction = &clearance.friction;
    let largest = friction.static_coefficient.max(friction.dynamic_coefficient);
    let (mut low, mut high) = (-largest, largest);
    for _ in 0..BISECTIONS {
        let m = 0.5 * (low + high);
        if m > friction.coefficient(speed - lever * (m.atan() - before)) {
            high = m;
        } else {
            low = m;
        }
    }
    0.5 * (low + high)
}

//! The time stepping: Moreau and Jean's, with dry friction as a set (Moreau 1988; Jean 1999; Acary & Brogliato 2008, §10).
//!
//! A long step evaluates mass matrix and bias forces once, in its middle. Within it, short steps keep them constant and resolve the fast and local forces:
//! transmissions, bearings, bristles, and dry friction. Projected Gauss–Seidel finds the friction impulses implicitly, for all joints together: each impulse
//! stops its joint, as far as its bounds allow. A joint that sticks has speed zero.

use freeplay_arm::{Workspace, jacobian, mass_and_bias};
use nalgebra::{DMatrix, Matrix2, Vector2};

use super::plan::{BearingLaw, Plan, PlanError};

/// Most sweeps of the Gauss–Seidel iteration.
const SWEEPS: usize = 60;
/// Change of speed below which it has converged, rad/s.
const SETTLED: f64 = 1e-11;

/// A dry friction, which acts on the speed u_a + s u_b, or on u_a alone.
#[derive(Clone, Copy, Debug)]
struct DryFrictionSite {
    a: usize,
    b: Option<(usize, f64)>,
    joint: usize,
    shaft: Option<usize>,
}

/// A machine in motion.
pub(crate) struct Stepper<'a> {
    plan: &'a Plan,
    ws: Workspace,
    /// Time, s.
    pub t: f64,
    /// Coordinates and their speeds.
    pub x: Vec<f64>,
    pub u: Vec<f64>,
    /// Acceleration over the last long step.
    a: Vec<f64>,
    z: Vec<f64>,
    anchor: Vec<f64>,
    /// Torque that each joint transmitted to its link in the last short step, N·m.
    transmitted: Vec<f64>,
    sites: Vec<DryFrictionSite>,
    impulse: Vec<f64>,
    bounds: Vec<[f64; 2]>,
    columns: Vec<f64>,
    m_arm: DMatrix<f64>,
    mass: DMatrix<f64>,
    inverse: DMatrix<f64>,
    bias: Vec<f64>,
    middle: Vec<f64>,
    speed: Vec<f64>,
    before: Vec<f64>,
    force: Vec<f64>,
    tool_jacobian: DMatrix<f64>,
}

impl<'a> Stepper<'a> {
    /// A machine at rest at time `t` with every joint at `q`.
    pub fn new(plan: &'a Plan, t: f64, q: &[f64]) -> Self {
        let (n, all, joints) = (plan.arm.dof(), plan.coordinates(), plan.joints());
        let mut x = vec![0.0; all];
        for joint in 0..joints {
            x[plan.link[joint]] = q[joint];
            x[plan.motor[joint]] = q[joint];
        }
        let mut sites: Vec<DryFrictionSite> = (0..joints)
            .filter(|&joint| plan.bristles[joint].is_none())
            .map(|joint| DryFrictionSite { a: plan.motor[joint], b: None, joint, shaft: None })
            .collect();
        sites.extend(plan.shafts.iter().enumerate().map(|(i, shaft)| DryFrictionSite {
            a: plan.motor[shaft.joint],
            b: Some((plan.motor[shaft.with], shaft.sign)),
            joint: shaft.joint,
            shaft: Some(i),
        }));
        Self {
            ws: Workspace::new(&plan.arm),
            t,
            u: vec![0.0; all],
            a: vec![0.0; all],
            z: vec![0.0; joints],
            anchor: q.to_vec(),
            transmitted: vec![0.0; joints],
            impulse: vec![0.0; sites.len()],
            bounds: vec![[0.0; 2]; sites.len()],
            columns: vec![0.0; sites.len() * all],
            m_arm: DMatrix::zeros(n, n),
            mass: DMatrix::zeros(all, all),
            inverse: DMatrix::zeros(all, all),
            bias: vec![0.0; n],
            middle: vec![0.0; n],
            speed: vec![0.0; n],
            before: vec![0.0; all],
            force: vec![0.0; all],
            tool_jacobian: DMatrix::zeros(6, n),
            sites,
            plan,
            x,
        }
    }

    /// One long step of `step` s under the motor torques, computed from the currents.
    ///
    /// # Errors
    /// [`PlanError::NotFinite`].
    pub fn long_step(&mut self, by_current: &[f64], step: f64) -> Result<(), PlanError> {
        self.evaluate_dynamics(step);
        self.before.copy_from_slice(&self.u);
        let h = step / self.plan.substeps as f64;
        for _ in 0..self.plan.substeps {
            self.short_step(by_current, h);
        }
        for ((a, after), before) in self.a.iter_mut().zip(&self.u).zip(&self.before) {
            *a = (after - before) / step;
        }
        match self.u.iter().chain(&self.x).position(|value| !value.is_finite()) {
            Some(at) => Err(PlanError::NotFinite { coordinate: at % self.u.len(), time: self.t }),
            None => Ok(()),
        }
    }

    /// Evaluates mass matrix, its inverse and bias forces in the middle of the coming step.
    fn evaluate_dynamics(&mut self, step: f64) {
        let n = self.plan.arm.dof();
        for i in 0..n {
            self.middle[i] = self.x[i] + 0.5 * step * (self.u[i] + 0.25 * step * self.a[i]);
            self.speed[i] = self.u[i] + 0.5 * step * self.a[i];
        }
        let arm = self.plan.arm_at(self.t);
        mass_and_bias(arm, &mut self.ws, &self.middle, &self.speed, &mut self.m_arm, &mut self.bias);
        if let Some(push) = self.plan.push.filter(|push| self.t >= push.start && self.t < push.end) {
            jacobian(arm, &mut self.ws, &self.middle, &mut self.tool_jacobian);
            for (i, bias) in self.bias.iter_mut().enumerate() {
                *bias -= self.tool_jacobian.fixed_view::<3, 1>(0, i).dot(&push.force);
            }
        }
        self.mass.fill(0.0);
        self.mass.view_mut((0, 0), (n, n)).copy_from(&self.m_arm);
        for &(i, j, inertia) in &self.plan.inertia {
            self.mass[(i, j)] += inertia;
        }
        match self.mass.clone().cholesky() {
            Some(factor) => self.inverse = factor.inverse(),
            // The check for finite numbers after the step detects this.
            None => self.inverse.fill(f64::NAN),
        }
        let all = self.u.len();
        for (site, column) in self.sites.iter().zip(self.columns.chunks_exact_mut(all)) {
            for (i, value) in column.iter_mut().enumerate() {
                let second = site.b.map_or(0.0, |(b, sign)| sign * self.inverse[(i, b)]);
                *value = self.inverse[(i, site.a)] + second;
            }
        }
    }

    fn short_step(&mut self, by_current: &[f64], h: f64) {
        for (x, u) in self.x.iter_mut().zip(&self.u) {
            *x += 0.5 * h * u;
        }
        self.sum_forces(by_current, h);
        self.compute_friction_bounds(h);
        // The speed after the step without dry friction.
        for (i, u) in self.u.iter_mut().enumerate() {
            let row = self.inverse.column(i);
            *u += h * row.iter().zip(&self.force).map(|(w, f)| w * f).sum::<f64>();
        }
        self.add_oil_forces(h);
        self.solve_friction();
        for (x, u) in self.x.iter_mut().zip(&self.u) {
            *x += 0.5 * h * u;
        }
        self.t += h;
        self.update_transmitted_torques(by_current, h);
    }

    /// Sums all forces but dry friction and oil.
    fn sum_forces(&mut self, by_current: &[f64], h: f64) {
        let plan = self.plan;
        self.force.fill(0.0);
        for (force, bias) in self.force.iter_mut().zip(&self.bias) {
            *force = -bias;
        }
        for (joint, drive) in plan.drives.iter().enumerate() {
            let at = plan.motor[joint];
            let (q, v) = (self.x[at], self.u[at]);
            let mut torque = by_current[joint] + drive.torque(q, v, self.t);
            if let Some(bristles) = &plan.bristles[joint] {
                let size = drive.dry_friction(q, v, self.transmitted[joint], self.t)[usize::from(v < 0.0)];
                torque -= bristles.step(&mut self.z[joint], v, size, h);
            }
            if let Some(cable) = &plan.cables[joint] {
                torque += cable.torque(q, &mut self.anchor[joint]);
            }
            self.force[at] += torque;
        }
        for shaft in &plan.shafts {
            let (i, j) = (plan.motor[shaft.joint], plan.motor[shaft.with]);
            let torque = -shaft.viscous * (self.u[i] + shaft.sign * self.u[j]);
            self.force[i] += torque;
            self.force[j] += shaft.sign * torque;
        }
        for spring in &plan.springs {
            let at = spring.coordinate;
            self.force[at] -= spring.stiffness * (self.x[at] - spring.rest) + spring.damping * self.u[at];
        }
        for t in &plan.transmissions {
            let (motor, link) = (plan.motor[t.joint], plan.link[t.joint]);
            let torque = t.torque(self.x[motor] - self.x[link], self.u[motor] - self.u[link]);
            self.force[motor] -= torque;
            self.force[link] += torque;
        }
        for bearing in plan.bearings.iter().filter(|b| matches!(b.law, BearingLaw::Dry(_))) {
            let s = bearing.slides;
            let spin = self.u[bearing.turn];
            let push = bearing.law.push([self.x[s], self.x[s + 1]], [self.u[s], self.u[s + 1]], spin);
            self.force[s] += push.force[0];
            self.force[s + 1] += push.force[1];
            self.force[bearing.turn] += push.moment;
        }
    }

    /// Adds the oil force. Oil is stiff in speed: the force is that at the speed after the step, to first order.
    fn add_oil_forces(&mut self, h: f64) {
        for bearing in self.plan.bearings.iter().filter(|b| matches!(b.law, BearingLaw::Oil(_))) {
            let s = bearing.slides;
            let (x, spin) = ([self.x[s], self.x[s + 1]], self.u[bearing.turn]);
            let at = |u: Vector2<f64>| Vector2::from(bearing.law.push(x, [u.x, u.y], spin).force);
            let free = Vector2::new(self.u[s], self.u[s + 1]);
            let now = at(free);
            let small = 1e-6;
            let slope = Matrix2::from_columns(&[
                (at(free + Vector2::x() * small) - now) / small,
                (at(free + Vector2::y() * small) - now) / small,
            ]);
            let w = self.inverse.fixed_view::<2, 2>(s, s).into_owned() * h;
            let Some(solve) = (Matrix2::identity() - w * slope).try_inverse() else { continue };
            let force = now + slope * (solve * (w * now));
            for (i, u) in self.u.iter_mut().enumerate() {
                *u += h * (self.inverse[(i, s)] * force.x + self.inverse[(i, s + 1)] * force.y);
            }
        }
    }

    /// Computes the bounds of the friction impulses in a step of `h`.
    fn compute_friction_bounds(&mut self, h: f64) {
        for (site, bounds) in self.sites.iter().zip(&mut self.bounds) {
            let [plus, minus] = match site.shaft {
                Some(shaft) => [self.plan.shafts[shaft].coulomb; 2],
                None => {
                    let (drive, at) = (&self.plan.drives[site.joint], site.a);
                    drive.dry_friction(self.x[at], self.u[at], self.transmitted[site.joint], self.t)
                }
            };
            *bounds = [-h * plus, h * minus];
        }
    }

    /// Solves for dry friction: starts from the impulses of the step before and sets each in turn to the value that stops its speed, within its bounds.
    fn solve_friction(&mut self) {
        let all = self.u.len();
        for (e, column) in self.columns.chunks_exact(all).enumerate() {
            let start = self.impulse[e].clamp(self.bounds[e][0], self.bounds[e][1]);
            self.impulse[e] = start;
            self.u.iter_mut().zip(column).for_each(|(u, w)| *u += w * start);
        }
        for _ in 0..SWEEPS {
            let mut change = 0.0_f64;
            for (e, (site, column)) in self.sites.iter().zip(self.columns.chunks_exact(all)).enumerate() {
                let along = |v: &[f64]| v[site.a] + site.b.map_or(0.0, |(b, sign)| sign * v[b]);
                let (speed, yielding) = (along(&self.u), along(column));
                let wanted = self.impulse[e] - speed / yielding;
                let next = wanted.clamp(self.bounds[e][0], self.bounds[e][1]);
                let step = next - self.impulse[e];
                if step != 0.0 {
                    self.impulse[e] = next;
                    self.u.iter_mut().zip(column).for_each(|(u, w)| *u += w * step);
                    change = change.max((step * yielding).abs());
                }
            }
            if change < SETTLED {
                break;
            }
        }
    }

    /// Updates the torque that each joint transmits to its link, on which load-dependent friction depends. The rotor of the data sheet takes its own part of
    /// the drive's torque and does not transmit it.
    fn update_transmitted_torques(&mut self, by_current: &[f64], h: f64) {
        let plan = self.plan;
        for (site, impulse) in self.sites.iter().zip(&self.impulse).filter(|(site, _)| site.shaft.is_none()) {
            let (joint, drive) = (site.joint, &plan.drives[site.joint]);
            let (q, v) = (self.x[site.a], self.u[site.a]);
            let torque = by_current[joint] + drive.torque(q, v, self.t) + impulse / h;
            let rotor = plan.arm.joints()[plan.link[joint]].rotor_inertia;
            self.transmitted[joint] = torque - rotor * self.a[site.a];
        }
        for t in &plan.transmissions {
            let (motor, link) = (plan.motor[t.joint], plan.link[t.joint]);
            self.transmitted[t.joint] = t.torque(self.x[motor] - self.x[link], self.u[motor] - self.u[link]);
        }
    }
}

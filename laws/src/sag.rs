//! Laws by which a part of the arm deflects under the arm's weight and inertial force at the instant.
//!
//! Where a link bends or the mount tilts, all links beyond move as one rigid body, by some millimetres at most. The tool moves with these
//! links, and so do their centres of mass, so that the drives hold them by other levers. To first order in the displacement, a force f
//! whose point of action is shifted by s exerts the additional moment s × f on all joints before it. For joints that turn by θ together
//! with the links, the same forces act as if they were turned by −θ. Where the displacement stores elastic energy, the additional torque of
//! a joint is the derivative of that energy by the position of the joint. The moment of each link about its own centre of mass is
//! approximated by that of the unturned link.

use std::fmt::Debug;

use freeplay_arm::{Arm, JointKind, Workspace, joint_reaction, rnea};
use freeplay_model::export::Element;
use nalgebra::{Point3, Vector3};

use crate::archive::Archive;
use crate::columns::Columns;
use crate::effect::{Effect, ExportCoverage};
use crate::injection::{DriveLaw, DriveState, Injection, Readings, SensorLaw};
use crate::prediction::Change;
use crate::scene::Scene;

/// A law of deflection under the arm's load.
pub(crate) trait SagLaw: Debug + Copy + Send + Sync + 'static {
    /// The deflection; `ws` holds the poses and reactions of `arm` at the instant.
    fn sag(&self, arm: &Arm, ws: &Workspace) -> Sag;
}

/// The displacement of a part of an arm by a deflection, base frame.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sag {
    /// The first link that moves as a whole; all beyond move with it.
    pub from: usize,
    /// A point that moves with them, m.
    pub about: Vector3<f64>,
    /// Displacement of that point, m.
    pub shift: Vector3<f64>,
    /// Rotation of these links, rad.
    pub turn: Vector3<f64>,
    /// Displacement of the centre of mass of the link before them, m.
    pub before: Vector3<f64>,
}

impl Sag {
    /// Displacement of `place` if it moves with the links beyond, m.
    fn at(&self, place: Vector3<f64>) -> Vector3<f64> {
        self.shift + self.turn.cross(&(place - self.about))
    }

    /// Adds the additional load of each joint along its axis to `load`, N·m (N).
    fn load(&self, arm: &Arm, ws: &Workspace, load: &mut [f64]) {
        let (mut carried, mut moment) = (Vector3::zeros(), Vector3::zeros());
        let mut beyond = (Vector3::zeros(), Vector3::zeros());
        for (link, joint) in arm.joints().iter().enumerate().rev() {
            let pose = ws.link_pose(link);
            let (pressed, _) = pressure(ws, link);
            let force = pressed - std::mem::replace(&mut carried, pressed);
            let mass = (pose * Point3::from(joint.inertia.com)).coords;
            let axis = pose.rotation * joint.axis.into_inner();
            load[link] = if link >= self.from {
                moment += self.at(mass).cross(&force);
                let turned = force.cross(&self.turn);
                // Moments are about the base's origin, so that one sum serves every joint.
                beyond = (beyond.0 + turned, beyond.1 + mass.cross(&turned));
                match joint.kind {
                    JointKind::Revolute => axis.dot(&(beyond.1 - pose.translation.vector.cross(&beyond.0))),
                    JointKind::Prismatic => axis.dot(&beyond.0),
                }
            } else {
                if link + 1 == self.from {
                    moment += self.before.cross(&force);
                }
                match joint.kind {
                    JointKind::Revolute => axis.dot(&moment),
                    JointKind::Prismatic => 0.0,
                }
            };
        }
    }
}

/// Force, and moment about its origin, that the link of `joint` and all links beyond exert on their support, base frame, N and N·m.
pub(crate) fn pressure(ws: &Workspace, joint: usize) -> (Vector3<f64>, Vector3<f64>) {
    let rotation = ws.link_pose(joint).rotation;
    let (force, moment) = joint_reaction(ws, joint);
    (-(rotation * force), -(rotation * moment))
}

/// A [`SagLaw`] as an effect.
#[derive(Clone, Debug)]
pub(crate) struct Sagging<L> {
    pub law: L,
    pub arm: Arm,
}

/// The arm at one instant, in vectors with one number per joint.
#[derive(Clone, Debug)]
struct Instant {
    workspace: Workspace,
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    tau: Vec<f64>,
}

impl Instant {
    fn new(arm: &Arm) -> Instant {
        let [q, v, a, tau] = std::array::from_fn(|_| vec![0.0; arm.dof()]);
        Instant { workspace: Workspace::new(arm), q, v, a, tau }
    }

    fn sag(&mut self, law: &impl SagLaw, arm: &Arm) -> Sag {
        rnea(arm, &mut self.workspace, &self.q, &self.v, &self.a, &mut self.tau);
        law.sag(arm, &self.workspace)
    }

    /// Displacement of the tool by `sag`, m, world axes.
    fn tool(&self, sag: &Sag, arm: &Arm) -> Vector3<f64> {
        sag.at((self.workspace.link_pose(arm.dof() - 1) * arm.tool()).translation.vector)
    }

    /// Additional torque of each joint's drive for `sag`, N·m (N).
    fn load(&mut self, sag: &Sag, arm: &Arm) -> &[f64] {
        sag.load(arm, &self.workspace, &mut self.tau);
        &self.tau
    }
}

impl<L: SagLaw> Sagging<L> {
    /// Calls `each` with every point of the motion of `scene`, the arm there and its deflection.
    fn along(&self, scene: &Scene, mut each: impl FnMut(usize, &mut Instant, &Sag)) {
        let mut now = Instant::new(&scene.arm);
        for point in 0..scene.motion.len() {
            scene.motion.at(point, &mut now.q, &mut now.v, &mut now.a);
            let sag = now.sag(&self.law, &scene.arm);
            each(point, &mut now, &sag);
        }
    }
}

impl<L: SagLaw> Effect for Sagging<L> {
    fn torque(&self, scene: &Scene, torque: &mut Columns) {
        self.along(scene, |point, now, sag| take_load(now.load(sag, &scene.arm), point, torque));
    }

    fn displace(&self, scene: &Scene, tool: &mut Columns) {
        self.along(scene, |point, now, sag| move_tool(now.tool(sag, &scene.arm), point, tool));
    }

    fn apply(&self, scene: &Scene, change: &mut Change) {
        self.along(scene, |point, now, sag| {
            take_load(now.load(sag, &scene.arm), point, &mut change.torque);
            move_tool(now.tool(sag, &scene.arm), point, &mut change.tool);
        });
    }

    fn inject(&self, injection: &mut Injection) {
        let now = Instant::new(&self.arm);
        injection.drives.push(Box::new(Loaded { of: self.clone(), now: now.clone() }));
        injection.tool.push(Box::new(Sunk { of: self.clone(), now, begun: false }));
    }

    fn export_elements(&self, _: &mut Vec<Element>) -> ExportCoverage {
        ExportCoverage::Never(
            "the deflection follows the load at once, and elastic parts of other tools oscillate",
        )
    }
}

/// Subtracts the additional `load` of each joint from its torque at `point`.
fn take_load(load: &[f64], point: usize, torque: &mut Columns) {
    load.iter().enumerate().for_each(|(joint, load)| torque[joint][point] -= load);
}

/// Displaces the tool at `point` by `off`.
fn move_tool(off: Vector3<f64>, point: usize, tool: &mut Columns) {
    off.iter().enumerate().for_each(|(axis, off)| tool[axis][point] += off);
}

/// The load on the drives of a plant.
#[derive(Clone, Debug)]
struct Loaded<L> {
    of: Sagging<L>,
    now: Instant,
}

impl<L: SagLaw> DriveLaw for Loaded<L> {
    fn act(&mut self, state: &DriveState, torque: &mut [f64]) {
        let now = &mut self.now;
        now.q.copy_from_slice(state.q);
        now.v.copy_from_slice(state.v);
        // The acceleration is one sub-step old: the deflection is some millimetres, so that its effect on the acceleration is small beside
        // the arm's own.
        now.a.copy_from_slice(state.a);
        let sag = now.sag(&self.of.law, &self.of.arm);
        let load = now.load(&sag, &self.of.arm);
        torque.iter_mut().zip(load).for_each(|(torque, load)| *torque += load);
    }

    fn transfer_state(&mut self, _: &mut Archive) {}
}

/// The sag of the tool of a plant.
#[derive(Clone, Debug)]
struct Sunk<L> {
    of: Sagging<L>,
    now: Instant,
    begun: bool,
}

impl<L: SagLaw> SensorLaw for Sunk<L> {
    fn read(&mut self, readings: &mut Readings) {
        let now = &mut self.now;
        for (joint, v) in readings.v.iter().enumerate() {
            now.a[joint] = if self.begun { (v - now.v[joint]) / readings.period } else { 0.0 };
        }
        now.q.copy_from_slice(readings.q);
        now.v.copy_from_slice(readings.v);
        self.begun = true;
        let sag = now.sag(&self.of.law, &self.of.arm);
        let off = now.tool(&sag, &self.of.arm);
        readings.tool.iter_mut().zip(off.iter()).for_each(|(tool, off)| *tool += off);
    }

    fn restart(&mut self) {
        self.begun = false;
    }

    fn transfer_state(&mut self, archive: &mut Archive) {
        archive.flag(&mut self.begun);
        archive.reals(&mut self.now.v);
    }
}

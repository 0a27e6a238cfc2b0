//! Laws that move the tool by what the arm weighs and how it accelerates at the instant.

use std::fmt::Debug;

use freeplay_arm::export::Element;
use freeplay_arm::{Arm, Workspace, joint_reaction, rnea};
use nalgebra::Vector3;

use crate::archive::Archive;
use crate::columns::Columns;
use crate::effect::{Effect, Expressed};
use crate::injection::{Injection, Readings, SensorLaw};
use crate::scene::Scene;

/// How far something gives under the arm.
pub(crate) trait SagLaw: Debug + Copy + Send + Sync + 'static {
    /// How far the tool is off, base frame, m; `ws` holds the poses and reactions of `arm` at the instant.
    fn sag(&self, arm: &Arm, ws: &Workspace) -> Vector3<f64>;
}

/// Force and moment about its origin with which the link of `joint` and all beyond it press on what carries them, base frame, N and N·m.
pub(crate) fn pressure(ws: &Workspace, joint: usize) -> (Vector3<f64>, Vector3<f64>) {
    let rotation = ws.link_pose(joint).rotation;
    let (force, moment) = joint_reaction(ws, joint);
    (-(rotation * force), -(rotation * moment))
}

/// A [`SagLaw`] as an effect. The plant adds the sag to what the tracker reads.
#[derive(Clone, Debug)]
pub(crate) struct Sagging<L> {
    pub law: L,
    pub arm: Arm,
}

/// The arm at one instant, in vectors of one number a joint.
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

    fn sag(&mut self, law: &impl SagLaw, arm: &Arm) -> Vector3<f64> {
        rnea(arm, &mut self.workspace, &self.q, &self.v, &self.a, &mut self.tau);
        law.sag(arm, &self.workspace)
    }
}

impl<L: SagLaw> Effect for Sagging<L> {
    fn displace(&self, scene: &Scene, tool: &mut Columns) {
        let mut now = Instant::new(&scene.arm);
        for point in 0..scene.motion.len() {
            scene.motion.at(point, &mut now.q, &mut now.v, &mut now.a);
            let sag = now.sag(&self.law, &scene.arm);
            sag.iter().enumerate().for_each(|(axis, sag)| tool[axis][point] += sag);
        }
    }

    fn inject(&self, injection: &mut Injection) {
        let now = Instant::new(&self.arm);
        injection.tool.push(Box::new(Sunk { of: self.clone(), now, begun: false }));
    }

    fn express(&self, _: &mut Vec<Element>) -> Expressed {
        Expressed::Never("it follows the load at once, and what gives way in other tools swings")
    }
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
        readings.tool.iter_mut().zip(sag.iter()).for_each(|(tool, sag)| *tool += sag);
    }

    fn restart(&mut self) {
        self.begun = false;
    }

    fn transfer(&mut self, archive: &mut Archive) {
        archive.flag(&mut self.begun);
        archive.reals(&mut self.now.v);
    }
}

//! From the true arm and its effects to the machine's [`Plan`].

use freeplay_arm::{Arm, Joint};
use nalgebra::Vector3;

use super::bristles::Bristles;
use super::cable::Cable;
use super::chain::{Chain, Role, chain_of};
use super::drive::{Drive, Notch, Wave, steepest_pull};
use super::dry_bearing::DryBearing;
use super::film::OilBearing;
use super::plan::{Bearing, BearingLaw, Encoder, Plan, PlanError, SensorDynamics, Shaft, Spring, ToolForce};
use super::run::LONG_STEP;
use super::transmission::Transmission;
use crate::arms::Load;
use crate::data_sheet_deviations::DataSheetDeviations;
use crate::effective_inertia::EffectiveInertia;
use crate::physics::{Effect, Physics};

/// Share of a joint's inertia on the motor side of its transmission if the data sheet names no rotor.
const ROTOR_SHARE: f64 = 0.4;
/// Largest phase of the fastest oscillation per short step, rad; 2 would be the limit of stability.
const PHASE_PER_STEP: f64 = 0.3;
/// Longest short step with oil in a bearing, s: the film changes as fast as the journal moves through it.
const OIL_STEP: f64 = 25e-6;

impl Plan {
    /// The machine of the arm `sheet` with its load, its `deviations` from the data sheet and its `effects`; `poses` are its working poses.
    ///
    /// # Errors
    /// [`PlanError::Seat`] for an effect at an impossible place, [`PlanError::Arm`].
    pub fn new(
        sheet: &Arm,
        load: &Load,
        deviations: &DataSheetDeviations,
        effects: &[Effect],
        poses: &[Vec<f64>],
    ) -> Result<Plan, PlanError> {
        let arm = deviations.apply(sheet)?;
        let chain = chain_of(&arm, load, effects, poses)?;
        let inertias = least_effective_inertia(&arm, poses);
        let joints: Vec<Joint> = chain.links.iter().map(|(joint, _)| joint.clone()).collect();
        let extended = Arm::new(arm.name(), joints.clone(), chain.tool, chain.gravity)?;
        let after = match &chain.drop {
            None => None,
            Some((inertia, at)) => {
                let mut joints = joints;
                joints[chain.place(arm.dof() - 1)].inertia = *inertia;
                Some((*at, Arm::new(arm.name(), joints, chain.tool, chain.gravity)?))
            }
        };
        let link: Vec<usize> = (0..arm.dof()).map(|i| chain.place(i)).collect();
        let mut plan = Plan {
            arm: extended,
            after,
            motor: link.clone(),
            tool_link: link[arm.dof() - 1],
            tool: chain.tool,
            drives: arm.joints().iter().map(nominal_drive).collect(),
            encoders: deviations.zero.iter().map(|&zero| Encoder { zero, ..Encoder::default() }).collect(),
            bristles: vec![None; arm.dof()],
            cables: vec![None; arm.dof()],
            transmissions: Vec::new(),
            springs: chain.springs(),
            bearings: Vec::new(),
            inertia: Vec::new(),
            shafts: Vec::new(),
            push: None,
            sensor_dynamics: SensorDynamics {
                torque_delay: 0.0,
                tool_delay: 0.0,
                cutoff: vec![f64::INFINITY; arm.dof()],
            },
            substeps: 1,
            link,
        };
        for effect in effects {
            plan.transmission(effect, &arm, &inertias);
        }
        for effect in effects {
            plan.at_drive(effect);
            plan.at_bearing(effect, &chain);
            plan.at_sensors(effect);
            plan.beside(effect, &arm, &inertias)?;
        }
        plan.substeps = plan.short_steps(poses, &inertias);
        Ok(plan)
    }

    /// Applies an effect at the transmission of its joint.
    fn transmission(&mut self, effect: &Effect, arm: &Arm, inertias: &[f64]) {
        let Some(joint) = effect.joint else { return };
        let named = arm.joints()[joint].rotor_inertia;
        let rotor = if named > 0.0 { named } else { ROTOR_SHARE * inertias[joint] };
        let (gap, stiffness, damping) = match effect.physics {
            // Damping in s/rad: an impact at 0.1 rad/s loses a tenth to a half of its speed.
            Physics::Backlash { gap, stiffness } => (gap, stiffness, 3.0),
            Physics::JointElasticity { stiffness, damping } => (0.0, stiffness, damping),
            _ => return,
        };
        if let Some(there) = self.transmissions.iter_mut().find(|t| t.joint == joint) {
            // Both at one joint: the gap, then the two springs in series.
            there.gap = there.gap.max(gap);
            there.stiffness = there.stiffness * stiffness / (there.stiffness + stiffness);
            return;
        }
        self.motor[joint] = self.arm.dof() + self.transmissions.len();
        self.transmissions.push(Transmission { joint, rotor, gap, stiffness, damping });
        self.inertia.push((self.link[joint], self.link[joint], -rotor));
        self.inertia.push((self.motor[joint], self.motor[joint], rotor));
    }

    /// Applies an effect on friction or torque of a drive.
    fn at_drive(&mut self, effect: &Effect) {
        let Some(joint) = effect.joint else { return };
        let drive = &mut self.drives[joint];
        let wave = |amplitude, periods, phase| Some(Wave { amplitude, periods, phase });
        match effect.physics {
            Physics::CoulombFriction { coulomb } => drive.dry.iter_mut().for_each(|f| *f += coulomb),
            Physics::ViscousFriction { viscous } => drive.viscous += viscous,
            Physics::StribeckFriction { extra, velocity } => drive.stribeck = Some((extra, velocity)),
            Physics::AsymmetricFriction { positive, negative } => {
                drive.dry[0] += positive;
                drive.dry[1] += negative;
            }
            Physics::LoadDependentFriction { coefficient } => drive.load = coefficient,
            Physics::PositionDependentFriction { amplitude, periods, phase } => {
                drive.uneven = wave(amplitude, periods, phase);
            }
            Physics::TorqueRipple { amplitude, periods, phase } => {
                drive.ripple = wave(amplitude, periods, phase)
            }
            Physics::FrictionDrift { amount, time_constant } => drive.drift = Some((amount, time_constant)),
            Physics::QuadraticDrag { coefficient } => drive.drag = coefficient,
            Physics::ActuatorSaturation { limit } => drive.limit = limit,
            Physics::TorqueGain { gain } => drive.gain = gain,
            Physics::TorqueOffset { offset } => drive.offset = offset,
            Physics::PeriodicDisturbance { amplitude, frequency } => {
                drive.disturbance = Some((amplitude, frequency))
            }
            Physics::MagneticDetent { amplitude, position, width } => {
                drive.detent = Some(Notch { amplitude, position, width, pitch: f64::INFINITY });
            }
            Physics::BrokenTooth { amplitude, turns, width } => {
                let pitch = std::f64::consts::TAU / turns;
                drive.tooth = Some(Notch { amplitude, position: 0.0, width: width * pitch, pitch });
            }
            Physics::PreslidingFriction { stiffness, damping } => {
                self.bristles[joint] = Some(Bristles { stiffness, damping });
            }
            Physics::CableStickSlip { stiffness, stick, slip } => {
                self.cables[joint] = Some(Cable { stiffness, stick, slip });
            }
            _ => {}
        }
    }

    /// Applies an effect at the bearing of a joint: a free journal.
    fn at_bearing(&mut self, effect: &Effect, chain: &Chain) {
        let Some(joint) = effect.joint else { return };
        let law = match effect.physics {
            Physics::JointClearance { clearance, stiffness, restitution, friction } => {
                BearingLaw::Dry(DryBearing::new(clearance, stiffness, restitution, friction))
            }
            Physics::LubricatedClearance { clearance, viscosity } => {
                BearingLaw::Oil(OilBearing::new(clearance, viscosity))
            }
            _ => return,
        };
        if let Some(slides) = chain.links.iter().position(|(_, role)| *role == Role::Slide(joint)) {
            self.bearings.push(Bearing { slides, turn: self.link[joint], law });
        }
    }

    /// Applies an effect on the measurements.
    fn at_sensors(&mut self, effect: &Effect) {
        match effect.physics {
            Physics::TimeDelay { delay, channel: "tool" } => self.sensor_dynamics.tool_delay = delay,
            Physics::TimeDelay { delay, .. } => self.sensor_dynamics.torque_delay = delay,
            _ => {}
        }
        let Some(joint) = effect.joint else { return };
        let encoder = &mut self.encoders[joint];
        match effect.physics {
            Physics::EncoderOffset { offset } => encoder.zero += offset,
            Physics::EncoderEccentricity { amplitude, phase } => {
                encoder.eccentricity = Some((amplitude, phase))
            }
            Physics::EncoderSlip { jump, at } => encoder.slip = Some((jump, at)),
            Physics::SensorLowpass { cutoff } => self.sensor_dynamics.cutoff[joint] = cutoff,
            _ => {}
        }
    }

    /// Applies an effect that adds inertia, springs or forces to the arm.
    fn beside(&mut self, effect: &Effect, arm: &Arm, inertias: &[f64]) -> Result<(), PlanError> {
        match (&effect.physics, effect.joint) {
            (Physics::ExternalForce { force, start, end }, _) => {
                let force = Vector3::from(*force);
                self.push = Some(ToolForce { force, start: *start, end: *end });
            }
            (Physics::RotorInertia { inertia }, Some(joint)) => {
                self.inertia.push((self.motor[joint], self.motor[joint], *inertia));
            }
            (Physics::JointSpring { stiffness, rest }, Some(joint)) => {
                let coordinate = self.link[joint];
                self.springs.push(Spring { coordinate, stiffness: *stiffness, damping: 0.0, rest: *rest });
            }
            (Physics::JointCoupling { with, inertia, viscous, coulomb, sign }, Some(joint)) => {
                let why = "the other joint is not in the arm";
                let seat = || PlanError::Seat { kind: effect.physics.kind(), joint: effect.joint, why };
                let other = arm.joint_index(with).ok_or_else(seat)?;
                let (i, j) = (self.motor[joint], self.motor[other]);
                let inertia = inertia.min(0.5 * inertias[other]);
                self.inertia.extend([(i, i, inertia), (j, j, inertia * sign * sign)]);
                self.inertia.extend([(i, j, sign * inertia), (j, i, sign * inertia)]);
                self.shafts.push(Shaft {
                    joint,
                    with: other,
                    sign: *sign,
                    viscous: *viscous,
                    coulomb: *coulomb,
                });
            }
            _ => {}
        }
        Ok(())
    }

    /// Number of short steps per long step that the fastest oscillation needs.
    fn short_steps(&self, poses: &[Vec<f64>], inertias: &[f64]) -> usize {
        let mut fastest = 0.0_f64;
        for t in &self.transmissions {
            let link = inertias[t.joint] - t.rotor;
            fastest = fastest.max((t.stiffness * (1.0 / t.rotor + 1.0 / link)).sqrt());
        }
        for (joint, inertia) in inertias.iter().enumerate() {
            if let Some(bristles) = &self.bristles[joint] {
                fastest =
                    fastest.max((bristles.stiffness / inertia).sqrt()).max(bristles.damping / inertia / 0.5);
            }
            if let Some(detent) = &self.drives[joint].detent {
                let slope = steepest_pull() * detent.amplitude / detent.width;
                fastest = fastest.max((slope / inertia).sqrt());
            }
        }
        for spring in &self.springs {
            let lightest = lightest(&self.arm, &self.link, &[spring.coordinate], poses);
            let (swings, fades) = ((spring.stiffness / lightest).sqrt(), spring.damping / lightest / 0.5);
            fastest = fastest.max(swings).max(fades);
        }
        let mut shortest = LONG_STEP;
        for bearing in &self.bearings {
            match &bearing.law {
                BearingLaw::Oil(_) => shortest = OIL_STEP,
                BearingLaw::Dry(law) => {
                    let journal = [bearing.slides, bearing.slides + 1];
                    let lightest = lightest(&self.arm, &self.link, &journal, poses);
                    fastest = fastest.max((law.slope() / lightest).sqrt());
                }
            }
        }
        shortest = shortest.min(PHASE_PER_STEP / fastest.max(1.0));
        (LONG_STEP / shortest).ceil() as usize
    }
}

fn nominal_drive(joint: &Joint) -> Drive {
    Drive {
        viscous: joint.friction.viscous,
        dry: [joint.friction.coulomb; 2],
        limit: f64::INFINITY,
        gain: 1.0,
        ..Drive::default()
    }
}

/// The least effective inertia of each joint over `poses`.
fn least_effective_inertia(arm: &Arm, poses: &[Vec<f64>]) -> Vec<f64> {
    let mut effective = EffectiveInertia::new(arm);
    let all = poses.iter().filter_map(|pose| effective.at(arm, pose));
    all.fold(vec![f64::INFINITY; arm.dof()], |least, inertias| {
        least.iter().zip(inertias).map(|(least, inertia)| least.min(inertia)).collect()
    })
}

/// The least effective inertia of any of `coordinates` over `poses` of the joints, kg or kg·m².
fn lightest(arm: &Arm, link: &[usize], coordinates: &[usize], poses: &[Vec<f64>]) -> f64 {
    let places = poses.iter().map(|pose| {
        let mut q = vec![0.0; arm.dof()];
        link.iter().zip(pose).for_each(|(&place, position)| q[place] = *position);
        q
    });
    let least = least_effective_inertia(arm, &places.collect::<Vec<_>>());
    coordinates.iter().map(|&at| least[at]).fold(f64::INFINITY, f64::min)
}

//! Abilities and limits of the acceleration programme with a contact row at a corner: rollouts of the true model through a corner of the
//! sharp square (c = 0.6 mm), one for each control strategy.
//!
//! `cargo run --release --workspace --example contact_row`
//!
//! In every tick the joints get exactly the wanted accelerations: the reference with its correction, plus feedback. `rows` first passes
//! them through [`AccelerationProgramme`] with the true position of the journal, which is the best case for the programme.

use std::error::Error;

use freeplay_arm::{Arm, Workspace, forward_kinematics, jacobian};
use freeplay_controller::acceleration_programme::Wanted;
use freeplay_controller::displacement_preview::DisplacementPreview;
use freeplay_controller::{
    AccelerationOptions, AccelerationProgramme, CornerSearch, Correction, Driven, Motion, PassageOptions,
    Passages, QuasiStatic, Rollout, Weights,
};
use freeplay_laws::{ArmWithPlay, Clearance, ClearanceTable};
use freeplay_model::paper_arm;
use freeplay_path::{JointPath, PathKind, PathSpec};
use nalgebra::{DMatrix, DVector, Vector3, Vector6};

const PERIOD: f64 = 1e-3;
/// Time from the blend of the correction to the start of the rollout, and the rolled-out and evaluated times before and after a corner,
/// ticks.
const LEAD_IN: u64 = 400;
const BEFORE: u64 = 100;
const AFTER: u64 = 200;
/// Natural frequency of the feedback, rad/s; damping ratio 1.
const NATURAL_FREQUENCY: f64 = 50.0;
/// A row is active if its slack is above this, N.
const BINDING: f64 = 0.01;

/// The corrected motion at one tick: position, velocity, acceleration to hold.
type Row = [[f64; 6]; 3];

struct Scene {
    arm: Arm,
    play: ArmWithPlay,
    path: JointPath,
    corner: u64,
}

/// Results of a rollout.
#[derive(Default)]
struct Found {
    squares: f64,
    greatest: f64,
    binding: u32,
    off: f64,
    landings: u32,
    flight: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    println!(
        "{:<7} {:<44} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}",
        "T [s]",
        "way through the corner",
        "RMS mm",
        "max mm",
        "row binds",
        "joints mm",
        "landings",
        "flight ms"
    );
    for period in [6.0, 12.0] {
        let arm = paper_arm().arm;
        let play = ArmWithPlay::new(&arm, &[(4, Clearance::new(&ClearanceTable::new(6e-4))?)])?;
        let spec = PathSpec { kind: PathKind::SquareSharp, period, ..PathSpec::default() };
        let path = JointPath::plan(&arm, &spec, 1.0 / PERIOD)?;
        let corner = (period / 4.0 / PERIOD).round() as u64;
        let scene = Scene { arm, play, path, corner };
        let none = Passages::default();
        let planned = scene.passages();
        let plain = AccelerationOptions::default();
        let loose = AccelerationOptions { turning: 1e3, ..plain };
        let firm = AccelerationOptions { slack: 1e4, ..plain };
        let ways = [
            ("quasi-static correction", &none, None),
            ("the same, contact and turning row", &none, Some(plain)),
            ("the same, contact row alone", &none, Some(loose)),
            ("the same, both rows, slack 100 times dearer", &none, Some(firm)),
            ("planned passage", &planned, None),
            ("planned passage, contact and turning row", &planned, Some(plain)),
        ];
        for (name, passages, options) in ways {
            let found = scene.roll(&scene.course(passages)?, options)?;
            println!(
                "{period:<7} {name:<44} {:>9.4} {:>9.4} {:>9} {:>9.4} {:>9} {:>9.1}",
                (found.squares / (BEFORE + AFTER) as f64).sqrt(),
                found.greatest,
                found.binding,
                found.off,
                found.landings,
                1e3 * found.flight
            );
        }
    }
    Ok(())
}

impl Scene {
    fn outlook(&self) -> DisplacementPreview {
        DisplacementPreview::new(self.path.clone(), &self.play, PERIOD, 10)
    }

    fn first(&self) -> u64 {
        self.corner - BEFORE
    }

    fn passages(&self) -> Passages {
        let (weights, options) = (Weights::default(), PassageOptions::default());
        let search = CornerSearch { arm: &self.arm, with_play: &self.play, period: PERIOD, weights, options };
        search.passages(&mut self.outlook(), self.first() - 100, self.corner + AFTER)
    }

    fn reference(&self, tick: u64) -> Row {
        let mut row = [[0.0; 6]; 3];
        let [q, v, a] = &mut row;
        self.path.at(tick as f64 * PERIOD, q, v, a);
        row
    }

    /// The corrected motion from the tick `first` on, through `passages` if there are any.
    fn course(&self, passages: &Passages) -> Result<Vec<Row>, Box<dyn Error>> {
        let mut correction = Correction::new(&self.arm, PERIOD, 0.3, &Weights::default())?;
        correction.start(&[0.0; 6], &[0.0; 6]);
        let (mut outlook, mut physics) = (self.outlook(), QuasiStatic::new(&self.play, PERIOD));
        let mut course = Vec::new();
        for ahead in self.first() - LEAD_IN..=self.corner + AFTER + 2 {
            let [q, v, a] = self.reference(ahead);
            let desired = Motion { q: &q, v: &v, a: &a };
            match passages.at(ahead) {
                Some(step) => {
                    correction.follow(&self.arm, desired, step.corrections, &Vector3::zeros());
                }
                None => {
                    let deviation = physics.deviation_with(&q, outlook.at(ahead));
                    correction.advance(&self.arm, desired, &deviation);
                }
            }
            if ahead < self.first() + 2 {
                continue;
            }
            let [from, to] = [ahead - 2, ahead - 1].map(|tick| self.reference(tick));
            let (moved, held) = (correction.motion(), correction.held());
            course.push([
                std::array::from_fn(|i| from[0][i] + moved.q[i]),
                std::array::from_fn(|i| from[1][i] + moved.v[i]),
                std::array::from_fn(|i| (to[1][i] - from[1][i]) / PERIOD + held[i]),
            ]);
        }
        Ok(course)
    }

    /// Rolls the model out along `course`, with the rows of `options` if there are any.
    fn roll(&self, course: &[Row], options: Option<AccelerationOptions>) -> Result<Found, Box<dyn Error>> {
        let mut programme = options
            .map(|options| AccelerationProgramme::new(&self.arm, &self.play, PERIOD, options))
            .transpose()?;
        let mut rollout = Rollout::new(&self.play, PERIOD);
        let [q, v, a] = &course[0];
        let journals = self.outlook().at(self.first()).to_vec();
        let resting = Motion { q: &journals, v: &[0.0; 2], a: &[0.0; 2] };
        rollout.start(Motion { q, v, a }, resting);
        let mut found = Found::default();
        for (tick, row) in (self.first()..).zip(course) {
            self.take(tick, row, &rollout, &mut found);
            let mut wanted = self.feedback(row, &rollout);
            if let Some(programme) = &mut programme {
                found.binding += u32::from(self.guarded(programme, &rollout, &mut wanted));
            }
            rollout.tick(Driven::Acceleration(&wanted));
        }
        (found.landings, found.flight) = (rollout.touches()[0].landings, rollout.touches()[0].flight);
        Ok(found)
    }

    fn joints(&self, extended: &[f64]) -> [f64; 6] {
        let mut joints = [0.0; 6];
        self.play.gather(extended, &mut joints);
        joints
    }

    /// The accelerations of the feedback towards `row`.
    fn feedback(&self, [q, v, a]: &Row, rollout: &Rollout) -> [f64; 6] {
        let (at, speed) = (self.joints(rollout.q()), self.joints(rollout.v()));
        std::array::from_fn(|i| {
            a[i] + 2.0 * NATURAL_FREQUENCY * (v[i] - speed[i])
                + NATURAL_FREQUENCY * NATURAL_FREQUENCY * (q[i] - at[i])
        })
    }

    /// Passes `wanted` through `programme`; returns true if its contact row was active.
    fn guarded(
        &self,
        programme: &mut AccelerationProgramme,
        rollout: &Rollout,
        wanted: &mut [f64; 6],
    ) -> bool {
        let (q, v) = (self.joints(rollout.q()), self.joints(rollout.v()));
        let slides = self.play.plays()[0].slides;
        let [place, speed] = [rollout.q(), rollout.v()].map(|of| slides.map(|slide| of[slide]));
        let far = place[0].hypot(place[1]).max(f64::MIN_POSITIVE);
        let mut tool = DMatrix::zeros(6, 6);
        jacobian(&self.arm, &mut Workspace::new(&self.arm), &q, &mut tool);
        let moved = &tool * DVector::from_row_slice(wanted);
        programme.solve(
            Motion { q: &q, v: &v, a: &[0.0; 6] },
            Motion { q: &place, v: &speed, a: &[0.0; 2] },
            &place.map(|along| along / far),
            &[0.0; 6],
            &Wanted { jacobian: &tool, tool: &Vector6::from_column_slice(moved.as_slice()), joints: wanted },
        );
        wanted.copy_from_slice(programme.accelerations());
        10.0 * programme.solution()[6] > BINDING
    }

    /// Adds the tool's deviation and the deviation of the joints alone from the corrected path to `found`, mm at the tool.
    fn take(&self, tick: u64, [q, ..]: &Row, rollout: &Rollout, found: &mut Found) {
        let (mut nominal, mut extended) = (Workspace::new(&self.arm), Workspace::new(self.play.arm()));
        let tool = forward_kinematics(self.play.arm(), &mut extended, rollout.q()).translation.vector;
        let [desired, _, _] = self.reference(tick);
        let mut place = |q: &[f64]| forward_kinematics(&self.arm, &mut nominal, q).translation.vector;
        let off = 1e3 * (tool - place(&desired)).norm();
        found.squares += off * off;
        found.greatest = found.greatest.max(off);
        found.off = found.off.max(1e3 * (place(&self.joints(rollout.q())) - place(q)).norm());
    }
}

//! Predicts the recording of an arm with effects from the motion of its encoders.

use std::cell::OnceCell;
use std::fmt::Debug;
use std::ops::Deref;
use std::rc::Rc;

use freeplay_arm::Arm;

use crate::arm_parts::ArmParts;
use crate::columns::Columns;
use crate::effect::Effect;
use crate::kind::Kind;
use crate::prediction::{Change, Prediction};
use crate::scene::{
    Scene, rigid_torques, rotor_torques, tool_positions, tool_sensitivity, torque_sensitivity,
};
use crate::trajectory::Trajectory;
use crate::{DriveFriction, LawError, Placed};

/// The low-pass filter of a measured column, applied to one column of the trajectory's points.
pub type LowPassFilter<'a> = dyn Fn(&[f64]) -> Vec<f64> + 'a;

/// Predicts the recording of `motion` by `arm` with `effects`. Laws that jump pass through `low_pass`, as the measurement did.
///
/// # Errors
/// [`LawError::Changed`] if an effect makes the arm impossible.
pub fn predict(
    arm: &Arm,
    effects: &[Placed],
    motion: &Trajectory,
    low_pass: &LowPassFilter,
) -> Result<Prediction, LawError> {
    let effects: Vec<&Placed> = effects.iter().collect();
    Baseline::new(arm, &effects, motion, low_pass).map(|baseline| baseline.measured)
}

/// `arm` with the effects that change it.
///
/// # Errors
/// [`LawError::Changed`] if an effect makes the arm impossible.
pub fn changed<'a>(arm: &Arm, effects: impl IntoIterator<Item = &'a Placed>) -> Result<Arm, LawError> {
    let mut parts = ArmParts::of(arm);
    for placed in effects {
        placed.effect.arm(&mut parts)?;
    }
    parts.into_arm(arm.name())
}

/// A prediction with its inputs; it computes the changes of the prediction by further effects.
pub struct Baseline<'a> {
    nominal: &'a Arm,
    effects: Vec<Held<'a>>,
    low_pass: &'a LowPassFilter<'a>,
    /// Difference between the machine and the low-passed `motion`, which hides parts of the machine's motion.
    hidden: Option<&'a Change>,
    scene: Rc<Scene<'a>>,
    shift: Vec<Vec<f64>>,
    /// Before the sensors.
    plain: Prediction,
    measured: Prediction,
    /// Sensitivity of the torques to a small shift of each link: `[moved joint][joint][point]`.
    torque_sensitivity: OnceCell<Vec<Vec<Vec<f64>>>>,
    /// The same of the tool: `[moved joint][axis][point]`.
    tool_sensitivity: OnceCell<Vec<[Vec<f64>; 3]>>,
}

/// An effect that is borrowed, or shared by several owners.
#[derive(Clone)]
enum Held<'a> {
    Lent(&'a Placed),
    Shared(Rc<Placed>),
}

impl Deref for Held<'_> {
    type Target = Placed;

    fn deref(&self) -> &Placed {
        match self {
            Held::Lent(placed) => placed,
            Held::Shared(placed) => placed,
        }
    }
}

impl Debug for Baseline<'_> {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (arm, points) = (self.scene.arm.name(), self.scene.motion.len());
        formatter.debug_struct("Baseline").field("arm", &arm).field("points", &points).finish_non_exhaustive()
    }
}

impl<'a> Baseline<'a> {
    /// The prediction for `arm` with `effects` along `motion`.
    ///
    /// # Errors
    /// [`LawError::Changed`] if an effect makes the arm impossible.
    pub fn new(
        arm: &'a Arm,
        effects: &[&'a Placed],
        motion: &'a Trajectory,
        low_pass: &'a LowPassFilter<'a>,
    ) -> Result<Baseline<'a>, LawError> {
        Self::with_hidden(arm, effects, motion, low_pass, None)
    }

    /// The same for a machine whose measurements differ from the prediction for `motion` by `hidden`: a low-pass has smoothed the motion
    /// and hides the machine's motion in its corners. The sensors measure this part, too.
    ///
    /// # Errors
    /// [`LawError::Changed`] if an effect makes the arm impossible.
    pub fn with_hidden(
        arm: &'a Arm,
        effects: &[&'a Placed],
        motion: &'a Trajectory,
        low_pass: &'a LowPassFilter<'a>,
        hidden: Option<&'a Change>,
    ) -> Result<Baseline<'a>, LawError> {
        let effects = effects.iter().map(|placed| Held::Lent(placed)).collect();
        Self::holding(arm, effects, motion, low_pass, hidden)
    }

    fn holding(
        arm: &'a Arm,
        effects: Vec<Held<'a>>,
        motion: &'a Trajectory,
        low_pass: &'a LowPassFilter<'a>,
        hidden: Option<&'a Change>,
    ) -> Result<Baseline<'a>, LawError> {
        let scene = Scene::new(changed(arm, effects.iter().map(|held| &**held))?, motion);
        let arm_now = &scene.arm;
        let mut shift = vec![vec![0.0; motion.len()]; arm.dof()];
        let (mut smooth, mut torque) = (shift.clone(), shift.clone());
        let mut tool = vec![vec![0.0; motion.len()]; 3];
        for placed in &effects {
            let shifts = if placed.kind.rough { &mut shift } else { &mut smooth };
            add_contribution(placed, low_pass, shifts, |effect, shift| effect.shift(&scene, shift));
            add_contribution(placed, low_pass, &mut torque, |effect, torque| effect.torque(&scene, torque));
            add_contribution(placed, low_pass, &mut tool, |effect, tool| effect.displace(&scene, tool));
        }
        let mut total = link_torques(&scene, &smooth, &shift);
        add(&mut total, &rotor_torques(arm_now, motion));
        add(&mut shift, &smooth);
        let friction = nominal_friction(&scene, low_pass);
        add(&mut total, &friction);
        add(&mut total, &torque);
        let link: Vec<Vec<f64>> = motion.q.iter().zip(&shift).map(|(q, shift)| sum(q, shift)).collect();
        let mut positions = tool_positions(arm_now, &link);
        add(&mut positions, &tool);
        let tool = <[Vec<f64>; 3]>::try_from(positions).unwrap_or_default();
        let mut plain = Prediction { torque: total, friction, tool, link };
        hidden.into_iter().for_each(|hidden| plain.add(hidden));
        Ok(Self::read(arm, effects, (low_pass, hidden), Rc::new(scene), shift, plain))
    }

    /// The baseline whose prediction before the sensors is `plain`.
    fn read(
        nominal: &'a Arm,
        effects: Vec<Held<'a>>,
        (low_pass, hidden): (&'a LowPassFilter<'a>, Option<&'a Change>),
        scene: Rc<Scene<'a>>,
        shift: Vec<Vec<f64>>,
        plain: Prediction,
    ) -> Baseline<'a> {
        let mut measured = plain.clone();
        effects.iter().for_each(|placed| sense(placed, &scene, low_pass, &mut measured));
        let (torque_sensitivity, tool_sensitivity) = (OnceCell::new(), OnceCell::new());
        Baseline {
            nominal,
            effects,
            low_pass,
            hidden,
            scene,
            shift,
            plain,
            measured,
            torque_sensitivity,
            tool_sensitivity,
        }
    }

    /// The arm with the effects that change it, its motion and load.
    pub fn scene(&self) -> &Scene<'a> {
        &self.scene
    }

    /// The prediction.
    pub fn prediction(&self) -> &Prediction {
        &self.measured
    }

    /// The prediction of the true torques and positions, before gains, delays and limits of the sensors change them.
    pub fn before_sensors(&self) -> &Prediction {
        &self.plain
    }

    /// Changes `prediction` as the sensors of `placed` do.
    pub fn sense(&self, placed: &Placed, prediction: &mut Prediction) {
        sense(placed, &self.scene, self.low_pass, prediction);
    }

    /// The prediction with `more` effects after the present ones.
    ///
    /// # Errors
    /// [`LawError::Changed`] if they make the arm impossible.
    pub fn with(&self, more: &[&Placed]) -> Result<Prediction, LawError> {
        Ok(self.extended(more)?.measured)
    }

    /// The baseline with `more` effects after the present ones.
    ///
    /// # Errors
    /// [`LawError::Changed`] if they make the arm impossible.
    pub fn extended<'b>(&self, more: &[&'b Placed]) -> Result<Baseline<'b>, LawError>
    where
        'a: 'b,
    {
        self.behind(more.iter().map(|placed| Held::Lent(placed)).collect())
    }

    /// The same with shared effects, so that the caller may keep the baseline.
    ///
    /// # Errors
    /// [`LawError::Changed`] if they make the arm impossible.
    pub fn extended_shared(&self, more: &[Rc<Placed>]) -> Result<Baseline<'a>, LawError> {
        self.behind(more.iter().map(|placed| Held::Shared(Rc::clone(placed))).collect())
    }

    fn behind<'b>(&self, more: Vec<Held<'b>>) -> Result<Baseline<'b>, LawError>
    where
        'a: 'b,
    {
        let is_changed = self.is_changed_by(more.iter().map(|held| &**held))?;
        // For the same arm along the same motion without shifted links, only the contributions of the new effects need computing.
        let changes: Vec<Change> = if is_changed {
            Vec::new()
        } else {
            more.iter().map(|placed| self.filtered(placed.kind, self.contribution(placed))).collect()
        };
        let effects: Vec<Held<'b>> = self.effects.iter().cloned().chain(more).collect();
        if is_changed || changes.iter().any(|change| change.link.all_written().next().is_some()) {
            return self.anew(effects);
        }
        let mut plain = self.plain.clone();
        changes.iter().for_each(|change| plain.add(change));
        let (scene, shift) = (Rc::clone(&self.scene), self.shift.clone());
        Ok(Baseline::read(self.nominal, effects, (self.low_pass, self.hidden), scene, shift, plain))
    }

    /// The prediction with `instead` in place of the effects that `is_out` selects.
    ///
    /// # Errors
    /// [`LawError::Changed`] if it makes the arm impossible.
    pub fn with_replacement(
        &self,
        is_out: &dyn Fn(&Placed) -> bool,
        instead: Option<&Placed>,
    ) -> Result<Prediction, LawError> {
        let stay = self.effects.iter().filter(|held| !is_out(held)).cloned();
        Ok(self.anew(stay.chain(instead.map(Held::Lent)).collect())?.measured)
    }

    /// The baseline of the same machine with `effects`.
    fn anew<'b>(&self, effects: Vec<Held<'b>>) -> Result<Baseline<'b>, LawError>
    where
        'a: 'b,
    {
        Baseline::holding(self.nominal, effects, self.scene.motion, self.low_pass, self.hidden)
    }

    /// True if `more` effects change the arm.
    fn is_changed_by<'b>(&self, mut more: impl Iterator<Item = &'b Placed>) -> Result<bool, LawError> {
        let mut parts = ArmParts::of(&self.scene.arm);
        more.try_for_each(|placed| placed.effect.arm(&mut parts))?;
        Ok(!parts.are_of(&self.scene.arm))
    }

    /// The change of the prediction by `placed`, added to the present effects: exact where it changes the arm or the torque, to first order
    /// where it shifts links (for a shift of 1 mrad the relative error is about 1e-3).
    ///
    /// # Errors
    /// [`LawError::Changed`] if it makes the arm impossible.
    pub fn change(&self, placed: &Placed) -> Result<Change, LawError> {
        if self.is_changed_by(std::iter::once(placed))? {
            let effects = self.effects.iter().cloned().chain([Held::Lent(placed)]).collect();
            return Ok(Change::between(&self.measured, self.anew(effects)?.measured));
        }
        let change = self.plain_change(placed.kind, self.contribution(placed));
        let effects = self.effects.iter().map(|held| &**held).chain([placed]);
        if !effects.clone().any(|placed| placed.effect.measures()) {
            return Ok(change);
        }
        let mut changed = self.plain.clone();
        changed.add(&change);
        effects.for_each(|placed| self.sense(placed, &mut changed));
        Ok(Change::between(&self.measured, changed))
    }

    /// The change of the prediction by `plus` minus that by `minus`, an effect of the same kind: see [`Baseline::change`]. Neither the low-pass nor
    /// the consequences of shifted links are computed for the part that both have.
    ///
    /// # Errors
    /// [`LawError::Changed`] if one of them makes the arm impossible.
    pub fn change_between(&self, minus: &Placed, plus: &Placed) -> Result<Change, LawError> {
        let mut effects = self.effects.iter().map(|held| &**held).chain([minus, plus]);
        let is_measured = effects.any(|placed| placed.effect.measures());
        let changes_arm = |placed| self.is_changed_by(std::iter::once(placed));
        if is_measured || changes_arm(minus)? || changes_arm(plus)? {
            let mut change = self.change(plus)?;
            change.add(&self.change(minus)?, -1.0);
            return Ok(change);
        }
        let mut change = self.contribution(plus);
        change.add(&self.contribution(minus), -1.0);
        change.parts_mut().into_iter().for_each(Columns::release_zeros);
        Ok(self.plain_change(plus.kind, change))
    }

    /// The contribution of an effect that does not change the arm, before the low-pass and without the consequences of its link shifts for torques
    /// and tool.
    fn contribution(&self, placed: &Placed) -> Change {
        let mut change = Change::nothing(self.scene.arm.dof(), self.scene.motion.len());
        placed.effect.apply(&self.scene, &mut change);
        change
    }

    /// The contribution `change` of an effect of `kind`, behind the low-pass if the law is rough.
    fn filtered(&self, kind: &Kind, mut change: Change) -> Change {
        if kind.rough {
            for columns in change.parts_mut() {
                columns.change_written(|column| *column = (self.low_pass)(column));
            }
        }
        change
    }

    /// The change before the sensors by an effect of `kind` that does not change the arm, from its `contribution`: behind the low-pass, with the
    /// consequences of link shifts for torques and tool.
    fn plain_change(&self, kind: &Kind, contribution: Change) -> Change {
        let mut change = self.filtered(kind, contribution);
        let (scene, points) = (&self.scene, self.scene.motion.len());
        for (joint, shift) in change.link.all_written() {
            let sensitivity =
                self.tool_sensitivity.get_or_init(|| tool_sensitivity(&scene.arm, &self.plain.link));
            add_products(&mut change.tool, &sensitivity[joint], shift);
            if kind.rough {
                let sensitivity = self
                    .torque_sensitivity
                    .get_or_init(|| torque_sensitivity(&scene.arm, scene.motion, &self.shift));
                add_products(&mut change.torque, &sensitivity[joint], shift);
            }
        }
        if !kind.rough && change.link.all_written().next().is_some() {
            let mut shift = vec![vec![0.0; points]; scene.arm.dof()];
            change.link.all_written().for_each(|(joint, column)| shift[joint].copy_from_slice(column));
            let mut torque = link_torques(scene, &shift, &vec![vec![0.0; points]; scene.arm.dof()]);
            subtract(&mut torque, &scene.load);
            change.torque.add(&Columns::from(torque), 1.0);
        }
        change
    }
}

/// Torques of the rigid arm on its transmissions with its links shifted, `[joint][point]`, N·m (N). For shifts in `smooth`, velocities and
/// accelerations follow; a shift that jumps counts by its position alone, since a recording of the motor does not contain the impacts of
/// the flanks.
fn link_torques(scene: &Scene, smooth: &[Vec<f64>], jumping: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let any = |shift: &[Vec<f64>]| shift.iter().flatten().any(|&shift| shift != 0.0);
    if !any(smooth) && !any(jumping) {
        return scene.load.clone();
    }
    let links = scene.motion.shifted(smooth);
    let mut torque = rigid_torques(&scene.arm, &links, Some(jumping));
    subtract(&mut torque, &rotor_torques(&scene.arm, &links));
    torque
}

/// Adds the contribution of `placed` to `channels`; filters it first if it jumps.
fn add_contribution(
    placed: &Placed,
    low_pass: &LowPassFilter,
    channels: &mut [Vec<f64>],
    contribute: impl Fn(&dyn Effect, &mut Columns),
) {
    let mut contribution = Columns::zero(channels.len(), channels.first().map_or(0, Vec::len));
    contribute(placed.effect.as_ref(), &mut contribution);
    if placed.kind.rough {
        contribution.change_written(|column| *column = low_pass(column));
    }
    for (index, contribution) in contribution.all_written() {
        channels[index]
            .iter_mut()
            .zip(contribution)
            .for_each(|(channel, contribution)| *channel += contribution);
    }
}

/// Applies the sensors of `placed` to `prediction`; filters the change if the sensors make corners.
fn sense(placed: &Placed, scene: &Scene, low_pass: &LowPassFilter, prediction: &mut Prediction) {
    if !placed.effect.bends() {
        return placed.effect.measure(scene, prediction);
    }
    let before = prediction.clone();
    placed.effect.measure(scene, prediction);
    for (now, before) in prediction.columns_mut().zip(before.columns()).filter(|(now, before)| now != before)
    {
        let change: Vec<f64> = now.iter().zip(before).map(|(now, before)| now - before).collect();
        now.iter_mut()
            .zip(before)
            .zip(low_pass(&change))
            .for_each(|((now, before), change)| *now = before + change);
    }
}

fn add(channels: &mut [Vec<f64>], others: &[Vec<f64>]) {
    for (channel, other) in channels.iter_mut().zip(others) {
        channel.iter_mut().zip(other).for_each(|(channel, other)| *channel += other);
    }
}

fn subtract(channels: &mut [Vec<f64>], others: &[Vec<f64>]) {
    for (channel, other) in channels.iter_mut().zip(others) {
        channel.iter_mut().zip(other).for_each(|(channel, other)| *channel -= other);
    }
}

fn add_products(channels: &mut Columns, sensitivity: &[Vec<f64>], shift: &[f64]) {
    for (index, sensitivity) in sensitivity.iter().enumerate() {
        for ((channel, sensitivity), shift) in channels[index].iter_mut().zip(sensitivity).zip(shift) {
            *channel += sensitivity * shift;
        }
    }
}

fn sum(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}

/// The nominal friction of each joint from the arm file; the jump of its sign passes through `low_pass`.
fn nominal_friction(scene: &Scene, low_pass: &LowPassFilter) -> Vec<Vec<f64>> {
    let joints = scene.arm.joints().iter().zip(&scene.motion.v);
    joints
        .map(|(joint, v)| {
            let nominal = DriveFriction::nominal(joint.friction);
            if nominal.coulomb == 0.0 {
                return v.iter().map(|v| nominal.resisting(*v)).collect();
            }
            let jump = DriveFriction { viscous: 0.0, ..nominal };
            let jump = low_pass(&v.iter().map(|v| jump.resisting(*v)).collect::<Vec<_>>());
            jump.iter().zip(v).map(|(jump, v)| jump + nominal.viscous * v).collect()
        })
        .collect()
}

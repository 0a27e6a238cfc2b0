//! Shifts and torques of the drives along the path by the effects of the model: the encoder positions that put the links where they should be, and the torques
//! beyond those of the rigid arm.
//!
//! The controller computes a table before the run, with the laws that the plant and the diagnosis use. Gaps and springs of transmissions shift the links;
//! friction, springs and couplings need torque; encoders may be late or have offsets. Changes of the arm and radial play are in [`crate::model::Model`], not
//! here. The table excludes pushes, clipping and faults of the torque and tool sensors, because no drive can compensate them, and every compliance or freedom
//! between the joints and the tool. A shift that jumps, like that of a gap, is smoothed. The controller does not demand the acceleration of that shift, since
//! the motor crosses the gap alone, without the link.

use freeplay_arm::Arm;
use freeplay_laws::{Baseline, Effects, Injection, LawError, Placed, Readings, Trajectory};
use freeplay_path::JointPath;
use freeplay_shm::Reference;

use crate::displacement_preview::SAME_PATH;

/// Most rows of the table; a longer path gets a coarser step.
pub(crate) const MOST_ROWS: f64 = 100_000.0;
/// Half the span of the moving average over the shifts, which is applied twice, s.
pub(crate) const HALF_SPAN: f64 = 0.01;
/// Time in which shifts rise from zero to full, s, because a run begins with the joints at the start of the path.
pub(crate) const BLEND: f64 = 0.3;

/// Shifts and torques of the drives along the path; see the module.
#[derive(Clone, Debug)]
pub struct KnownEffects {
    step: f64,
    joints: usize,
    /// The path itself, `[row][joint]`.
    path: Vec<f64>,
    /// Encoder positions minus the path, `[row][joint]`, rad (m), and the rate of that difference.
    shift: [Vec<f64>; 2],
    /// Torques of the drives beyond the rigid arm and its nominal friction, `[row][joint]`, N·m (N).
    torque: Vec<f64>,
    /// The row of the last call, and a flag: true if the reference was on the path.
    now: usize,
    on_path: bool,
}

impl KnownEffects {
    /// Computes the table for `effects` along `path` in ticks of `period` s; `arm` includes the changes by the effects. Returns `None` if the effects need no
    /// shift and no torque.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn along(
        arm: &Arm,
        effects: &Effects,
        path: &JointPath,
        period: f64,
    ) -> Result<Option<KnownEffects>, LawError> {
        let step = period.max(path.duration() / MOST_ROWS);
        Self::of_motion(arm, effects, &sampled(arm, path, step), step)
    }

    /// Does the same along a `motion` that is sampled in steps of `step` s.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn of_motion(
        arm: &Arm,
        effects: &Effects,
        motion: &Trajectory,
        step: f64,
    ) -> Result<Option<KnownEffects>, LawError> {
        let (laws, sensors) = split_effects(effects);
        if laws.is_empty() && sensors.is_empty() {
            return Ok(None);
        }
        let as_it_is = |column: &[f64]| column.to_vec();
        let rigid = Baseline::new(arm, &[], motion, &as_it_is)?;
        let full = Baseline::new(arm, &laws, motion, &as_it_is)?;
        let columns = |columns: Vec<Vec<f64>>| by_row(&columns, motion.len());
        let less = |a: &[Vec<f64>], b: &[Vec<f64>]| -> Vec<Vec<f64>> {
            a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b).collect()).collect()
        };
        let torque = less(&full.prediction().torque, &rigid.prediction().torque);
        let mut shift = less(&motion.q, &full.prediction().link);
        add_encoder_errors(&sensors, motion, step, &mut shift);
        for column in &mut shift {
            column.iter_mut().zip(&motion.t).for_each(|(shift, t)| *shift *= smooth_step(t / BLEND));
        }
        let half = (HALF_SPAN / step).round() as usize;
        let shift: Vec<Vec<f64>> =
            shift.iter().map(|column| averaged(&averaged(column, half), half)).collect();
        let rate = shift.iter().map(|column| rate_of(column, step)).collect();
        Ok(Some(KnownEffects {
            step,
            joints: arm.dof(),
            path: columns(motion.q.clone()),
            shift: [columns(shift), columns(rate)],
            torque: columns(torque),
            now: 0,
            on_path: false,
        }))
    }

    /// Selects the row of the instant `t`, s since the start, for which `reference` is wanted. If `reference` is not on the path, the table has no values for
    /// it.
    pub fn turn_to(&mut self, t: f64, reference: &Reference) {
        let last = self.path.len() / self.joints - 1;
        self.now = ((t / self.step).round().max(0.0) as usize).min(last);
        let row = self.row(&self.path);
        self.on_path = row.iter().zip(&reference.q).all(|(own, given)| (own - given).abs() <= SAME_PATH);
    }

    /// Encoder positions minus the desired joints, rad (m), and the rate of that difference; `None` off the path.
    pub fn shift(&self) -> Option<[&[f64]; 2]> {
        self.on_path.then(|| [self.row(&self.shift[0]), self.row(&self.shift[1])])
    }

    /// Torques of the drives beyond the rigid arm and its nominal friction, N·m (N); `None` off the path.
    pub fn torque(&self) -> Option<&[f64]> {
        self.on_path.then(|| self.row(&self.torque))
    }

    /// Encoder positions minus the desired joints at the row `row`, rad (m).
    pub fn shift_at(&self, row: usize) -> &[f64] {
        &self.shift[0][row * self.joints..(row + 1) * self.joints]
    }

    fn row<'t>(&self, table: &'t [f64]) -> &'t [f64] {
        &table[self.now * self.joints..(self.now + 1) * self.joints]
    }
}

/// Splits the effects into those on drives and transmissions, and those of the sensors.
fn split_effects(effects: &Effects) -> (Vec<&Placed>, Vec<&Placed>) {
    let (mut laws, mut sensors) = (Vec::new(), Vec::new());
    for placed in &effects.placed {
        let mut injection = Injection::default();
        placed.effect.inject(&mut injection);
        if !injection.sensors.is_empty() {
            sensors.push(placed);
        } else if !injection.drives.is_empty() || !injection.transmissions.is_empty() {
            laws.push(placed);
        }
    }
    (laws, sensors)
}

/// The path in steps of `step` s.
pub(crate) fn sampled(arm: &Arm, path: &JointPath, step: f64) -> Trajectory {
    let rows = (path.duration() / step).ceil() as usize + 1;
    let joints = arm.dof();
    let (mut q, mut v, mut a) = (vec![0.0; joints], vec![0.0; joints], vec![0.0; joints]);
    let blank = || vec![Vec::with_capacity(rows); joints];
    let mut motion = Trajectory { q: blank(), v: blank(), a: blank(), ..Trajectory::default() };
    for row in 0..rows {
        let t = row as f64 * step;
        path.at(t, &mut q, &mut v, &mut a);
        motion.t.push(t);
        for (columns, values) in [(&mut motion.q, &q), (&mut motion.v, &v), (&mut motion.a, &a)] {
            columns.iter_mut().zip(values).for_each(|(column, value)| column.push(*value));
        }
    }
    motion.stretches.push(0..rows);
    motion
}

/// Adds to `shift` the error of encoders with these `sensors`.
fn add_encoder_errors(sensors: &[&Placed], motion: &Trajectory, step: f64, shift: &mut [Vec<f64>]) {
    let mut injection = Injection::default();
    sensors.iter().for_each(|placed| placed.effect.inject(&mut injection));
    let joints = motion.q.len();
    let (mut q, mut v, mut a) = (vec![0.0; joints], vec![0.0; joints], vec![0.0; joints]);
    let (mut torque, mut link, mut tool) = (vec![0.0; joints], vec![0.0; joints], vec![0.0; 3]);
    for row in 0..motion.len() {
        motion.at(row, &mut q, &mut v, &mut a);
        link.copy_from_slice(&q);
        let mut readings = Readings {
            period: step,
            q: &mut q,
            v: &mut v,
            torque: &mut torque,
            link: &mut link,
            tool: &mut tool,
        };
        injection.sensors.iter_mut().for_each(|law| law.read(&mut readings));
        for (joint, shift) in shift.iter_mut().enumerate() {
            shift[row] += q[joint] - motion.q[joint][row];
        }
    }
}

/// Smooth step from 0 to 1, at rest at both ends.
pub(crate) fn smooth_step(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
}

/// Columns as one row-major table.
pub(crate) fn by_row(columns: &[Vec<f64>], rows: usize) -> Vec<f64> {
    (0..rows).flat_map(|row| columns.iter().map(move |column| column[row])).collect()
}

/// Mean over `half` points before and after each point; fewer at the ends.
pub(crate) fn averaged(column: &[f64], half: usize) -> Vec<f64> {
    let mut sums = vec![0.0];
    column.iter().for_each(|x| sums.push(sums[sums.len() - 1] + x));
    let last = column.len();
    let mean = |k: usize| {
        let reach = half.min(k).min(last - 1 - k);
        let (from, to) = (k - reach, k + reach + 1);
        (sums[to] - sums[from]) / (to - from) as f64
    };
    (0..last).map(mean).collect()
}

/// Central differences.
pub(crate) fn rate_of(column: &[f64], step: f64) -> Vec<f64> {
    let last = column.len() - 1;
    let rate = |k: usize| {
        let (from, to) = (k.saturating_sub(1), (k + 1).min(last));
        if to > from { (column[to] - column[from]) / ((to - from) as f64 * step) } else { 0.0 }
    };
    (0..column.len()).map(rate).collect()
}

#[cfg(test)]
mod tests {
    use freeplay_laws::Effects;
    use freeplay_model::{ArmFile, EffectTable, paper_arm};
    use freeplay_path::{JointPath, PathSpec};
    use freeplay_shm::Reference;

    use super::KnownEffects;

    fn with(kind: &str, joint: Option<&str>, parameters: toml::Table) -> ArmFile {
        let mut file = paper_arm();
        let joint = joint.map(str::to_owned);
        file.effects.push(EffectTable { kind: kind.into(), joint, parameters, line: 0 });
        file
    }

    fn toml(text: &str) -> toml::Table {
        text.parse().expect("a table")
    }

    fn known(file: &ArmFile) -> (Option<KnownEffects>, JointPath) {
        let path = JointPath::plan(&file.arm, &PathSpec::default(), 1000.0).expect("a path");
        let effects = Effects::of(file).expect("effects");
        (KnownEffects::along(&file.arm, &effects, &path, 1e-3).expect("a table"), path)
    }

    fn on(path: &JointPath, t: f64) -> ([f64; 6], [f64; 6], Reference) {
        let (mut q, mut v, mut a) = ([0.0; 6], [0.0; 6], [0.0; 6]);
        path.at(t, &mut q, &mut v, &mut a);
        let mut reference = Reference::REST;
        reference.q[..6].copy_from_slice(&q);
        (q, v, reference)
    }

    /// Dry friction needs F sign(q̇); late encoders read the joint position of an earlier time. The test checks both against their formulas.
    #[test]
    fn friction_takes_its_torque_and_late_encoders_their_way() {
        let (friction, path) = known(&with("coulomb_friction", Some("joint_3"), toml("coulomb = 40.0")));
        let (late, _) = known(&with("time_delay", None, toml("delay = 0.0025\nchannel = 'position'")));
        let (mut friction, mut late) = (friction.expect("a table"), late.expect("a table"));
        let (mut seen, mut worst) = (0.0_f64, 0.0_f64);
        for k in 4..55 {
            let t = 0.1 * f64::from(k);
            let (q, v, reference) = on(&path, t);
            friction.turn_to(t, &reference);
            let spent = friction.torque().expect("on the path")[2];
            assert!((spent - 40.0 * v[2].signum()).abs() < 1e-9, "{spent} at {} rad/s", v[2]);
            late.turn_to(t, &reference);
            let [shift, _] = late.shift().expect("on the path");
            let (before, _, _) = on(&path, t - 0.0025);
            for joint in 0..6 {
                seen = seen.max((before[joint] - q[joint]).abs());
                worst = worst.max((shift[joint] - (before[joint] - q[joint])).abs());
            }
        }
        println!("late by {seen:.2e} rad, off by {worst:.2e}");
        assert!(seen > 1e-3 && worst < 0.01 * seen);
    }

    #[test]
    fn play_and_payload_ask_nothing_here_and_no_path_no_help() {
        let (play, _) = known(&with("joint_clearance", Some("joint_5"), toml("clearance = 6e-4")));
        let (payload, _) = known(&with("payload", None, toml("mass = 4.0")));
        assert!(play.is_none() && payload.is_none());
        let (friction, path) = known(&with("coulomb_friction", Some("joint_3"), toml("coulomb = 40.0")));
        let mut friction = friction.expect("a table");
        let (_, _, mut reference) = on(&path, 1.0);
        reference.q[0] += 0.01;
        friction.turn_to(1.0, &reference);
        assert!(friction.torque().is_none() && friction.shift().is_none());
    }
}

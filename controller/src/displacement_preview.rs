//! Preview of the journal displacements at the coming ticks, predicted along the planned path or from a reference alone.

use freeplay_laws::ArmWithPlay;
use freeplay_path::JointPath;
use freeplay_shm::Reference;

use crate::centred_average::CentredAverage;
use crate::compensation::Motion;
use crate::deviation::QuasiStatic;

/// If the reference of a state is farther than this from the planned path, rad (m), the preview does not use the path.
pub const SAME_PATH: f64 = 1e-3;

/// Motion of the joints at one instant, with its own storage.
pub struct JointMotion {
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
}

impl JointMotion {
    /// `n` joints at rest at zero.
    pub fn new(n: usize) -> JointMotion {
        JointMotion { q: vec![0.0; n], v: vec![0.0; n], a: vec![0.0; n] }
    }

    /// The values as a [`Motion`].
    pub fn as_motion(&self) -> Motion<'_> {
        Motion { q: &self.q, v: &self.v, a: &self.a }
    }

    /// Copies `motion`.
    pub fn copy(&mut self, motion: Motion<'_>) {
        self.q.copy_from_slice(motion.q);
        self.v.copy_from_slice(motion.v);
        self.a.copy_from_slice(motion.a);
    }

    /// Sets the motion to the result of `span` seconds at the accelerations `a`, starting from the positions `q` and velocities
    /// `v`.
    pub fn coast(&mut self, q: &[f64], v: &[f64], a: &[f64], span: f64) {
        for i in 0..self.q.len() {
            self.q[i] = q[i] + (v[i] + 0.5 * a[i] * span) * span;
            self.v[i] = v[i] + a[i] * span;
            self.a[i] = a[i];
        }
    }

    /// Adds `shift` to position and velocity.
    pub fn shift(&mut self, [by, rate]: [&[f64]; 2]) {
        self.q.iter_mut().zip(by).for_each(|(q, by)| *q += by);
        self.v.iter_mut().zip(rate).for_each(|(v, rate)| *v += rate);
    }

    /// Sets the motion to `reference` plus `correction`.
    pub fn add(&mut self, reference: &Reference, correction: Motion<'_>) {
        for joint in 0..self.q.len() {
            self.q[joint] = reference.q[joint] + correction.q[joint];
            self.v[joint] = reference.qd[joint] + correction.v[joint];
            self.a[joint] = reference.qdd[joint] + correction.a[joint];
        }
    }
}

/// Displacements of the journals ahead: smoothed on the planned path, unsmoothed on any other motion.
pub struct DisplacementPreview {
    path: JointPath,
    predictor: QuasiStatic,
    preview: CentredAverage,
    period: f64,
    motion: JointMotion,
    /// The tick of the mean in `preview`, if it is filled.
    middle: Option<u64>,
    displacements: Vec<f64>,
}

impl DisplacementPreview {
    /// Creates a preview on `path`, for the arm with play `arm`, ticks of `period` seconds, averaging over `half` ticks before
    /// and after.
    pub fn new(path: JointPath, arm: &ArmWithPlay, period: f64, half: usize) -> DisplacementPreview {
        let width = 2 * arm.plays().len();
        DisplacementPreview {
            path,
            predictor: QuasiStatic::new(arm, period),
            preview: CentredAverage::new(half, width),
            displacements: vec![0.0; width],
            period,
            motion: JointMotion::new(arm.nominal_dof()),
            middle: None,
        }
    }

    /// Returns true if `reference` at the tick `tick` is on the path.
    pub fn leads_through(&mut self, reference: &Reference, tick: u64) -> bool {
        let own = self.on_path(tick).q;
        own.iter().zip(&reference.q).all(|(own, given)| (own - given).abs() <= SAME_PATH)
    }

    /// The motion on the path at the tick `tick`.
    pub fn on_path(&mut self, tick: u64) -> Motion<'_> {
        self.follow(tick as f64);
        self.motion.as_motion()
    }

    /// The mean accelerations of the path from the tick `tick` to the next, rad/s² (m/s²), to hold for that tick.
    pub fn held(&mut self, tick: u64, held: &mut [f64]) {
        held.copy_from_slice(self.on_path(tick + 1).v);
        let per_tick = 1.0 / self.period;
        for (held, v) in held.iter_mut().zip(self.on_path(tick).v) {
            *held = (*held - v) * per_tick;
        }
    }

    /// The smoothed displacements on the path at the tick `tick`, m: two for each joint with play. The call is cheap if the last
    /// one was for the tick before.
    pub fn at(&mut self, tick: u64) -> &[f64] {
        let half = self.preview.half_width() as f64;
        if self.middle != Some(tick) {
            if tick == 0 || self.middle != Some(tick - 1) {
                self.predictor.restart();
                // One value more than the average needs, because the first has no previous tick that gives the rotation of the
                // load.
                for offset in 0..=2 * self.preview.half_width() {
                    self.push(tick as f64 - half - 1.0 + offset as f64);
                }
            }
            self.push(tick as f64 + half);
            self.middle = Some(tick);
        }
        self.preview.mean(&mut self.displacements);
        &self.displacements
    }

    /// The displacements during `motion`, which is not on the path. From the second call on, `motion` must be one tick after that
    /// of the last call.
    pub fn of(&mut self, motion: Motion<'_>) -> &[f64] {
        if self.middle.take().is_some() {
            self.predictor.restart();
        }
        self.predictor.advance(motion);
        for (slot, value) in self.displacements.iter_mut().zip(self.predictor.displacements()) {
            *slot = value;
        }
        &self.displacements
    }

    fn follow(&mut self, tick: f64) {
        let JointMotion { q, v, a } = &mut self.motion;
        self.path.at(tick * self.period, q, v, a);
    }

    fn push(&mut self, tick: f64) {
        self.follow(tick);
        self.predictor.advance(self.motion.as_motion());
        self.preview.push(self.predictor.displacements());
    }
}

//! Several recordings of one machine: one answer.

use freeplay_model::ArmFile;
use freeplay_recording::Recording;

use super::change::Late;
use super::examine::examine;
use super::finding::{Certainty, Setup, SetupFinding};
use super::kinds::{clock_offset, joint_zero};
use super::reading::Reading;

/// The faults in recordings of one machine, and the corrected recordings.
pub struct Mended {
    /// The faults, each kind and joint once; a certain fault of one recording holds for all.
    pub findings: Vec<SetupFinding>,
    /// Reason why no reading reconciles recordings and model.
    pub stop: Option<String>,
    /// The recordings with every certain fault corrected; empty without such a fault.
    pub recordings: Vec<Recording>,
    /// The model under the gravity of the recordings.
    pub file: ArmFile,
    /// The reading of the last recording with a fault, as a mapping file.
    pub mapping: Option<String>,
    /// The reading of each recording; empty if none is corrected.
    readings: Vec<Reading>,
}

impl Mended {
    /// Examines each of `recordings` with the model `file`.
    pub fn of(file: &ArmFile, recordings: &[Recording]) -> Self {
        let setups: Vec<Setup> = recordings.iter().map(|recording| examine(&file.arm, recording)).collect();
        let mut mended = Self {
            findings: Vec::new(),
            stop: setups.iter().find_map(|setup| setup.stop.clone()),
            recordings: Vec::new(),
            file: file.clone(),
            mapping: None,
            readings: Vec::new(),
        };
        let is_sure = setups.iter().any(Setup::is_sure);
        for finding in setups.iter().flat_map(|setup| &setup.findings) {
            let is_known = |known: &SetupFinding| known.kind == finding.kind && known.joint == finding.joint;
            if !mended.findings.iter().any(is_known) {
                mended.findings.push(finding.clone());
            }
        }
        mended.findings.sort_by_key(|finding| finding.certainty == Certainty::Likely);
        let Some(known) = setups.iter().rev().find(|setup| setup.is_sure()).filter(|_| is_sure) else {
            return mended;
        };
        // A recording without a fault of its own takes the reading of the others.
        let readings =
            setups.iter().map(|setup| if setup.is_sure() { &setup.reading } else { &known.reading });
        mended.readings = readings.cloned().collect();
        mended.one_clock();
        mended.file.arm = known.reading.arm(&file.arm);
        mended.read(file, recordings);
        mended
    }

    /// Applies the readings to `recordings` of the machine of `file`.
    fn read(&mut self, file: &ArmFile, recordings: &[Recording]) {
        let each = recordings.iter().zip(&self.readings);
        self.recordings =
            each.clone().map(|(recording, reading)| reading.mended(&file.arm, recording)).collect();
        let last = each.rev().find(|(_, reading)| !reading.is_plain());
        self.mapping = last.and_then(|(recording, reading)| super::mapping::mapping(reading, recording));
    }

    /// Sets all delays to their mean if they differ by no more than the error of one delay.
    fn one_clock(&mut self) {
        let of_torques: fn(&mut Reading) -> &mut f64 = |reading| &mut reading.torque_delay;
        let of_tool: fn(&mut Reading) -> &mut f64 = |reading| &mut reading.tool_delay;
        for delay in [of_torques, of_tool] {
            let mut delays: Vec<&mut f64> =
                self.readings.iter_mut().map(delay).filter(|x| **x != 0.0).collect();
            let (least, most) = delays
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), x| (least.min(**x), most.max(**x)));
            if most - least <= clock_offset::unsure() {
                let mean = delays.iter().map(|x| **x).sum::<f64>() / delays.len() as f64;
                delays.iter_mut().for_each(|x| **x = mean);
            }
        }
    }

    /// The channels on another clock than the positions, if there are any.
    pub(crate) fn late(&self) -> Option<Late> {
        let late = |reading: &Reading| match (reading.torque_delay != 0.0, reading.tool_delay != 0.0) {
            (true, true) => Some(Late::Both),
            (true, false) => Some(Late::Torque),
            (false, true) => Some(Late::Tool),
            (false, false) => None,
        };
        self.readings.iter().find_map(late)
    }

    /// The joints whose zero was fitted, with nearly the same result for all recordings.
    pub(crate) fn fitted_zeros(&self) -> Vec<usize> {
        let Some(first) = self.readings.first() else { return Vec::new() };
        let zero = |reading: &Reading, joint: usize| reading.positions[joint].zero;
        let is_fitted = |joint: &usize| {
            let own = zero(first, *joint);
            let is_near = |other: &Reading| (zero(other, *joint) - own).abs() < joint_zero::unsure();
            joint_zero::is_fitted(own) && self.readings.iter().all(is_near)
        };
        (0..first.positions.len()).filter(is_fitted).collect()
    }

    /// Increases the delay of the channels that are `late` by some seconds, moves each joint of `farther` by an angle, rad, and applies the readings to
    /// `recordings` of the machine of `file`. All readings take the mean of a joint's zero.
    pub(crate) fn refine(
        &mut self,
        file: &ArmFile,
        recordings: &[Recording],
        late: Option<(Late, f64)>,
        farther: &[(usize, f64)],
    ) {
        if let Some((late, later)) = late {
            self.set_clock(late, later);
        }
        for &(joint, angle) in farther {
            let sum: f64 = self.readings.iter().map(|reading| reading.positions[joint].zero).sum();
            let zero = sum / self.readings.len() as f64 - angle;
            self.readings.iter_mut().for_each(|reading| reading.positions[joint].zero = zero);
            joint_zero::restate(&mut self.findings, &file.arm.joints()[joint].name, zero);
        }
        self.read(file, recordings);
    }

    fn set_clock(&mut self, late: Late, later: f64) {
        for reading in &mut self.readings {
            for delay in [&mut reading.torque_delay, &mut reading.tool_delay] {
                if *delay != 0.0 {
                    *delay += later;
                }
            }
        }
        let of =
            |reading: &Reading| if late == Late::Tool { reading.tool_delay } else { reading.torque_delay };
        if let Some(delay) = self.readings.iter().map(of).find(|delay| *delay != 0.0) {
            for finding in self.findings.iter_mut().filter(|finding| finding.kind == clock_offset::KIND) {
                *finding = clock_offset::finding(late, delay, finding.certainty);
            }
        }
    }

    /// Returns true if the readings change the recordings.
    pub fn is_mended(&self) -> bool {
        !self.recordings.is_empty()
    }
}

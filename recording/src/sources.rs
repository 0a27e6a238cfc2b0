//! Sources of the columns of a recording: the file's own columns with all conversions, so that a correction of the recording can be written as a mapping of the
//! same file.

use std::fmt::Write as _;

use crate::corrections::Relative;

/// The columns of one quantity in the file, with scale, offset and so on, column by column.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Quantity {
    /// The name of its table in a mapping: `t`, `q`, `qd`, `tau`, `q_ref`, `q_link`, `tool`, `orientation`.
    pub key: String,
    /// Names of the file's columns; empty for a joint without one.
    pub columns: Vec<String>,
    /// Factors to SI.
    pub scale: Vec<f64>,
    /// Offsets, subtracted from the scaled values, SI; an empty list means zero.
    pub offset: Vec<f64>,
    /// True if jumps by whole turns are removed.
    pub unwrap: bool,
    /// Delay of the columns, s.
    pub delay: f64,
}

/// The sources of all columns of a recording.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sources {
    /// Lines of a mapping on the form of the file: separator, decimal sign, lines to skip.
    pub form: String,
    /// The quantities.
    pub quantities: Vec<Quantity>,
    /// Positions that contain a multiple of the position of another joint: joint, other joint (both from 0) and factor.
    pub relative: Vec<(usize, usize, f64)>,
    /// True if the torques of the file lack the arm's weight.
    pub gravity_compensated: bool,
}

impl Quantity {
    /// The quantity `key` in the columns `columns`, with scale 1 and offset 0.
    pub fn unscaled(key: &str, columns: Vec<String>) -> Self {
        let count = columns.len();
        let (scale, offset) = (vec![1.0; count], vec![0.0; count]);
        Self { key: key.to_owned(), columns, scale, offset, unwrap: false, delay: 0.0 }
    }

    /// True for a quantity of joints.
    pub fn is_of_joints(&self) -> bool {
        !matches!(self.key.as_str(), "t" | "tool" | "orientation")
    }

    /// The columns at `order`, in that order.
    pub fn reorder(&mut self, order: &[usize]) {
        self.columns = order.iter().map(|&place| self.columns[place].clone()).collect();
        self.scale = order.iter().map(|&place| self.scale[place]).collect();
        self.offset = order.iter().map(|&place| self.offset[place]).collect();
    }
}

impl Sources {
    /// Keeps the joints at the indices `order`, in that order.
    pub(crate) fn reorder(&mut self, order: &[usize]) {
        for quantity in self.quantities.iter_mut().filter(|quantity| quantity.is_of_joints()) {
            if order.iter().all(|&place| place < quantity.columns.len()) {
                quantity.reorder(order);
            }
        }
        let place = |joint: usize| order.iter().position(|&old| old == joint);
        let moved =
            self.relative.iter().filter_map(|&(joint, other, k)| Some((place(joint)?, place(other)?, k)));
        self.relative = moved.collect();
    }

    pub(crate) fn take_relative(&mut self, relative: &[Relative]) {
        let from_one = |relative: &Relative| {
            Some((relative.joint.checked_sub(1)?, relative.to.checked_sub(1)?, relative.factor))
        };
        self.relative = relative.iter().filter_map(from_one).collect();
    }

    /// The text of a mapping file, with the names of the joints if there are any.
    pub fn to_toml(&self, joints: &[String]) -> String {
        let mut text = self.form.clone();
        if !joints.is_empty() {
            let _ = writeln!(text, "joints = {}", list(joints));
        }
        if self.gravity_compensated {
            text.push_str("gravity_compensated = true\n");
        }
        for quantity in &self.quantities {
            let columns = match quantity.columns.as_slice() {
                [one] if quantity.key == "t" => quoted(one),
                all => list(all),
            };
            let _ = write!(text, "\n[{}]\ncolumns = {columns}\n", quantity.key);
            let scale = &quantity.scale;
            if scale.iter().any(|factor| *factor != 1.0) {
                let _ = match scale.as_slice() {
                    [one] => writeln!(text, "scale = {one:?}"),
                    all => writeln!(text, "scale = {all:?}"),
                };
            }
            if quantity.offset.iter().any(|offset| *offset != 0.0) {
                let _ = writeln!(text, "offset = {:?}", quantity.offset);
            }
            if quantity.unwrap {
                text.push_str("unwrap = true\n");
            }
            if quantity.delay != 0.0 {
                let _ = writeln!(text, "delay = {:?}", quantity.delay);
            }
        }
        for (joint, other, factor) in &self.relative {
            let _ = write!(
                text,
                "\n[[relative]]\njoint = {}\nto = {}\nfactor = {factor:?}\n",
                joint + 1,
                other + 1
            );
        }
        text
    }
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

fn list(texts: &[String]) -> String {
    format!("[{}]", texts.iter().map(|text| quoted(text)).collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use std::path::Path;

    use super::Sources;
    use crate::mapping::Mapping;

    fn read(text: &str, mapping: Option<&str>) -> crate::Recording {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("run.csv");
        freeplay_storage::write(&file, text.as_bytes()).unwrap();
        let mapping = mapping.map(|mapping| Mapping::parse(mapping, Path::new("map.toml")).unwrap());
        match &mapping {
            Some(mapping) => crate::import_csv(&file, mapping).unwrap(),
            None => crate::read(&file, None).unwrap(),
        }
    }

    /// The mapping written for a guessed or mapped recording gives the same recording again.
    #[test]
    fn the_sources_of_a_recording_are_a_mapping_that_reads_it_again() {
        let rows: String =
            (0..40).map(|k| format!("{};{};{};{};{}\n", 10 * k, k, 2 * k, 300 - k, 5 * k)).collect();
        let text = format!(
            "time [ms];position_lift [deg];position_elbow [deg];torque_lift [Nmm];torque_elbow [Nmm]\n{rows}"
        );
        let guessed = read(&text, None);
        assert!(guessed.guessed.is_some());
        let mapped = "joints = [\"a\", \"b\"]\n[t]\ncolumns = \"time [ms]\"\nunit = \"ms\"\n[q]\ncolumns = [\"position_elbow [deg]\", \"position_lift [deg]\"]\n\
            unit = \"deg\"\nscale = [-1, 2]\noffset = 0.25\n[tau]\ncolumns = [\"torque_elbow [Nmm]\", \"torque_lift [Nmm]\"]\nunit = \"N*mm\"\ndelay = 0.02\n\
            [[relative]]\njoint = 2\nto = 1\nfactor = 0.5\n";
        for recording in [guessed, read(&text, Some(mapped))] {
            let again = read(&text, Some(&Sources::of(&recording).to_toml(&recording.joint_names)));
            let close = |a: &[Vec<f64>], b: &[Vec<f64>]| {
                a.iter().flatten().zip(b.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-12)
            };
            assert!(close(&again.q, &recording.q), "{:?}", recording.sources);
            assert!(close(again.tau.as_ref().unwrap(), recording.tau.as_ref().unwrap()));
            assert_eq!((again.t, again.joint_names), (recording.t, recording.joint_names));
        }
    }
}

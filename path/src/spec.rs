//! The specification of a path: the `path` table of a scenario as typed.

use std::f64::consts::FRAC_PI_2;
use std::path::PathBuf;

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Longest planned motion (`period × laps`, or the span of a file), in s: one day.
pub const LONGEST_DURATION: f64 = 86_400.0;
/// Shortest planned lap, in s.
pub const SHORTEST_PERIOD: f64 = 0.01;
/// Smallest blend of a square's side: below, the acceleration at the corners is that of an impact.
pub const SMALLEST_BLEND: f64 = 1e-6;
/// Largest blend of a square's side: acceleration for one half, deceleration for the other.
pub const LARGEST_BLEND: f64 = 0.5;

/// Shape of the motion.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum PathKind {
    /// Smooth closed curve `centre + (A₁ cos θ, A₂ sin θ, A₃ sin 2θ)`. Each lap begins and ends at rest.
    #[default]
    Lissajous,
    /// Horizontal circle at constant speed. The motion starts abruptly: the tool has its full speed from t = 0.
    Circle,
    /// Horizontal square. Each side begins and ends at rest and has a trapezoidal speed profile with blend 0.04.
    Square,
    /// The same square with blend 0.004, which gives short, high accelerations at the corners.
    SquareSharp,
    /// Rows of a CSV file: `t,q1…qn` or `t,x,y,z[,qx,qy,qz,qw]`.
    File,
    /// Each joint swings about its middle with its own frequency. Each lap begins and ends at rest. This path suits any arm.
    JointSine,
}

/// One number, or one number for each axis.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(untagged, expecting = "a number or an array of three numbers")]
pub enum Size {
    /// Radius of the circle, m; half of the square's side, m; or amplitude of each joint, rad or m.
    One(f64),
    /// Amplitudes along x, y and z of the base frame, m.
    Axes([f64; 3]),
}

/// Reference path. Every field has a default. Lengths are in m, angles in rad, times in s.
///
/// The path ignores `centre`, `rpy`, `period` and `start` if the chosen `kind` does not use them. It rejects `blend`, `file` and `size` if
/// the chosen `kind` does not use them.
#[derive(Serialize, Deserialize, Clone, Debug, PartialEq)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct PathSpec {
    /// Shape of the motion.
    pub kind: PathKind,
    /// Centre of the shape in the base frame, m.
    pub centre: [f64; 3],
    /// Size of the shape. The defaults are amplitudes of (0.15, 0.25, 0.05) m for `lissajous`, 0.15 m for `circle`, `square` and
    /// `square_sharp`, and modest amplitudes within the joint limits for `joint_sine`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<Size>,
    /// Tool orientation: roll, pitch and yaw about the fixed axes x, y and z of the base (as in URDF), rad. For `file` it applies if the
    /// file contains no orientation.
    pub rpy: [f64; 3],
    /// Time of one lap, s. The kind `file` does not use it, since the rows of the file contain times.
    pub period: f64,
    /// Number of laps. With more than one lap, the path of a file must end where it begins.
    pub laps: u32,
    /// Path of the CSV file for `kind = "file"`, relative to the working directory.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Fraction of the time of a square's side in which the tool accelerates, 1e-6 to 0.5. It decelerates for the same fraction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blend: Option<f64>,
    /// Posture, one value for each joint, rad or m. Inverse kinematics starts from it, which determines the branch of the solution.
    /// `joint_sine` swings about it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<Vec<f64>>,
}

impl Default for PathSpec {
    fn default() -> Self {
        PathSpec {
            kind: PathKind::default(),
            centre: [0.95, 0.0, 0.95],
            size: None,
            rpy: [0.0, FRAC_PI_2, 0.0],
            period: 6.0,
            laps: 1,
            file: None,
            blend: None,
            start: None,
        }
    }
}

/// A defect of a [`PathSpec`] that is visible without an arm.
#[derive(thiserror::Error, Clone, Debug, PartialEq)]
pub enum SpecError {
    /// A number is NaN or infinite.
    #[error("path.{field} holds {value}: write finite numbers")]
    NotFinite {
        /// The key.
        field: &'static str,
        /// The value found.
        value: f64,
    },
    /// The lap is too short or too long.
    #[error("path.period = {value} s: a lap takes between {SHORTEST_PERIOD} s and {LONGEST_DURATION} s")]
    Period {
        /// The value found, s.
        value: f64,
    },
    /// The number of laps is zero.
    #[error("path.laps = 0: write 1 or more")]
    NoLap,
    /// The whole motion takes too long.
    #[error(
        "path.laps = {laps} laps of {lap} s last {} s; at most {LONGEST_DURATION} s: lower laps or period",
        f64::from(*.laps) * .lap
    )]
    TooLong {
        /// The number of laps.
        laps: u32,
        /// The time of one lap, s.
        lap: f64,
    },
    /// The size has the wrong number of values for the shape.
    #[error("path.size of kind = \"{kind}\" is {wanted}")]
    SizeShape {
        /// The shape, as written in a scenario.
        kind: &'static str,
        /// The expected form, in words.
        wanted: &'static str,
    },
    /// A length is zero or negative.
    #[error("path.size = {value}: write a positive length")]
    SizeSign {
        /// The value found.
        value: f64,
    },
    /// The blend is out of range.
    #[error(
        "path.blend = {value}: the share of a side spent accelerating lies in {SMALLEST_BLEND}…{LARGEST_BLEND}"
    )]
    Blend {
        /// The value found.
        value: f64,
    },
    /// A key that does not apply to the kind.
    #[error("path.{field} has no meaning for kind = \"{kind}\": remove it, or set path.kind = \"{meant}\"")]
    NotForKind {
        /// The key.
        field: &'static str,
        /// The kind, as written in a scenario.
        kind: &'static str,
        /// The kind for which the key exists.
        meant: &'static str,
    },
    /// `kind = "file"` without a file.
    #[error("path.kind = \"file\" needs path.file = \"….csv\"")]
    NoFile,
}

impl PathKind {
    /// The name as a scenario writes it.
    pub fn name(self) -> &'static str {
        match self {
            PathKind::Lissajous => "lissajous",
            PathKind::Circle => "circle",
            PathKind::Square => "square",
            PathKind::SquareSharp => "square_sharp",
            PathKind::File => "file",
            PathKind::JointSine => "joint_sine",
        }
    }
}

impl PathSpec {
    /// Checks everything that can be checked without an arm.
    ///
    /// # Errors
    /// The first field that is out of range or has no meaning for the kind, with its value and the range.
    pub fn validate(&self) -> Result<(), SpecError> {
        finite("centre", &self.centre)?;
        finite("rpy", &self.rpy)?;
        finite("start", self.start.as_deref().unwrap_or_default())?;
        self.validate_time()?;
        self.validate_size()?;
        self.validate_blend()?;
        match (self.kind, &self.file) {
            (PathKind::File, None) => Err(SpecError::NoFile),
            (PathKind::File, Some(_)) | (_, None) => Ok(()),
            (_, Some(_)) => {
                Err(SpecError::NotForKind { field: "file", kind: self.kind.name(), meant: "file" })
            }
        }
    }

    /// Amplitudes of the `lissajous` path, m.
    #[cfg(feature = "plan")]
    pub(crate) fn amplitudes(&self) -> [f64; 3] {
        match self.size {
            Some(Size::Axes(axes)) => axes,
            Some(Size::One(_)) | None => [0.15, 0.25, 0.05],
        }
    }

    /// Radius of the circle or half side of the square, m.
    #[cfg(feature = "plan")]
    pub(crate) fn reach(&self) -> f64 {
        match self.size {
            Some(Size::One(reach)) => reach,
            Some(Size::Axes(_)) | None => 0.15,
        }
    }

    /// Share of a square's side spent accelerating.
    #[cfg(feature = "plan")]
    pub(crate) fn blend_or_default(&self) -> f64 {
        self.blend.unwrap_or(if self.kind == PathKind::SquareSharp { 0.004 } else { 0.04 })
    }

    fn validate_time(&self) -> Result<(), SpecError> {
        let value = self.period;
        if !(SHORTEST_PERIOD..=LONGEST_DURATION).contains(&value) {
            return Err(SpecError::Period { value });
        }
        if self.laps == 0 {
            return Err(SpecError::NoLap);
        }
        if self.kind == PathKind::File {
            return Ok(());
        }
        check_duration(self.laps, self.period)
    }

    fn validate_size(&self) -> Result<(), SpecError> {
        let kind = self.kind.name();
        match (self.kind, self.size) {
            (_, None) => Ok(()),
            (PathKind::Lissajous, Some(Size::Axes(axes))) => finite("size", &axes),
            (PathKind::Lissajous, Some(Size::One(_))) => {
                Err(SpecError::SizeShape { kind, wanted: "[x, y, z]: three amplitudes in m" })
            }
            (PathKind::File, Some(_)) => {
                Err(SpecError::NotForKind { field: "size", kind, meant: "lissajous" })
            }
            (_, Some(Size::Axes(_))) => Err(SpecError::SizeShape {
                kind,
                wanted: "one number (radius, half side or joint amplitude)",
            }),
            (_, Some(Size::One(value))) => {
                finite("size", &[value])?;
                if value > 0.0 { Ok(()) } else { Err(SpecError::SizeSign { value }) }
            }
        }
    }

    fn validate_blend(&self) -> Result<(), SpecError> {
        let Some(value) = self.blend else { return Ok(()) };
        if !matches!(self.kind, PathKind::Square | PathKind::SquareSharp) {
            return Err(SpecError::NotForKind { field: "blend", kind: self.kind.name(), meant: "square" });
        }
        if (SMALLEST_BLEND..=LARGEST_BLEND).contains(&value) {
            Ok(())
        } else {
            Err(SpecError::Blend { value })
        }
    }
}

/// Refuses motions longer than [`LONGEST_DURATION`].
pub(crate) fn check_duration(laps: u32, lap: f64) -> Result<(), SpecError> {
    if f64::from(laps) * lap <= LONGEST_DURATION { Ok(()) } else { Err(SpecError::TooLong { laps, lap }) }
}

fn finite(field: &'static str, values: &[f64]) -> Result<(), SpecError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(SpecError::NotFinite { field, value }),
        None => Ok(()),
    }
}

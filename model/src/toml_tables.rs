//! The tables of the TOML arm file as serde reads them; unknown keys are errors.

use serde::Deserialize;
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ArmTable {
    pub name: Option<String>,
    pub gravity: Option<Spanned<[f64; 3]>>,
    pub urdf: Option<Spanned<String>>,
    pub tip: Option<Spanned<String>>,
    #[serde(default)]
    pub joint: Vec<Spanned<JointTable>>,
    pub tool: Option<Spanned<FrameTable>>,
    #[serde(default)]
    pub effect: Vec<Spanned<toml::Table>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct JointTable {
    pub name: String,
    pub r#type: Option<KindName>,
    pub axis: Option<Spanned<[f64; 3]>>,
    pub origin: Option<Spanned<FrameTable>>,
    pub mass: Option<Spanned<f64>>,
    pub com: Option<Spanned<[f64; 3]>>,
    pub inertia: Option<Spanned<InertiaTable>>,
    pub limits: Option<LimitsTable>,
    pub damping: Option<Spanned<f64>>,
    pub friction: Option<Spanned<f64>>,
    pub rotor_inertia: Option<Spanned<f64>>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum KindName {
    Revolute,
    Prismatic,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FrameTable {
    pub xyz: Option<[f64; 3]>,
    pub rpy: Option<[f64; 3]>,
    pub quaternion: Option<[f64; 4]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct InertiaTable {
    pub ixx: f64,
    pub iyy: f64,
    pub izz: f64,
    #[serde(default)]
    pub ixy: f64,
    #[serde(default)]
    pub ixz: f64,
    #[serde(default)]
    pub iyz: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LimitsTable {
    pub lower: Option<Spanned<f64>>,
    pub upper: Option<Spanned<f64>>,
    pub velocity: Option<Spanned<f64>>,
    pub acceleration: Option<Spanned<f64>>,
    pub effort: Option<Spanned<f64>>,
}

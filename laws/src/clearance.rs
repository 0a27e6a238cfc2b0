//! The play of one revolute joint: `[[effect]] kind = "joint_clearance"`.
//!
//! Law: the journal moves freely in the plane across the axis within the radial clearance c. At the wall of the bearing, [`NormalContact`]
//! and [`ContactFriction`] act. Parameters, SI: see [`ClearanceTable`]. Defaults: those of Erkaya 2018, else of its sources (bearing
//! radius, smoothing speeds, floor of the impact speed).

use freeplay_model::EffectTable;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::law_error::LawError;
use crate::{ContactFriction, FrictionLaw, Material, NormalContact, NormalLaw, hertz_stiffness};

/// Clearance of a revolute joint. Every field but `clearance` is optional.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, as in clearance.JOINT.clearance = 0.0004")]
pub struct ClearanceTable {
    /// Radial clearance c = R_b − R_j, m, ≥ 0. Zero means an ideal joint.
    pub clearance: f64,
    /// Bearing radius R_b, m.
    #[serde(default = "ClearanceTable::bearing_radius")]
    pub bearing_radius: f64,
    /// Contact stiffness K, N/m^1.5. Absent: Hertz's stiffness, from the radii and the material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<f64>,
    /// Material of bearing and journal.
    #[serde(default)]
    pub material: Material,
    /// Prescribed coefficient of restitution e, above 0, to 1.
    #[serde(default = "ClearanceTable::restitution")]
    pub restitution: f64,
    /// Dissipation law of the normal force.
    #[serde(default)]
    pub normal_law: NormalLaw,
    /// Dynamic friction coefficient μ_d.
    #[serde(default = "ClearanceTable::friction")]
    pub friction: f64,
    /// Static friction coefficient μ_s. Absent: μ_d, without a Stribeck peak.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub static_friction: Option<f64>,
    /// Friction law of the contact.
    #[serde(default)]
    pub friction_law: FrictionLaw,
    /// Speed v_s of the friction law, m/s.
    #[serde(default = "ClearanceTable::static_speed")]
    pub static_speed: f64,
    /// Speed v_d of the friction law, m/s, above v_s.
    #[serde(default = "ClearanceTable::dynamic_speed")]
    pub dynamic_speed: f64,
    /// Lower bound of the impact speed by which the normal law divides, m/s.
    #[serde(default = "ClearanceTable::impact_speed_floor")]
    pub impact_speed_floor: f64,
}

impl ClearanceTable {
    fn bearing_radius() -> f64 {
        0.010
    }
    fn restitution() -> f64 {
        0.9
    }
    fn friction() -> f64 {
        0.01
    }
    fn static_speed() -> f64 {
        1e-3
    }
    fn dynamic_speed() -> f64 {
        1e-2
    }
    fn impact_speed_floor() -> f64 {
        1e-3
    }

    /// The paper's joint with the radial clearance `clearance`, m.
    pub fn new(clearance: f64) -> Self {
        Self {
            clearance,
            bearing_radius: Self::bearing_radius(),
            stiffness: None,
            material: Material::default(),
            restitution: Self::restitution(),
            normal_law: NormalLaw::default(),
            friction: Self::friction(),
            static_friction: None,
            friction_law: FrictionLaw::default(),
            static_speed: Self::static_speed(),
            dynamic_speed: Self::dynamic_speed(),
            impact_speed_floor: Self::impact_speed_floor(),
        }
    }

    /// The first parameter out of its range, with the range.
    fn fault(&self) -> Option<(&'static str, f64, &'static str)> {
        let stiffness = self.stiffness.unwrap_or(1.0);
        let static_friction = self.static_friction.unwrap_or(self.friction);
        let checks: [(&str, f64, bool, &str); 12] = [
            ("bearing_radius", self.bearing_radius, self.bearing_radius > 0.0, "above 0 m"),
            (
                "clearance",
                self.clearance,
                self.clearance >= 0.0 && self.clearance < self.bearing_radius,
                "0 m to below the bearing radius",
            ),
            ("stiffness", stiffness, stiffness > 0.0, "above 0 N/m^1.5"),
            ("material.young", self.material.young, self.material.young > 0.0, "above 0 Pa"),
            (
                "material.poisson",
                self.material.poisson,
                self.material.poisson > -1.0 && self.material.poisson <= 0.5,
                "above -1, to 0.5",
            ),
            (
                "restitution",
                self.restitution,
                self.restitution > 0.0 && self.restitution <= 1.0,
                "above 0, to 1",
            ),
            ("friction", self.friction, self.friction >= 0.0, "0 or more"),
            ("static_friction", static_friction, static_friction >= 0.0, "0 or more"),
            ("static_speed", self.static_speed, self.static_speed > 0.0, "above 0 m/s"),
            (
                "dynamic_speed",
                self.dynamic_speed,
                self.dynamic_speed > self.static_speed,
                "above static_speed",
            ),
            ("impact_speed_floor", self.impact_speed_floor, self.impact_speed_floor > 0.0, "above 0 m/s"),
            (
                "clearance",
                self.clearance,
                self.clearance == 0.0 || self.clearance >= 1e-6,
                "0, or 1e-6 m and more",
            ),
        ];
        checks
            .into_iter()
            .find(|(_, value, fits, _)| !(value.is_finite() && *fits))
            .map(|(name, value, _, range)| (name, value, range))
    }
}

/// The play of one revolute joint, ready for the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// Radial clearance c, m, > 0.
    pub clearance: f64,
    /// Bearing radius R_b, m.
    pub bearing_radius: f64,
    /// The normal force on the surface.
    pub normal: NormalContact,
    /// The friction force along the surface.
    pub friction: ContactFriction,
    /// Lower bound of the impact speed in the denominator of the normal law, m/s.
    pub impact_speed_floor: f64,
}

impl Clearance {
    /// Name in the catalogue of effects.
    pub const KIND: &str = "joint_clearance";

    /// The clearance that a table describes.
    ///
    /// # Errors
    /// [`LawError::OutOfRange`] names the first parameter that is not finite or out of its range.
    pub fn new(table: &ClearanceTable) -> Result<Self, LawError> {
        if let Some((parameter, value, range)) = table.fault() {
            return Err(LawError::OutOfRange { kind: Self::KIND.into(), line: 0, parameter, value, range });
        }
        let journal_radius = table.bearing_radius - table.clearance;
        let stiffness = table.stiffness.unwrap_or_else(|| {
            hertz_stiffness(table.material, table.material, table.bearing_radius, journal_radius)
        });
        Ok(Self {
            clearance: table.clearance,
            bearing_radius: table.bearing_radius,
            normal: NormalContact::new(stiffness, table.normal_law, table.restitution),
            friction: ContactFriction {
                law: table.friction_law,
                static_coefficient: table.static_friction.unwrap_or(table.friction),
                dynamic_coefficient: table.friction,
                static_speed: table.static_speed,
                dynamic_speed: table.dynamic_speed,
            },
            impact_speed_floor: table.impact_speed_floor,
        })
    }

    /// The clearance that an `[[effect]]` of an arm file describes.
    ///
    /// # Errors
    /// [`LawError::Unreadable`] for unknown or missing parameters, [`LawError::OutOfRange`] for impossible values.
    pub fn from_effect(effect: &EffectTable) -> Result<Self, LawError> {
        let table: ClearanceTable = effect.read(None).map_err(|message| LawError::Unreadable {
            kind: effect.kind.clone(),
            line: effect.line,
            message,
        })?;
        Self::new(&table).map_err(|error| error.at(effect.line))
    }

    /// Journal radius R_j = R_b − c, m.
    #[inline]
    pub fn journal_radius(&self) -> f64 {
        self.bearing_radius - self.clearance
    }
}

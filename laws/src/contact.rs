//! Normal contact of a journal in its bearing.
//!
//! Law, in one dimension with penetration δ \[m\], its rate δ̇ \[m/s\] and the impact speed δ̇⁻ \[m/s\] latched at
//! first contact:
//!
//! F = max(0, K δⁿ (1 + d_h δ̇/δ̇⁻)),  n = 3/2
//!
//! Source: Lankarani & Nikravesh 1990, J. Mech. Design 112:369; Erkaya 2018, Eqs. 3–5. Departures: the force never
//! pulls (the printed law does, late in the rebound), and the impact speed has a floor, since the law divides by it.
//! The law is continuous for δ → 0⁺ and smooth for δ > 0 wherever it does not clamp.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Elastic properties of a material.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Young's modulus, Pa, > 0.
    pub young: f64,
    /// Poisson's ratio, above -1, to 0.5.
    pub poisson: f64,
}

impl Default for Material {
    /// Aluminium, as in Erkaya 2018, Table 2.
    fn default() -> Self {
        Self { young: 71.7e9, poisson: 0.33 }
    }
}

/// Stiffness K of a journal in its bearing, N/m^1.5: Hertz's sphere in a socket (Erkaya 2018, Eq. 4).
///
/// K = 4/(3(σ_b + σ_j)) √(R_b R_j/(R_b − R_j)) with σ = (1 − ν²)/E. The conformal radii differ by the clearance. The formula does not
/// depend on the length of the bearing; this follows the paper.
pub fn hertz_stiffness(
    bearing: Material,
    journal: Material,
    bearing_radius: f64,
    journal_radius: f64,
) -> f64 {
    let sigma = |m: Material| (1.0 - m.poisson * m.poisson) / m.young;
    let radii = bearing_radius * journal_radius / (bearing_radius - journal_radius);
    4.0 / (3.0 * (sigma(bearing) + sigma(journal))) * radii.sqrt()
}

/// Dissipation law: the hysteresis damping factor d_h as a function of the coefficient of restitution e.
///
/// Only Hu–Guo reproduces the prescribed restitution. Lankarani–Nikravesh gives 0.913 for 0.9 and 0.663 for 0. The first integral of the
/// one-dimensional impact, d_h (1 + e′) = ln((1 + d_h)/(1 − d_h e′)), gives the resulting restitution e′ of each law.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum NormalLaw {
    /// d_h = 3(1 − e²)/4 (Lankarani & Nikravesh 1990): the paper's law.
    #[default]
    LankaraniNikravesh,
    /// d_h = 3(1 − e)/2 (Hunt & Crossley 1975).
    HuntCrossley,
    /// d_h = 3(1 − e)/(2e) (Hu & Guo 2015).
    HuGuo,
    /// d_h = 8(1 − e)/(5e) (Flores et al. 2011).
    Flores,
    /// d_h = (1 − e²)/e (Gonthier et al. 2004).
    Gonthier,
    /// d_h = 6(1 − e)/((2e − 1)² + 3) (Herbert & McWhannell 1977).
    HerbertMcwhannell,
    /// d_h = 3(1 − e)/4 (Lee & Wang 1983).
    LeeWang,
}

impl NormalLaw {
    /// The hysteresis damping factor d_h for the restitution `e` in (0, 1].
    pub fn damping(self, e: f64) -> f64 {
        match self {
            Self::LankaraniNikravesh => 0.75 * (1.0 - e * e),
            Self::HuntCrossley => 1.5 * (1.0 - e),
            Self::HuGuo => 1.5 * (1.0 - e) / e,
            Self::Flores => 1.6 * (1.0 - e) / e,
            Self::Gonthier => (1.0 - e * e) / e,
            Self::HerbertMcwhannell => 6.0 * (1.0 - e) / ((2.0 * e - 1.0).powi(2) + 3.0),
            Self::LeeWang => 0.75 * (1.0 - e),
        }
    }
}

/// The normal force of one contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalContact {
    /// K, N/m^1.5.
    pub stiffness: f64,
    /// d_h, dimensionless.
    pub damping: f64,
}

impl NormalContact {
    /// A contact of stiffness `stiffness` (N/m^1.5) that dissipates by `law` for the prescribed `restitution`.
    pub fn new(stiffness: f64, law: NormalLaw, restitution: f64) -> Self {
        Self { stiffness, damping: law.damping(restitution) }
    }

    /// Force on the journal, N, towards the centre; never negative.
    ///
    /// `penetration` δ ≥ 0 in m, `rate` δ̇ in m/s (positive while approaching), `impact_speed` δ̇⁻ > 0 in m/s.
    #[inline]
    pub fn force(&self, penetration: f64, rate: f64, impact_speed: f64) -> f64 {
        (self.elastic_force(penetration) * (1.0 + self.damping * rate / impact_speed)).max(0.0)
    }

    /// The elastic part of the force, whose energy the contact returns: K δ^1.5, N.
    #[inline]
    pub fn elastic_force(&self, penetration: f64) -> f64 {
        self.stiffness * penetration * penetration.sqrt()
    }

    /// Energy stored at the penetration δ, ⅖ K δ^2.5, J.
    #[inline]
    pub fn elastic_energy(&self, penetration: f64) -> f64 {
        0.4 * self.elastic_force(penetration) * penetration
    }

    /// The penetration that carries a steady `force` (N), (F/K)^(2/3), m.
    #[inline]
    pub fn static_penetration(&self, force: f64) -> f64 {
        (force / self.stiffness).cbrt().powi(2)
    }
}

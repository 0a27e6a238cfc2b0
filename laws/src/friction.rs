//! Friction along the surface of a bearing.
//!
//! Law: F_T = −μ(|v|) F_N sign(v), with a coefficient μ that rises from zero with the sliding speed v \[m/s\], so that
//! the force is continuous at v = 0.
//!
//! Source: Erkaya 2018, Eqs. 6–7, after the contact friction of MSC Adams (Bai & Zhao 2013). Departure: as printed,
//! Eq. 7 already carries the sign that Eq. 6 multiplies once more, so that the force points *along* the sliding and
//! feeds energy into the joint, and its middle branch runs from μ_d to μ_s instead of from μ_s to μ_d.
//! [`FrictionLaw::Corrected`] is the intended law; [`FrictionLaw::Printed`] is the printed one, for comparison.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Friction law: the friction coefficient as a function of the sliding speed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FrictionLaw {
    /// Cubic step 0 → μ_s on \[0, v_s\], cubic step μ_s → μ_d on \[v_s, v_d\], μ_d above. The law is continuously differentiable.
    #[default]
    Corrected,
    /// Ambrósio 2003: zero up to v_s, a ramp to μ_d at v_d, μ_d above. The law is continuous, with kinks at v_s and v_d.
    Ambrosio,
    /// Threlfall 1978: μ_d (1 − e^(−3|v|/v_d)). The law is continuous, and smooth except at v = 0.
    Threlfall,
    /// Erkaya 2018, Eq. 6 × Eq. 7 exactly as printed. Below v_s and above v_d the force points along the sliding. Between v_s and v_d the
    /// branch is reversed and has the opposite sign.
    Printed,
}

/// Friction of one contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactFriction {
    /// Which law.
    pub law: FrictionLaw,
    /// μ_s, ≥ 0.
    pub static_coefficient: f64,
    /// μ_d, ≥ 0.
    pub dynamic_coefficient: f64,
    /// v_s, m/s, > 0.
    pub static_speed: f64,
    /// v_d, m/s, > v_s.
    pub dynamic_speed: f64,
}

/// The cubic step from `h0` at `x0` to `h1` at `x1` (Adams' STEP): flat at both ends.
fn step(x: f64, x0: f64, h0: f64, x1: f64, h1: f64) -> f64 {
    let d = ((x - x0) / (x1 - x0)).clamp(0.0, 1.0);
    h0 + (h1 - h0) * d * d * (3.0 - 2.0 * d)
}

impl ContactFriction {
    /// Force on the journal along its sliding, N: opposite to `sliding_speed` (m/s) for every law but the printed one.
    ///
    /// `normal` is the normal force, N, ≥ 0.
    #[inline]
    pub fn force(&self, normal: f64, sliding_speed: f64) -> f64 {
        -self.coefficient(sliding_speed) * normal
    }

    /// The coefficient with the sign of the sliding speed: μ(|v|) sign(v), continuous at v = 0 but for `Printed`'s middle.
    pub fn coefficient(&self, v: f64) -> f64 {
        let (mu_s, mu_d, v_s, v_d) =
            (self.static_coefficient, self.dynamic_coefficient, self.static_speed, self.dynamic_speed);
        let speed = v.abs();
        let mu = match self.law {
            FrictionLaw::Corrected if speed < v_s => return step(v, -v_s, -mu_s, v_s, mu_s),
            FrictionLaw::Corrected => step(speed, v_s, mu_s, v_d, mu_d),
            FrictionLaw::Ambrosio => mu_d * ((speed - v_s) / (v_d - v_s)).clamp(0.0, 1.0),
            FrictionLaw::Threlfall => mu_d * (1.0 - (-3.0 * speed / v_d).exp()),
            FrictionLaw::Printed => return self.printed(v),
        };
        mu * v.signum()
    }

    /// Eq. 6 × Eq. 7 as printed, in the sign convention of [`Self::coefficient`]; the speed of Eq. 7 is |v|.
    ///
    /// Eq. 7: −μ_d above v_d; step(|v|, v_s, μ_d, v_d, μ_s) between; step(|v|, −v_s, μ_s, v_s, −μ_s) below.
    /// Eq. 6 multiplies by −v/|v| once more.
    fn printed(&self, v: f64) -> f64 {
        let (mu_s, mu_d, v_s, v_d) =
            (self.static_coefficient, self.dynamic_coefficient, self.static_speed, self.dynamic_speed);
        let speed = v.abs();
        let mu = if speed > v_d {
            -mu_d
        } else if speed >= v_s {
            step(speed, v_s, mu_d, v_d, mu_s)
        } else {
            step(speed, -v_s, mu_s, v_s, -mu_s)
        };
        mu * v.signum()
    }
}

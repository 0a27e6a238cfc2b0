//! Forces and motion of the chain, one file per question.
//!
//! All recursions use world axes and take moments about the origin of each link, with *classical* accelerations (the second
//! derivative of the position of that origin). So a vector passes from link to link without being turned, the motion
//! subspace of a revolute joint is its axis alone, and moments of small distal links keep their digits, which they would
//! lose about one origin at the base.
//!
//! With angular velocity ω, angular acceleration ω̇ and acceleration a of the link origin, Newton–Euler for a link of mass m,
//! first moment h = m·(centre of mass) and inertia J about the link origin reads
//! `f = m a + ω̇ × h + ω × (ω × h)` and `n = J ω̇ + h × a + ω × (J ω)`.

pub(crate) mod energy;
pub(crate) mod forward;
pub(crate) mod inverse;
pub(crate) mod mass_matrix;

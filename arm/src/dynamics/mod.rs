//! Forces and motion of the chain, one file per question.
//!
//! All recursions use world axes and moments about the origin of each link, with *classical* accelerations (the second derivative of the
//! position of that origin). A vector thus passes from link to link without rotation, and the motion subspace of a revolute joint is its
//! axis alone. Moments of small distal links also keep their digits, which moments about an origin at the base would lose.
//!
//! With angular velocity ω, angular acceleration ω̇ and acceleration a of the link origin, Newton–Euler for a link of mass m,
//! first moment h = m·(centre of mass) and inertia J about the link origin reads
//! `f = m a + ω̇ × h + ω × (ω × h)` and `n = J ω̇ + h × a + ω × (J ω)`.

pub(crate) mod energy;
pub(crate) mod forward;
pub(crate) mod inverse;
pub(crate) mod mass_matrix;

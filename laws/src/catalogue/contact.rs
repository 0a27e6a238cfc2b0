//! Temporary contact of the arm with an object that the model lacks, such as a table.
//!
//! Law: a force f \[N\] acts on the tool from t = start to end \[s\], with the tool near `point`; the joints rest at a distance from their
//! commands that depends on the stiffness of their servos: k (r − q) = g − Jᵀ f. It belongs to a recording, not to the machine.
//! Source: De Luca & Mattone 2005, ICRA, Eq. 4 (collisions as generalised forces Jᵀ f).

use super::commanded::{NO_TERMS, Unseen, no_shape};
use crate::kind::{Kind, Occurrence, Seen};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "contact",
    title: "contact",
    words: "contact from {start} to {end}[ with a force of {force} on the tool]",
    site: Site::Arm,
    parameters: &[
        Parameter::number("start", "start of the contact", "s", [-1e12, 1e12]).shape(),
        Parameter::number("end", "end of the contact", "s", [-1e12, 1e12]).shape(),
        Parameter::vector("point", "mean position of the tool, base frame", "m").or_else("not known"),
        Parameter::vector("force", "mean force on the tool in the base frame", "N").or_else("not known"),
    ],
    occurs: Occurrence::Common,
    tolerance: None,
    seen: Seen { torque: false, pose: false },
    rough: true,
    shakes: false,
    equation: "k (r − q) = g − Jᵀ f for start ≤ t < end",
    source: "De Luca & Mattone 2005, Eq. 4",
    signature: "for a time, several joints rest away from the positions of their servos, in the pattern Jᵀ f of one force",
    confounders: &[
        ("hard_stop", "is at one position of one joint"),
        ("payload", "acts at all times, and moves with the tool"),
        ("coulomb_friction", "acts during the whole motion"),
    ],
    contains: &[],
    needs: &[Need::Motion],
    terms: NO_TERMS,
    shapes: no_shape,
    build: |_| Ok(Box::new(Unseen)),
};

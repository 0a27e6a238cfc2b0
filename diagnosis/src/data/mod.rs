//! Data: the rows of all recordings, the part to which each row belongs, the tolerances of the machine, and the weights of the rows.

pub(crate) mod beside;
pub(crate) mod columns;
pub(crate) mod instruments;
pub(crate) mod linearised;
pub(crate) mod noise;
pub(crate) mod nuisances;
pub(crate) mod parts;
pub(crate) mod rows;
pub(crate) mod shapes;
pub(crate) mod stacked;
pub(crate) mod thinning;
pub(crate) mod tolerance;
pub(crate) mod weights;
pub(crate) mod whitening;

//! Model files: URDF and MJCF as found in the field, the TOML arm file of this project, and files for other tools.
//!
//! The nouns, in the order in which data passes through them:
//!
//! - [`Selection`]: the chain of a robot that is the arm: the chain to a given link, or the one whose joints have certain names
//!   ([`match_joints`]).
//! - [`ArmFile`]: the contents of a model file: an arm, the effects beyond the rigid body as an [`EffectTable`] each, and the unused parts
//!   ([`load`], [`load_selected`], [`parse_urdf`], [`parse_toml`], [`paper_arm`], [`to_toml`]); a file that can't be read is a
//!   [`ModelError`] with its place.
//! - [`export::Mechanism`]: an arm with elements beyond the rigid body, for the files of other tools ([`export::to_urdf`],
//!   [`export::to_mjcf`]).

mod arm_file;
mod chain;
mod error;
pub mod export;
mod fold;
mod load;
mod mjcf;
mod names;
mod numbers;
mod plausible;
mod prefixes;
mod robot;
mod text;
mod toml_read;
mod toml_tables;
mod toml_write;
mod urdf;
mod urdf_inertial;
mod urdf_joint;
mod urdf_tree;
mod urdf_xml;

pub use arm_file::{ArmFile, EffectTable, Selection};
pub use error::{MAX_FILE_BYTES, ModelError};
pub use load::{load, load_selected, paper_arm};
pub use names::match_joints;
pub use toml_read::parse_toml;
pub use toml_write::to_toml;
pub use urdf::{parse_urdf, parse_urdf_selected};

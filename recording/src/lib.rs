//! Recordings of an arm: read from files of many kinds, written as CSV, MCAP and Parquet, with one set of column names.
//!
//! Units are SI, angles are radians. In the order in which data passes through them:
//!
//! - a [`Layout`] is the list of columns that a recorder is going to write;
//! - a [`RowWriter`] writes one row per tick as it comes: a [`CsvWriter`] or a [`McapWriter`], which also keeps [`Event`]s and metadata and survives a kill;
//! - a [`Summary`] describes the written file, a [`WriteError`] a failure;
//! - [`read`] turns a file or a folder of any kind into a [`Recording`]: text with columns, bags, tables of other programs; a [`ReadError`] names the [`Place`] (file
//!   and [`Row`]), the column, the value and the remedy; a [`ColumnError`] is about the header alone;
//! - a [`Recording`] holds the columns by their meaning, sorted into [`Group`]s; [`Absent`] is the error for a missing column;
//! - [`export`] writes a recording again, as CSV, MCAP or Parquet; [`export_columns`] any columns of numbers as Parquet;
//! - [`import`] reads a foreign recording with [`ImportOptions`]: by a [`Mapping`] (a [`MappingError`] names a misfit) or, for a bag, by [`BagOptions`].
//!   Without a mapping it guesses one from the names of the columns. [`import_csv`] and [`import_bag`] each do one of these;
//! - [`Recording::for_joints`] pairs its joints with those of an arm by name; a [`JointsError`] names a missing joint.
//!
//! | column | meaning | unit |
//! | --- | --- | --- |
//! | `t` | time, increasing, may be jittered | s |
//! | `q1`…`qn` | joint position as the robot's own encoder reads it | rad |
//! | `qd1`…`qdn` | joint velocity (optional) | rad/s |
//! | `tau1`…`taun` | joint torque as the robot measures it (optional) | N·m |
//! | `q_ref1`…`q_refn` | commanded position (optional) | rad |
//! | `q_link1`… | link-side encoder (optional) | rad |
//! | `x`, `y`, `z` | tool position of frame `tool0` in the base frame (optional) | m |
//! | `qx`, `qy`, `qz`, `qw` | its orientation (optional) | – |
//! | others | kept, not used | – |

mod arrays;
mod bag;
mod bag_folder;
mod bag_reader;
mod cells;
mod corrections;
mod csv_columns;
mod csv_form;
mod csv_reader;
mod csv_writer;
mod error;
mod foreign;
mod guess;
mod input;
mod interpret;
mod joint_states;
mod joints;
mod layout;
mod lerobot;
mod line_guard;
mod mapped;
mod mapping;
mod mapping_error;
mod mapping_text;
mod mat_reader;
mod mcap_checksum;
mod mcap_chunk;
mod mcap_losses;
mod mcap_reader;
mod mcap_records;
mod mcap_window;
mod mcap_writer;
mod messages;
mod missing;
mod names;
mod npz_reader;
mod open;
mod output;
mod overview;
mod parquet_claims;
mod parquet_reader;
mod parquet_writer;
mod place;
mod read;
mod recording;
mod ros1_bag;
mod sources;
mod sqlite_bag;
mod squeeze;
mod table;
mod thrift;
mod tick;
mod time_order;
mod tool_track;
mod units;
mod write;

pub use corrections::{shifted, unwrapped};
pub use csv_writer::CsvWriter;
pub use error::{ReadError, WriteError};
pub use input::MAX_NUMBERS;
pub use joint_states::{BagOptions, import_bag};
pub use joints::JointsError;
pub use layout::{Layout, Summary};
pub use mapping::Mapping;
pub use mapping_error::MappingError;
pub use mcap_writer::McapWriter;
pub use names::{ColumnError, Group};
pub use parquet_writer::export_columns;
pub use place::{Place, Row};
pub use read::{ImportOptions, import, import_csv, read, read_from, read_overview};
pub use recording::{Absent, Event, Recording};
pub use sources::{Quantity, Sources};
pub use write::{RowWriter, export};

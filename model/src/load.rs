//! Reading a model file: its format comes from its extension.

use std::path::Path;

use freeplay_arm::Place;

use crate::arm_file::{ArmFile, Selection};
use crate::error::{ModelError, shortened};
use crate::text::read_text;
use crate::toml_read::{parse, parse_toml};
use crate::urdf::parse_urdf_selected;

/// Reads a model file with the default choice of the arm: see [`load_selected`].
///
/// # Errors
/// [`ModelError`] with file, line, column, value and remedy.
pub fn load(path: &Path) -> Result<ArmFile, ModelError> {
    load_selected(path, &Selection::default())
}

/// Reads a model file: `.urdf`, `.xml` or `.mjcf` as URDF or MJCF, whichever its root element is; `.toml` as an arm file.
///
/// # Errors
/// [`ModelError`] with file, line, column, value and remedy.
pub fn load_selected(path: &Path, selection: &Selection) -> Result<ArmFile, ModelError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    match extension.as_str() {
        "urdf" | "xml" | "mjcf" => {
            parse_urdf_selected(&read_text(path)?, &path.display().to_string(), selection)
        }
        "toml" => parse(&read_text(path)?, path, selection),
        "xacro" => Err(ModelError::Xacro {
            at: Place::start(&path.display().to_string()),
            found: "the file name".to_owned(),
        }),
        _ => Err(ModelError::UnknownExtension { path: shortened(&path.display().to_string()) }),
    }
}

/// The arm of Erkaya (2018), Table 1, with six joints: the file `arms/erkaya2018.toml` of this crate.
pub fn paper_arm() -> ArmFile {
    parse_toml(include_str!("../arms/erkaya2018.toml"), Path::new("erkaya2018.toml"))
        .expect("the arm file inside the program is valid")
}

//! Writes `docs/messages.md` and `docs/freeplay.h` from the message types. Run it after every change of a type.

use std::path::Path;

use freeplay_shm::layout_text::{c_header, markdown};

fn main() -> std::io::Result<()> {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    std::fs::write(docs.join("messages.md"), markdown())?;
    std::fs::write(docs.join("freeplay.h"), c_header())
}

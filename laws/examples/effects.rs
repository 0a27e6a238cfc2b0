//! Writes `docs/effects.md` from the laws: run it after changing one.

use std::path::Path;

fn main() -> std::io::Result<()> {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    std::fs::write(docs.join("effects.md"), freeplay_laws::manual())
}

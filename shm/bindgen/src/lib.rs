//! An empty crate that replaces bindgen, which saves the compilation of sixteen packages.
//!
//! The build script of `iceoryx2-pal-posix` calls bindgen only for a QNX target, but cargo cannot make a dependency conditional on that
//! for a build script. For a build on QNX, remove the `[patch]` from the workspace's manifest.

//! An empty crate in the place of bindgen: sixteen packages less to compile.
//!
//! The build script of `iceoryx2-pal-posix` calls bindgen where the system is QNX, and cargo has no dependencies for a system that a build
//! script runs for. A build on QNX takes the `[patch]` out of the workspace's manifest.

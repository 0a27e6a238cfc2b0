//! Controllers: the SDK, the built-in controllers and the compensation QP.

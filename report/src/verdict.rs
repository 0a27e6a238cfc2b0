//! A verdict and its sign.

/// A verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// As it should be.
    Ok,
    /// It works, but the reader should know about it.
    Warn,
    /// Not as it should be.
    Fail,
    /// Neither good nor bad.
    Info,
}

impl Verdict {
    /// [`Verdict::Ok`] or [`Verdict::Fail`].
    #[must_use]
    pub fn passed(ok: bool) -> Self {
        if ok { Self::Ok } else { Self::Fail }
    }

    /// Its word in pages.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Warn => "warn",
            Self::Fail => "fail",
            Self::Info => "info",
        }
    }
}

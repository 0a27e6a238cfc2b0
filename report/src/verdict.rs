//! A verdict and its sign.

/// How something came out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// As it should be.
    Ok,
    /// Works, but the reader should know.
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

    /// The word it is shown with.
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

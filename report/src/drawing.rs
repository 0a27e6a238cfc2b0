//! Drawings: figures that are drawn once, as SVG, and look the same on paper as on the screen.

use crate::chart::Chart;

/// A figure of one or more panels, drawn as SVG: no script, nothing to zoom, and a caption that says what is seen.
///
/// A panel is a [`Chart`]; its title stands above it and its note below. Values are spread evenly along both axes,
/// whatever the axis' scale; [`crate::Style::Bars`] are drawn as strokes from zero. Group and cursor have no meaning here.
#[derive(Debug, Clone, Default)]
pub struct Drawing {
    /// The caption's first words: what the figure shows. The figure's number stands before it.
    pub title: String,
    /// What is seen, and which run it is; may be empty.
    pub caption: String,
    /// The panels, in the order in which they are read.
    pub panels: Vec<Chart>,
    /// Whether panels stand side by side where the window is wide enough, else one below the other.
    pub beside: bool,
}

impl Drawing {
    /// A drawing without panels.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), ..Self::default() }
    }

    /// Sets the caption.
    #[must_use]
    pub fn caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    /// Adds a panel.
    #[must_use]
    pub fn panel(mut self, panel: Chart) -> Self {
        self.panels.push(panel);
        self
    }

    /// Puts the panels side by side.
    #[must_use]
    pub fn beside(mut self) -> Self {
        self.beside = true;
        self
    }
}

//! Drawings: figures drawn once, as SVG, that look the same on paper as on the screen.

use crate::chart::Chart;

/// A figure of one or more panels, drawn as SVG: no script, no zoom, and a caption with its content.
///
/// A panel is a [`Chart`]; its title is above it and its note below. Both axes are linear, whatever the axis' scale; [`crate::Style::Bars`] become strokes from
/// zero. A drawing ignores groups and the cursor.
#[derive(Debug, Clone, Default)]
pub struct Drawing {
    /// The first words of the caption, after the figure's number.
    pub title: String,
    /// Content of the figure, and its run; may be empty.
    pub caption: String,
    /// The panels, in reading order.
    pub panels: Vec<Chart>,
    /// True if panels are side by side if the window is wide enough, else one below the other.
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

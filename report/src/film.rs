//! Films: figures whose parts move, played over time.

/// A figure whose parts move. The report draws one frame as SVG, so that a printed page shows it, too. A small script plays the film and
/// stops at any frame.
#[derive(Debug, Clone, Default)]
pub struct Film {
    /// Title above the film.
    pub title: String,
    /// Caption with the content and the scale; may be empty.
    pub caption: String,
    /// Time of each frame, s; increasing. Frames may lie closer together where more happens.
    pub times: Vec<f64>,
    /// Frame that the page shows until a reader plays the film.
    pub first: usize,
    /// Scenes side by side.
    pub scenes: Vec<Scene>,
}

/// One picture of a film, with equal axes.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// Title above the scene.
    pub title: String,
    /// Least and greatest horizontal value in view, in any unit.
    pub x: [f64; 2],
    /// Least and greatest vertical value in view, in the same unit.
    pub y: [f64; 2],
    /// Lines that do not move; the flag of each says whether the line is closed.
    pub still: Vec<(Vec<[f64; 2]>, bool)>,
    /// Moving parts, the first at the bottom.
    pub moving: Vec<Moving>,
    /// Names of the states of the scene; empty for none.
    pub states: Vec<String>,
    /// Index of the state in `states`, by frame.
    pub state: Vec<usize>,
}

/// A part that moves: a line with joints, or a dot with the trail that it leaves.
#[derive(Debug, Clone, Default)]
pub struct Moving {
    /// Name of the series whose colour the part has; empty for a pale part.
    pub name: String,
    /// Points by frame, equally many in each.
    pub frames: Vec<Vec<[f64; 2]>>,
    /// Length of a dot's trail, in frames; 0 for a line.
    pub trail: usize,
}

impl Film {
    /// A film of frames at `times`, s.
    #[must_use]
    pub fn new(title: impl Into<String>, times: Vec<f64>) -> Self {
        Self { title: title.into(), times, ..Self::default() }
    }

    /// Adds a scene.
    #[must_use]
    pub fn scene(mut self, scene: Scene) -> Self {
        self.scenes.push(scene);
        self
    }
}

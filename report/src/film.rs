//! Films: figures whose parts move, played over time.

/// A figure whose parts move. It is drawn as SVG, as a still that also paper shows; a small script plays it, and stops at any frame.
#[derive(Debug, Clone, Default)]
pub struct Film {
    /// What the film shows; stands above it.
    pub title: String,
    /// What is seen, and at which scale; may be empty.
    pub caption: String,
    /// The time of each frame, s; increasing. They need not be evenly spread: more of them where more happens.
    pub times: Vec<f64>,
    /// The frame that is seen until somebody plays the film.
    pub first: usize,
    /// What is seen side by side.
    pub scenes: Vec<Scene>,
}

/// One picture of a film, with equal axes.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// What it shows; stands above it.
    pub title: String,
    /// What is in view: least and greatest value across, in any unit.
    pub x: [f64; 2],
    /// Least and greatest value upwards, in the same unit.
    pub y: [f64; 2],
    /// Lines that do not move, each with whether it is closed.
    pub still: Vec<(Vec<[f64; 2]>, bool)>,
    /// What moves, the first at the bottom.
    pub moving: Vec<Moving>,
    /// The states that it can be in, in words; empty for none.
    pub states: Vec<String>,
    /// The place of its state in `states`, by frame.
    pub state: Vec<usize>,
}

/// A part that moves: a line with joints, or a dot with the trail that it leaves.
#[derive(Debug, Clone, Default)]
pub struct Moving {
    /// The name whose colour it has, as that of a series; empty for a pale one.
    pub name: String,
    /// Its points, by frame, as many in each.
    pub frames: Vec<Vec<[f64; 2]>>,
    /// Of a dot, how many frames back its trail goes; 0 for a line.
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

//! Films: the still as SVG, and the positions of all moving parts as data for the script.

use maud::{Markup, html};
use serde::Serialize;

use super::Context;
use super::inline::inline;
use crate::colours::PALETTE;
use crate::film::{Film, Moving, Scene};

/// Width of a scene in its own units, which are about CSS pixels.
const WIDTH: f64 = 400.0;
/// Radius of the dots of joints, and of the dot that leaves a trail.
const DOTS: [f64; 2] = [2.6, 5.0];
/// Points outside the scene are clamped to this distance; undefined points get it, too.
const AWAY: f64 = 1e4;

/// Data for the script.
#[derive(Serialize)]
struct Data<'a> {
    times: Vec<f64>,
    first: usize,
    scenes: Vec<SceneData<'a>>,
}

#[derive(Serialize)]
struct SceneData<'a> {
    moving: Vec<MovingData>,
    states: &'a [String],
    state: &'a [usize],
}

/// The positions of one part: x and y of its points alternating, frame after frame.
#[derive(Serialize)]
struct MovingData {
    trail: usize,
    frames: Vec<Vec<f64>>,
}

/// A film with its controls.
pub(crate) fn film(film: &Film, context: &Context<'_>) -> Markup {
    let first = film.first.min(film.times.len().saturating_sub(1));
    let data = Data {
        times: film.times.iter().map(|time| (time * 1e4).round() / 1e4).collect(),
        first,
        scenes: film.scenes.iter().map(scene_data).collect(),
    };
    let json = serde_json::to_string(&data).unwrap_or_default().replace('<', "\\u003c");
    html! {
        figure.film {
            figcaption { (inline(&film.title)) }
            div.controls hidden {
                button type="button" { "Play" }
                input type="range" min="0" max=(film.times.len().saturating_sub(1)) value=(first) aria-label="Frame";
                select aria-label="Speed" {
                    @for (value, words) in [("1", "1 ×"), ("0.25", "1/4 ×"), ("0.05", "1/20 ×"), ("0.01", "1/100 ×")] {
                        option value=(value) selected[value == "0.05"] { (words) }
                    }
                }
                output { (format!("{:.3} s", film.times.get(first).copied().unwrap_or(0.0))) }
            }
            div.panels.beside { @for scene in &film.scenes { (one(scene, first, context)) } }
            script type="application/json" { (maud::PreEscaped(json)) }
            @if !film.caption.is_empty() { p.note { (inline(&film.caption)) } }
        }
    }
}

/// Conversion from the scene's unit to its SVG: scale, and height.
fn measure(scene: &Scene) -> (f64, f64) {
    let scale = WIDTH / (scene.x[1] - scene.x[0]).max(f64::MIN_POSITIVE);
    (scale, (scene.y[1] - scene.y[0]) * scale)
}

fn placed(scene: &Scene, [x, y]: [f64; 2]) -> [f64; 2] {
    let (scale, _) = measure(scene);
    let tenth = |value: f64| match value.is_finite() {
        true => (value.clamp(-AWAY, AWAY) * 10.0).round() / 10.0,
        false => -AWAY,
    };
    [tenth((x - scene.x[0]) * scale), tenth((scene.y[1] - y) * scale)]
}

fn scene_data(scene: &Scene) -> SceneData<'_> {
    let places = |points: &Vec<[f64; 2]>| points.iter().flat_map(|&point| placed(scene, point)).collect();
    let moving = scene
        .moving
        .iter()
        .map(|moving| MovingData { trail: moving.trail, frames: moving.frames.iter().map(places).collect() });
    SceneData { moving: moving.collect(), states: &scene.states, state: &scene.state }
}

fn one(scene: &Scene, first: usize, context: &Context<'_>) -> Markup {
    let (_, height) = measure(scene);
    let state = scene.state.get(first).and_then(|&state| scene.states.get(state));
    html! {
        div.panel.scene {
            p.panel-title { (inline(&scene.title)) }
            svg viewBox=(format!("0 0 {WIDTH} {height:.1}")) role="img" aria-label=(scene.title) {
                @for (line, closed) in &scene.still {
                    @let points = listed(scene, line);
                    @if *closed { polygon.still points=(points) {} } @else { polyline.still points=(points) {} }
                }
                @for moving in &scene.moving { (part(scene, moving, first, context)) }
            }
            @if !scene.states.is_empty() { p.state { (state.map_or("", String::as_str)) } }
        }
    }
}

fn listed(scene: &Scene, points: &[[f64; 2]]) -> String {
    let each = points.iter().map(|&point| placed(scene, point)).map(|[x, y]| format!("{x},{y}"));
    each.collect::<Vec<_>>().join(" ")
}

fn part(scene: &Scene, moving: &Moving, first: usize, context: &Context<'_>) -> Markup {
    let class = match context.colours.index(&moving.name) {
        Some(place) => format!("moving series-{}", place % PALETTE),
        None => "moving pale".to_owned(),
    };
    let frame = moving.frames.get(first).map(Vec::as_slice).unwrap_or_default();
    let line: Vec<[f64; 2]> = match moving.trail {
        0 => frame.to_vec(),
        trail => {
            let from = first.saturating_sub(trail);
            moving.frames.get(from..=first).unwrap_or_default().iter().flatten().copied().collect()
        }
    };
    let radius = DOTS[usize::from(moving.trail > 0)];
    html! {
        g class=(class) {
            polyline points=(listed(scene, &line)) {}
            @for &point in frame {
                @let [x, y] = placed(scene, point);
                circle cx=(x) cy=(y) r=(radius) {}
            }
        }
    }
}

//! The picture of a finding: the residual without it and with it, over the variable that shows it best, with the fitted law.

use std::f64::consts::TAU;

use freeplay_arm::Arm;
use freeplay_laws::{BearingLoad, Clearance, Effects, tool_sensitivity};
use freeplay_report::units::{display_unit, written};
use freeplay_report::{Axis, Chart, Drawing, Series};

use super::points::{Over, Points, best_plot_variable, column, forwards, law, line, traces};
use crate::search::tried::LISTED;
use crate::sorting::sort_falling;
use crate::statistics::SIGNIFICANT;
use crate::{Diagnosis, Effect, Map};

/// Least share of the law's square that a rotation of the joint explains for drawing the tool's error as an angle of the joint: most of it, since the picture
/// does not show the rest.
const TURNS: f64 = 0.7;
/// Least lever of the tool about a joint for drawing its error as an angle of the joint, as a share of the greatest: a shorter one amplifies the noise more
/// than threefold.
const LEVER: f64 = 0.3;
/// Points of the drawn law: a curve of 90 chords looks smooth at the width of a panel.
const LINE: usize = 90;

const FIT: &str = "data of the fit";
const HELD: &str = "held-out data";
const LAW: &str = "the fitted law";

/// The pictures of the effect number `index`.
pub fn of(diagnosis: &Diagnosis, arm: &Arm, index: usize) -> Vec<Drawing> {
    let effect = &diagnosis.effects[index];
    let joint = effect.joint.as_deref().and_then(|name| arm.joint_index(name));
    if let Some(joint) = joint {
        let special =
            in_the_bearing(diagnosis, arm, index, joint).or_else(|| as_angle(diagnosis, arm, index, joint));
        if let Some(drawing) = special {
            return vec![drawing];
        }
    }
    let mut channels: Vec<(f64, &String)> =
        effect.evidence.channels.iter().map(|channel| (weight(diagnosis, index, channel), channel)).collect();
    sort_falling(&mut channels, |(size, _)| *size);
    let strongest = channels.into_iter().take(LISTED);
    strongest.filter_map(|(_, channel)| in_channel(diagnosis, arm, index, channel)).collect()
}

/// Size of the law relative to the noise in a channel.
fn weight(diagnosis: &Diagnosis, effect: usize, channel: &str) -> f64 {
    let law = Points::of(diagnosis, effect, channel).law;
    let square: f64 = law.iter().filter(|x| x.is_finite()).map(|x| x * x).sum();
    let floor = diagnosis.fit.as_ref().and_then(|fit| fit.noise_floor.get(channel));
    square.sqrt() / floor.map_or(1.0, |floor| floor.rmse.max(f64::MIN_POSITIVE))
}

/// Two panels with the same axes: without the effect and with it.
fn pair(points: &Points, over: &Over, y: (&str, &str), title: String, caption: String) -> Drawing {
    let (x_scale, x_unit) = display_unit(&over.unit, magnitude(&over.x));
    let without = points.without();
    let (scale, unit) = display_unit(y.1, magnitude(&without));
    let x: Vec<f64> = over.x.iter().map(|x| x * x_scale).collect();
    let up = |column: &[f64]| -> Vec<f64> { column.iter().map(|y| y * scale).collect() };
    let (without, with, law) = (up(&without), up(&points.with), up(&points.law));
    let (low, high) = extent(&without);
    let panel = |title: &str, y_values: &[f64]| {
        let across = Axis::new(over.name.clone(), x_unit.clone());
        let chart = Chart::xy(title, across, Axis::new(y.0, unit.clone())).height(300);
        clouds(chart, &x, y_values, &points.held_out).in_view(low).in_view(high)
    };
    let mut before = panel("without the effect", &without);
    match &over.forwards {
        None => {
            let (at, mean) = line(&x, &law, |_| true, LINE);
            before = before.series(Series::line(LAW, &at, &mean));
        }
        Some(forwards) => {
            let (at, mean) = line(&x, &law, |k| forwards[k], LINE);
            before = before.series(Series::line(format!("{LAW}, forwards"), &at, &mean).like(LAW));
            let (at, mean) = line(&x, &law, |k| !forwards[k], LINE);
            before = before.series(Series::line(format!("{LAW}, backwards"), &at, &mean).like("backwards"));
        }
    }
    let after = panel("with the effect", &with);
    let zero = [
        x.iter().copied().fold(f64::INFINITY, f64::min),
        x.iter().copied().fold(f64::NEG_INFINITY, f64::max),
    ];
    let after = after.series(Series::line("zero residual", &zero, &[0.0, 0.0]).dashed());
    Drawing::new(title).caption(caption).beside().panel(before).panel(after)
}

/// The points of the fit and the held-out ones.
fn clouds(chart: Chart, x: &[f64], y: &[f64], held_out: &[bool]) -> Chart {
    let part = |held: bool| -> (Vec<f64>, Vec<f64>) {
        let own = (0..x.len()).filter(|&k| held_out[k] == held && x[k].is_finite() && y[k].is_finite());
        own.map(|k| (x[k], y[k])).unzip()
    };
    let ((x_fit, y_fit), (x_held, y_held)) = (part(false), part(true));
    chart.series(Series::points(FIT, &x_fit, &y_fit)).series(Series::points(HELD, &x_held, &y_held))
}

fn extent(values: &[f64]) -> (f64, f64) {
    let finite = values.iter().copied().filter(|x| x.is_finite());
    finite.fold((0.0, 0.0), |(low, high): (f64, f64), x| (low.min(x), high.max(x)))
}

/// The greatest size of `values`.
fn magnitude(values: &[f64]) -> f64 {
    let (low, high) = extent(values);
    high.max(-low)
}

/// One channel over the variable in which the law shows most clearly; over the phase if the law is periodic.
fn in_channel(diagnosis: &Diagnosis, arm: &Arm, index: usize, channel: &str) -> Option<Drawing> {
    let effect = &diagnosis.effects[index];
    let unit = traces(diagnosis, channel).next()?.1.unit;
    let points = Points::of(diagnosis, index, channel);
    let over = match periodic(diagnosis, arm, effect) {
        Some(over) => over,
        None => best_plot_variable(diagnosis, &seats(arm, effect, channel), &points.law)?,
    };
    let title = format!("{} over the {}", described(channel), over.name);
    let caption = format!(
        "Left: residual of the tuned model with all other findings, and the law {}. Right: residual with this law, on the same scale.",
        effect.equation
    );
    Some(pair(&points, &over, (&format!("residual of {channel}"), unit), title, caption))
}

/// The joints whose motion a picture of the effect uses: its own; for an effect of the whole arm, that of the channel, or all.
fn seats(arm: &Arm, effect: &Effect, channel: &str) -> Vec<usize> {
    let named = |name: &str| arm.joint_index(name);
    let other = effect.parameters.get("with").and_then(|other| other.value.as_str()).and_then(named);
    if let Some(own) = effect.joint.as_deref().and_then(named) {
        return std::iter::once(own).chain(other).collect();
    }
    let number = channel.trim_start_matches(|c: char| !c.is_ascii_digit()).parse::<usize>();
    match number {
        Ok(number) if number > 0 && number <= arm.dof() => vec![number - 1],
        _ => (0..arm.dof()).collect(),
    }
}

/// The phase of a law with the given number of `periods` in a turn.
fn periodic(diagnosis: &Diagnosis, arm: &Arm, effect: &Effect) -> Option<Over> {
    let periods = effect.parameters.get("periods")?.value.as_float()?;
    let name = effect.joint.as_deref()?;
    let joint = arm.joint_index(name)?;
    let x = column(diagnosis, &format!("position of {name}"));
    let both = effect.kind == "position_dependent_friction";
    Some(Over {
        name: format!("phase of the period, {} periods a rotation of {name}", written(periods)),
        unit: "°".to_owned(),
        x: x.iter().map(|q| (periods * q).rem_euclid(TAU).to_degrees()).collect(),
        forwards: both.then(|| forwards(diagnosis, joint)),
    })
}

/// `tau3`: torque tau3.
fn described(channel: &str) -> String {
    if channel.starts_with("tau") {
        format!("torque {channel}")
    } else if channel.starts_with("q_link") {
        format!("link encoder {channel}")
    } else {
        format!("tool position {channel}")
    }
}

/// The three tool channels with all their columns, passage by passage, projected by `onto` from three values a row to one.
fn projected(
    diagnosis: &Diagnosis,
    index: usize,
    mut onto: impl FnMut(usize, usize, [f64; 3]) -> f64,
) -> Option<Points> {
    let mut points = Points::default();
    for (number, passage) in diagnosis.passages.iter().enumerate() {
        let axis = |name: &str| passage.traces.iter().find(|trace| trace.channel == name);
        let tool = [axis("x")?, axis("y")?, axis("z")?];
        let laws = tool.map(|trace| law(trace, index));
        let points_of = 0..passage.motion.len();
        let with: Vec<f64> =
            points_of.clone().map(|k| onto(number, k, tool.map(|trace| trace.after[k]))).collect();
        let said: Vec<f64> = points_of.map(|k| onto(number, k, laws.each_ref().map(|law| law[k]))).collect();
        points.push(passage, &with, &said);
    }
    Some(points)
}

fn shows_in_tool(effect: &Effect) -> bool {
    effect.evidence.channels.iter().any(|channel| ["x", "y", "z"].contains(&channel.as_str()))
}

/// The tool's error as an angle of `joint`, if the law rotates it.
fn as_angle(diagnosis: &Diagnosis, arm: &Arm, index: usize, joint: usize) -> Option<Drawing> {
    let effect = &diagnosis.effects[index];
    if !shows_in_tool(effect) {
        return None;
    }
    let levers: Vec<[Vec<f64>; 3]> = diagnosis
        .passages
        .iter()
        .map(|passage| tool_sensitivity(arm, &passage.motion.q).swap_remove(joint))
        .collect();
    let square = |[x, y, z]: &[Vec<f64>; 3], k: usize| x[k] * x[k] + y[k] * y[k] + z[k] * z[k];
    let longest = levers
        .iter()
        .flat_map(|lever| (0..lever[0].len()).map(move |k| square(lever, k)))
        .fold(0.0, f64::max);
    let (mut turned, mut all) = (0.0, 0.0);
    let points = projected(diagnosis, index, |number, k, row| {
        let lever = &levers[number];
        let long = square(lever, k);
        if long < LEVER * LEVER * longest || long <= 0.0 {
            return f64::NAN;
        }
        (0..3).map(|axis| lever[axis][k] * row[axis]).sum::<f64>() / long
    })?;
    let mut at = 0;
    for (passage, lever) in diagnosis.passages.iter().zip(&levers) {
        for trace in passage.traces.iter().filter(|trace| ["x", "y", "z"].contains(&trace.channel.as_str())) {
            let said = law(trace, index);
            all += (0..said.len())
                .filter(|&k| points.law[at + k].is_finite())
                .map(|k| said[k] * said[k])
                .sum::<f64>();
        }
        for k in 0..passage.motion.len() {
            let angle = points.law[at + k];
            turned += if angle.is_finite() { angle * angle * square(lever, k) } else { 0.0 };
        }
        at += passage.motion.len();
    }
    if all <= 0.0 || turned < TURNS * all {
        return None;
    }
    let over = best_plot_variable(diagnosis, &[joint], &points.law)?;
    let name = &arm.joints()[joint].name;
    let title = format!("Tool error as a rotation of {name}, over the {}", over.name);
    let caption = format!(
        "Tool error along a rotation of {name}, divided by the lever arm. Left: residual of the tuned model with all other findings, and the law {}. Right: residual with this law, on the same scale.",
        effect.equation
    );
    Some(pair(&points, &over, (&format!("rotation of {name}"), "rad"), title, caption))
}

/// The position of the journal in its bearing, from the tool.
fn in_the_bearing(diagnosis: &Diagnosis, arm: &Arm, index: usize, joint: usize) -> Option<Drawing> {
    let effect = &diagnosis.effects[index];
    let radius = effect.parameters.get("clearance")?.value.as_float()?;
    let play = bearing(diagnosis, joint)?;
    if !shows_in_tool(effect) {
        return None;
    }
    let mut load = BearingLoad::new(arm, joint, play).ok()?;
    let mut along = |slide: usize| {
        projected(diagnosis, index, |number, k, row| {
            let motion = &diagnosis.passages[number].motion;
            let [q, v, a] = &mut load.motion;
            motion.at(k, q, v, a);
            load.force();
            let way = load.moved(if slide == 0 { [1.0, 0.0] } else { [0.0, 1.0] });
            way.iter().zip(row).map(|(way, row)| way * row).sum()
        })
    };
    let (u, v) = (along(0)?, along(1)?);
    let (scale, unit) = display_unit("m", radius);
    let up = |column: Vec<f64>| -> Vec<f64> { column.iter().map(|x| x * scale).collect() };
    let panel = |title: &str, x: Vec<f64>, y: Vec<f64>| {
        let axis = |name: &str| Axis::new(name, unit.clone());
        let chart = Chart::xy(
            title,
            axis("across the axis, first direction"),
            axis("across the axis, second direction"),
        )
        .equal_axes()
        .series(Series::circle("clearance", (0.0, 0.0), radius * scale).dashed());
        clouds(chart, &up(x), &up(y), &u.held_out)
    };
    let said = Series::points(LAW, &up(u.law.clone()), &up(v.law.clone()));
    let name = &arm.joints()[joint].name;
    Some(
        Drawing::new(format!("Tool error in the plane perpendicular to the axis of {name}"))
            .caption("View along the axis of the joint, in the frame of the link before it. Left: residual of the tuned model with all other findings; it lies where the load presses the journal onto its bearing. Right: residual with the play in the model, on the same scale.")
            .beside()
            .panel(panel("without the effect", u.without(), v.without()).series(said))
            .panel(panel("with the effect", u.with.clone(), v.with.clone())),
    )
}

/// The clearance of `joint` in the diagnosed model.
fn bearing(diagnosis: &Diagnosis, joint: usize) -> Option<Clearance> {
    let effects = Effects::of(&diagnosis.model).ok()?;
    effects.clearances.iter().find(|(at, _)| *at == joint).map(|(_, clearance)| *clearance)
}

/// The strongest map of the tuned model's residual, in words and as a picture; `None` if chance explains such a map.
pub fn strongest_map(diagnosis: &Diagnosis) -> Option<Drawing> {
    let place = diagnosis.location.first()?;
    // The direction has only two bars: the velocity shows the same and more.
    let drawable =
        |map: &&Map| place.channels.contains(&map.channel) && map.mean.len() > 2 && map.p < SIGNIFICANT;
    let near = diagnosis.maps.iter().filter(drawable);
    let map: &Map = near.min_by(|a, b| a.p.total_cmp(&b.p).then(b.explained.total_cmp(&a.explained)))?;
    let (x_scale, x_unit) = display_unit(map.variable_unit, magnitude(&map.at));
    let (scale, unit) = display_unit(map.unit, magnitude(&map.mean));
    let x: Vec<f64> = map.at.iter().map(|x| x * x_scale).collect();
    let y: Vec<f64> = map.mean.iter().map(|y| y * scale).collect();
    let chart = Chart::xy(
        "",
        Axis::new(map.variable.clone(), x_unit),
        Axis::new(format!("residual of {}, mean", map.channel), unit),
    )
    .height(260)
    .in_view(0.0)
    .series(Series::points("mean in each twelfth of the samples", &x, &y))
    .series(Series::line("", &x, &y).like("mean in each twelfth of the samples"));
    let caption = format!(
        "The strongest such dependence: it explains {:.0} % of the tuned model's residual in {} on the data of the fit (p = {}).",
        100.0 * map.explained,
        map.channel,
        written(map.p)
    );
    Some(
        Drawing::new(format!("The residual of {} follows the {}", map.channel, map.variable))
            .caption(caption)
            .panel(chart),
    )
}

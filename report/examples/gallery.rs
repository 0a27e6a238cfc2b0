//! Every kind of block in one page, with invented data: `cargo run -p freeplay-report --example gallery -- out/gallery.html`.

use std::error::Error;
use std::f64::consts::{PI, TAU};
use std::path::PathBuf;

use freeplay_report::text::{Digits, number};
use freeplay_report::{
    Axis, Block, Cell, Chart, Column, Document, Drawing, Figure, Mark, Section, Series, Table, Verdict,
};

const CONTROLLERS: [&str; 3] = ["computed-torque", "quasi-static", "narx-qp"];
const REMAINDER: [f64; 3] = [0.599, 0.011, 0.008];
const CLEARANCE_MM: f64 = 0.6;
const SECONDS: u32 = 12;

fn main() -> Result<(), Box<dyn Error>> {
    let path: PathBuf = std::env::args_os().nth(1).ok_or("usage: gallery FILE")?.into();
    gallery().write(&path)?;
    println!("{}: {} kB", path.display(), std::fs::metadata(&path)?.len() / 1000);
    Ok(())
}

fn gallery() -> Document {
    Document::new("Paper arm, three controllers")
        .subtitle("joint_5 c = 0.60 mm · smooth path, T = 12 s · 1 kHz, real time · 2026-11-21 10:12 · every number here is invented")
        .overview((Verdict::Ok, "narx-qp takes 98.7 % of the deviation out; no deadline was missed."))
        .overview((Verdict::Warn, "SCHED_FIFO refused: tails above 1 ms are not the controllers' (`freeplay doctor`)."))
        .overview(figures())
        .overview(controllers())
        .section(deviation())
        .section(contact())
        .section(torques())
        .section(latencies())
        .section(reference_runs())
        .section(Section::new("A drawing").with(drawing()))
        .section(odds_and_ends())
        .footer("configuration 3f9c1a07 · seed 8821 · `freeplay run --period 12`")
}

/// Tick times in s.
fn ticks() -> Vec<f64> {
    (0..SECONDS * 1000).map(|tick| f64::from(tick) * 1e-3).collect()
}

fn on_ticks(f: impl Fn(f64) -> f64) -> Vec<f64> {
    ticks().into_iter().map(f).collect()
}

/// Noise of about ±1, the same in every run.
fn noise(t: f64) -> f64 {
    ((t * 12_345.678).sin() * 43_758.547).fract()
}

/// Height of the journal in its bearing, relative to the clearance: falls, bounces, rests.
fn bounce(t: f64) -> f64 {
    let fall = (t / 0.011).powi(2);
    if fall < 1.0 {
        fall
    } else {
        1.0 - 0.35 * (-(t - 0.011) / 0.02).exp() * ((t - 0.011) / 0.012 * PI).sin().abs()
    }
}

fn figures() -> Block {
    Block::Figures(vec![
        Figure::new("Deviation, rms", number(0.0081, Digits::Fixed(3)), "mm")
            .note("plain computed torque 0.599")
            .verdict(Verdict::Ok),
        Figure::new("Peak contact force", "1.09", "kN").note("joint_5, at 0.011 s"),
        Figure::new("Round trip, p99.9", "471", "µs").note("limit 500 µs").verdict(Verdict::Warn),
        Figure::new("Missed ticks", "0", "").note("of 12 000"),
    ])
}

fn controllers() -> Table {
    let group = "tool deviation after 0.5 s";
    let mut table = Table::new("The three controllers on the same run")
        .column(Column::text("controller"))
        .column(Column::number("rms", "mm").fixed(3).lowest().group(group))
        .column(Column::number("max", "mm").fixed(3).lowest().group(group))
        .column(Column::number("axis z", "mm").fixed(3).lowest().group(group))
        .column(Column::number("free", "%").fixed(1).group("contact in joint_5"))
        .column(Column::number("impact", "%").fixed(1).group("contact in joint_5"))
        .column(Column::number("continuous", "%").fixed(1).group("contact in joint_5"))
        .column(Column::text("missed"))
        .column(Column::number("p50", "µs").fixed(0).lowest().group("round trip"))
        .column(Column::number("p99", "µs").fixed(0).lowest().group("round trip"))
        .column(Column::number("p99.9", "µs").fixed(0).lowest().group("round trip"));
    for (place, name) in CONTROLLERS.into_iter().enumerate() {
        let rest = REMAINDER[place];
        let round_trip = [[38.0, 71.0, 412.0], [66.0, 103.0, 455.0], [74.0, 118.0, 471.0]][place];
        let numbers = [rest, rest * 1.02 + 0.03, rest * 0.9, 1.9, 0.2, 97.9].map(Cell::from);
        let mut cells = vec![Cell::series(name)];
        cells.extend(numbers);
        cells.push(0u64.into());
        cells.extend(round_trip.map(Cell::from));
        table = table.row(cells);
    }
    table.note("The drop of the centred journal in the first 0.5 s cannot be compensated.")
}

fn deviation() -> Section {
    let t = ticks();
    let mut section = Section::new("Tool deviation")
        .with("Deviation of `tool0` from its reference, in the base frame. Drag across to look at the drop in the first 0.1 s; the three charts move together.");
    for (axis, share, phase) in [("x", 0.08, 0.0), ("y", 0.05, 1.0), ("z", -1.0, 2.0)] {
        let mut chart = Chart::trace(
            format!("Deviation along {axis}"),
            Axis::new("time", "s"),
            Axis::new(format!("deviation {axis}"), "mm"),
        )
        .group("time")
        .height(210)
        .mark(Mark::Span { from: 0.0, to: 0.5, label: "drop".into() });
        for (name, rest) in CONTROLLERS.into_iter().zip(REMAINDER) {
            let y = on_ticks(|t| {
                let start = (CLEARANCE_MM - rest) * (-t / 0.12).exp();
                let sway = 1.0 + 0.04 * (TAU * t / 6.0 + phase).sin();
                share * bounce(t) * (rest * sway + start) + 0.002 * noise(t + phase)
            });
            chart = chart.series(Series::line(name, &t, &y));
        }
        section = section.with(chart);
    }
    section
}

fn contact() -> Section {
    let t = ticks();
    let force = |place: f64| {
        on_ticks(move |t| {
            if bounce(t) < 0.98 {
                0.0
            } else {
                560.0 + 70.0 * (TAU * t / 6.0 + place).cos() + 4.0 * noise(t) + 500.0 * (-t / 0.05).exp()
            }
        })
    };
    let angle = |t: f64| 0.4 * (TAU * t / 6.0).sin() - PI / 2.0 + 0.01 * noise(t);
    let x = on_ticks(|t| CLEARANCE_MM * bounce(t) * angle(t).cos());
    let y = on_ticks(|t| CLEARANCE_MM * bounce(t) * angle(t).sin());
    let mode = on_ticks(|t| {
        if bounce(t) < 0.98 {
            0.0
        } else if t < 0.1 {
            1.0
        } else {
            2.0
        }
    });
    let force_chart =
        Chart::trace("Contact force in joint_5", Axis::new("time", "s"), Axis::new("normal force", "N"))
            .group("time")
            .in_view(0.0)
            .mark(Mark::Level { y: 1000.0, label: "rated 1000 N".into() })
            .series(Series::line(CONTROLLERS[0], &t, &force(0.0)))
            .series(Series::line(CONTROLLERS[2], &t, &force(0.3)).dashed());
    let orbit = Chart::xy(
        "Orbit of the journal in its bearing",
        Axis::new("across, horizontal", "mm"),
        Axis::new("across, vertical", "mm"),
    )
    .equal_axes()
    .series(Series::circle("clearance", (0.0, 0.0), CLEARANCE_MM).dashed())
    .series(Series::line(CONTROLLERS[2], &x, &y))
    .note("The journal starts in the middle, drops, bounces and then rolls along the bottom.");
    let modes = Chart::trace("Contact mode", Axis::new("time", "s"), Axis::new("mode", ""))
        .series(Series::step("mode of joint_5", &t, &mode).like(CONTROLLERS[2]))
        .note("0 free flight, 1 impact, 2 continuous contact.");
    Section::new("Contact").with(force_chart).with(Block::Columns(vec![orbit.into(), modes.into()]))
}

fn torques() -> Section {
    let t = ticks();
    let charts =
        (1..=6).map(|joint| {
            let amplitude = 90.0 / f64::from(joint);
            let model = on_ticks(|t| amplitude * (TAU * t / 6.0 + f64::from(joint)).sin());
            let measured: Vec<f64> =
                t.iter()
                    .zip(&model)
                    .map(|(&t, m)| {
                        if (4.0..4.2).contains(&t) { f64::NAN } else { m + 9.1 * m.signum() + 0.5 * noise(t) }
                    })
                    .collect();
            Chart::trace(format!("Joint {joint}"), Axis::new("time", "s"), Axis::new("torque", "N·m"))
                .group("torque")
                .height(190)
                .series(Series::line("measured", &t, &measured))
                .series(Series::line("model", &t, &model))
                .into()
        });
    let speed = on_ticks(|t| 0.8 * (TAU * t / 6.0 + 3.0).cos());
    let residual: Vec<f64> =
        speed.iter().zip(&t).map(|(v, &t)| 9.1 * (v / 0.02).tanh() + 0.9 * noise(t)).collect();
    let cloud = Chart::xy(
        "What the model leaves unexplained",
        Axis::new("speed of elbow", "rad/s"),
        Axis::new("torque residual", "N·m"),
    )
    .height(300)
    .series(Series::points("measured - model", &speed, &residual).like("measured"));
    let fit = Table::new("Torque of elbow, held-out part")
        .column(Column::text("model"))
        .column(Column::number("rmse", "N·m").significant(3).bars().lowest())
        .column(Column::number("Coulomb friction", "N·m"))
        .row(["as given".into(), 6.31.into(), Cell::default()])
        .row(["parameters re-tuned".into(), 5.90.into(), Cell::default()])
        .row(["with the friction".into(), 0.52.into(), Cell::uncertain(9.08, 0.31)])
        .row(["black box (NARX)".into(), 0.61.into(), Cell::default()])
        .note("Noise floor 0.47 N·m.");
    Section::new("Torques")
        .with(Block::Columns(charts.collect()))
        .with(Block::Columns(vec![cloud.into(), fit.into()]))
}

fn latencies() -> Section {
    let p: Vec<f64> = (0..=60).map(|i| 1.0 - 10f64.powf(-f64::from(i) / 12.0)).collect();
    let mut curve = Chart::trace(
        "Round trip against the schedule",
        Axis::percentile("percentile"),
        Axis::new("latency", "µs"),
    )
    .in_view(0.0)
    .mark(Mark::Level { y: 500.0, label: "half a tick".into() })
    .note("Coordinated omission corrected. Each step to the right is ten times as rare.");
    let mut bars = Chart::trace("Plant step", Axis::log("time of one step", "µs"), Axis::log("steps", ""));
    for (place, name) in CONTROLLERS.into_iter().enumerate() {
        let base = [38.0, 66.0, 74.0][place];
        let y: Vec<f64> = (0..=60)
            .map(|i| f64::from(i) / 12.0)
            .map(|d| base + 14.0 * d + 3.0 * d.powi(3) + if d > 3.3 { 80.0 * (d - 3.3) } else { 0.0 })
            .collect();
        curve = curve.series(Series::step(name, &p, &y));
    }
    let x: Vec<f64> = (0..60).map(|i| 20.0 * 1.06f64.powi(i)).collect();
    let counts: Vec<f64> =
        x.iter().map(|x| (9_000.0 * (-((x / 42.0).ln() / 0.2).powi(2)).exp() + 2.0).floor()).collect();
    bars = bars.series(Series::bars("plant step", &x, &counts));
    Section::new("Latencies").with(curve).with(bars)
}

fn reference_runs() -> Section {
    let mut table = Table::new("Ours beside the reference, all runs")
        .column(Column::text("run"))
        .column(Column::number("ours", "mm").fixed(5).group("rms"))
        .column(Column::number("theirs", "mm").fixed(5).group("rms"))
        .column(Column::number("difference", "%").fixed(2).group("rms"))
        .column(Column::number("ours", "N").fixed(1).group("peak normal force"))
        .column(Column::number("theirs", "N").fixed(1).group("peak normal force"))
        .column(Column::number("difference", "%").fixed(2).group("peak normal force"))
        .column(Column::text("verdict"));
    for row in 0..10 {
        let theirs = 0.2 * f64::from(row % 4 + 1);
        let off = 0.4 * noise(f64::from(row));
        let verdict = if row == 7 { Verdict::Fail } else { Verdict::Ok };
        let force = if row == 3 { f64::NAN } else { 1073.5 + 10.0 * off };
        table = table.row([
            format!("ctc_lissajous_c{theirs:.1}_T{}", 6 + 6 * (row % 2)).into(),
            (theirs * (1.0 + off / 100.0)).into(),
            theirs.into(),
            off.into(),
            force.into(),
            1073.5.into(),
            ((force / 1073.5 - 1.0) * 100.0).into(),
            Cell::verdict(verdict),
        ]);
    }
    Section::new("Reference runs").with(table)
}

fn drawing() -> Drawing {
    let t = ticks();
    let height: Vec<f64> = t.iter().map(|&t| -CLEARANCE_MM * bounce(t.min(0.2))).collect();
    let across: Vec<f64> = t.iter().map(|&t| 0.05 * (t * 9.0).sin()).collect();
    Drawing::new("A journal in its bearing")
        .caption("Drawn once, as SVG: it needs no script and prints as it is seen.")
        .beside()
        .panel(
            Chart::xy("orbit", Axis::new("play 1", "mm"), Axis::new("play 2", "mm"))
                .equal_axes()
                .series(Series::circle("clearance", (0.0, 0.0), CLEARANCE_MM).dashed())
                .series(Series::line("journal", &across, &height)),
        )
        .panel(
            Chart::trace("height", Axis::new("time", "s"), Axis::new("play 2", "mm"))
                .height(398)
                .mark(Mark::Level { y: -CLEARANCE_MM, label: "rim".into() })
                .mark(Mark::Span { from: 0.0, to: 0.2, label: "bounces".into() })
                .series(Series::line("journal", &t[..400], &height[..400])),
        )
}

fn odds_and_ends() -> Section {
    let one = Chart::trace("A single point", Axis::new("time", "s"), Axis::new("force", "N"))
        .height(160)
        .series(Series::points("impact", &[0.0112], &[1073.5]));
    let none = Chart::trace("Nothing", Axis::new("time", "s"), Axis::new("force", "N")).series(Series::line(
        "absent",
        &[0.0, 1.0],
        &[f64::NAN, f64::INFINITY],
    ));
    let flat = Chart::trace("A constant and infinities", Axis::new("time", "s"), Axis::new("position", "m"))
        .height(160)
        .mark(Mark::At { x: 1.5, label: "swap".into() })
        .mark(Mark::At { x: 1.6, label: "second controller <b>in</b> charge".into() })
        .series(Series::line(
            "</script><script>alert(1)</script>",
            &[0.0, 1.0, 2.0, 3.0],
            &[5.0, 5.0, f64::NEG_INFINITY, 5.0],
        ));
    Section::new("Machine, configuration, odds and ends")
        .with(Block::List(vec!["2 cores, Linux 6.18".into(), "wait: sleep + spin 200 µs".into(), "next: `freeplay faults ./mine`".into()]))
        .with((Verdict::Fail, "the controller `./mine` died at tick 4211; the plant held and braked."))
        .with((Verdict::Info, "not testable here: friction drift (16 s is too short)."))
        .with(Block::Heading("Configuration".into()))
        .with(Block::Code("[scenario]\narm = \"paper.toml\"\nclearance = { joint_5 = { value = 0.6e-3, bearing_radius = 20e-3, restitution = 0.9 } } # <- SI units\n".into()))
        .with(Block::Details { summary: "Charts that have little to show".into(), blocks: vec![Block::Columns(vec![one.into(), flat.into()]), none.into()] })
}

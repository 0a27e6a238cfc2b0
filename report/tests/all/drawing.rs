//! Drawings: their content, in the colours of the page, for any numbers.

use freeplay_report::{Axis, Chart, Document, Drawing, Mark, Series};
use proptest::prelude::{ProptestConfig, any, prop_assert, prop_assert_eq, proptest};
use proptest::test_runner::RngSeed;

fn page(drawing: Drawing) -> String {
    Document::new("page").overview(drawing).to_html()
}

/// The first SVG element of the page.
fn svg(page: &str) -> &str {
    let from = page.find("<svg ").unwrap_or_else(|| panic!("no SVG in the page"));
    &page[from..from + page[from..].find("</svg>").unwrap()]
}

fn orbit() -> Drawing {
    let x = [0.0, 0.3, 0.6, f64::NAN, 0.1, 0.2];
    Drawing::new("The journal in its bearing").caption("Seen across the axis.").beside().panel(
        Chart::xy("", Axis::new("play 1", "mm"), Axis::new("play 2", "mm"))
            .equal_axes()
            .series(Series::circle("clearance", (0.0, 0.0), 0.6).dashed())
            .series(Series::line("free flight", &x, &x))
            .mark(Mark::Level { y: 0.25, label: "rim <1>".into() }),
    )
}

#[test]
fn axes_carry_quantity_and_unit() {
    let page = page(orbit());
    let svg = svg(&page);
    for label in ["play 1 [mm]", "play 2 [mm]", "rim &lt;1&gt;"] {
        assert!(svg.contains(label), "{label} in {svg}");
    }
    assert!(page.contains("class=\"swatch series-1\"") && page.contains("Seen across the axis."));
    assert!(svg.matches("<text").count() > 8, "the axes have numbers");
}

#[test]
fn colours_are_those_of_the_page() {
    let page = page(orbit());
    let svg = svg(&page);
    assert!(svg.contains("stroke=\"var(--series-1)\"") && svg.contains("fill=\"var(--ink)\""));
    let fixed: Vec<&str> = svg.split("\"#").skip(1).map(|rest| &rest[..6]).collect();
    assert!(fixed.is_empty(), "colours that do not follow the page: {fixed:?}");
}

#[test]
fn a_gap_parts_a_line_and_equal_axes_make_a_circle_round() {
    let page = page(orbit());
    let lines: Vec<&str> = svg(&page).split("<polyline").filter(|part| part.contains("--series-1")).collect();
    assert_eq!(lines.len(), 2, "{lines:?}");
    let rim = svg(&page).split('<').filter(|part| part.contains("\"var(--series-0)\""));
    let (mut x, mut y) = (Vec::new(), Vec::new());
    for dash in rim {
        for pair in dash.split("points=\"").nth(1).unwrap().split('"').next().unwrap().split_whitespace() {
            let (across, down) = pair.split_once(',').unwrap();
            x.push(across.parse::<f64>().unwrap());
            y.push(down.parse::<f64>().unwrap());
        }
    }
    let extent = |values: &[f64]| {
        values.iter().copied().fold(f64::MIN, f64::max) - values.iter().copied().fold(f64::MAX, f64::min)
    };
    println!("the rim is {} units wide and {} high", extent(&x), extent(&y));
    assert!(extent(&x) > 1000.0 && (extent(&x) / extent(&y) - 1.0).abs() < 0.01);
}

#[test]
fn a_long_series_stays_small_and_keeps_its_peak() {
    let t: Vec<f64> = (0..12_000).map(|i| f64::from(i) * 1e-3).collect();
    let mut y: Vec<f64> = t.iter().map(|t| (t * 7919.0).sin()).collect();
    y[7_001] = 50.0;
    let chart = Chart::trace("", Axis::new("time", "s"), Axis::new("force", "N"));
    let page = page(Drawing::new("f").panel(chart.series(Series::line("a", &t, &y))));
    let points = svg(&page).split("points=\"").nth(1).unwrap().split('"').next().unwrap();
    println!("{} bytes for 12000 points", points.len());
    assert!(points.len() < 30_000);
    let heights = points.split_whitespace().map(|p| p.split_once(',').unwrap().1.parse::<i32>().unwrap());
    let (highest, others) = (heights.clone().min().unwrap(), heights.clone().max().unwrap());
    assert!(others - highest > 400, "the peak stands out: {highest} {others}");
}

#[test]
fn nothing_to_draw_is_said() {
    let empty = Chart::trace("", Axis::new("time", "s"), Axis::new("force", "N"));
    let page = page(Drawing::new("f").panel(empty.series(Series::line("a", &[1.0], &[f64::NAN]))));
    assert!(page.contains("Nothing to draw: force [N]") && !page.contains("<svg "));
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: RngSeed::Fixed(8821), failure_persistence: None, ..ProptestConfig::with_cases(100) })]

    #[test]
    fn no_number_breaks_a_drawing(points in proptest::collection::vec((any::<f64>(), any::<f64>()), 0..40), plane in any::<bool>(), equal_axes in any::<bool>()) {
        let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
        let chart = Chart { plane, equal_axes, ..Chart::trace("", Axis::new("x", "m"), Axis::new("y", "N")) };
        let page = page(Drawing::new("f").panel(chart.series(Series::line("a", &x, &y)).series(Series::points("b", &x, &y))));
        prop_assert_eq!(page.matches("<svg ").count(), page.matches("</svg>").count());
        prop_assert!(page.contains("<svg ") || page.contains("Nothing to draw") || page.contains("Cannot be drawn"));
    }
}

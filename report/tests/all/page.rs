//! The page as a whole: nothing escapes, nothing is fetched, everything is present.

use crate::common::every_block;
use freeplay_report::{Axis, Cell, Chart, Column, Document, Section, Series, Table};
use proptest::prelude::{ProptestConfig, Strategy, any, prop_assert, prop_assert_eq, proptest};
use proptest::test_runner::RngSeed;

/// The scripts of the page itself: uPlot and the glue.
const OWN_SCRIPTS: usize = 3;

/// The JSON of every chart in the page, parsed.
fn chart_data(page: &str) -> Vec<serde_json::Value> {
    let marker = "<script type=\"application/json\">";
    page.split(marker)
        .skip(1)
        .map(|rest| {
            let json = rest.split("</script>").next().expect("split gives at least one part");
            serde_json::from_str(json).unwrap_or_else(|error| panic!("{error} in {json}"))
        })
        // Films have data, too.
        .filter(|data: &serde_json::Value| data["series"].is_array())
        .collect()
}

#[test]
fn hostile_names_stay_text() {
    let hostile = "</script><b id=pwned>\"'`&amp;</title><!--]]>\u{2028}";
    let page = every_block(hostile).to_html();
    assert!(
        page.contains("&lt;b id=pwned&gt;") && page.contains("\\u003cb id=pwned\\u003e"),
        "the name is in the page"
    );
    assert!(!page.contains("<b id=pwned>"), "and nowhere as an element");
    assert!(!page.contains("=\"</script>"), "nor at the end of an attribute");
    for chart in chart_data(&page) {
        assert!(chart["series"].as_array().unwrap().iter().any(|series| series["name"] == hostile));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: RngSeed::Fixed(8821), failure_persistence: None, ..ProptestConfig::with_cases(200) })]

    #[test]
    fn no_text_changes_the_structure(text in any::<String>().prop_filter("an empty text leaves things out", |text| !text.is_empty())) {
        let page = every_block(&text).to_html();
        let plain = every_block("plain").to_html();
        let count = |page: &str, what: &str| page.matches(what).count();
        for what in ["<script", "</script", "<section", "<figure", "<style", "<h2", "<td", "</html"] {
            prop_assert_eq!(count(&page, what), count(&plain, what), "{} in {:?}", what, &text);
        }
        prop_assert_eq!(chart_data(&page).len(), 3);
    }

    #[test]
    fn no_number_breaks_the_data(points in proptest::collection::vec((any::<f64>(), any::<f64>()), 0..60), plane in any::<bool>()) {
        let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
        for (across, upwards) in [(Axis::new("x", ""), Axis::new("y", "")), (Axis::percentile("x"), Axis::log("y", ""))] {
            let chart = Chart { plane, ..Chart::trace("chart", across, upwards) }.series(Series::line("a", &x, &y));
            let page = Document::new("page").overview(chart).to_html();
            let empty = page.contains("Nothing to draw");
            let data = chart_data(&page);
            prop_assert_eq!(data.len(), usize::from(!empty));
            for chart in data {
                let grid = chart["grids"][0].as_array().unwrap();
                prop_assert_eq!(grid.len(), chart["series"][0]["y"].as_array().unwrap().len());
                let values: Vec<f64> = grid.iter().filter_map(serde_json::Value::as_f64).collect();
                prop_assert!(plane || values.windows(2).all(|w| w[0] <= w[1]));
            }
        }
    }
}

#[test]
fn page_fetches_nothing() {
    let page = every_block("plain").to_html();
    assert_eq!(page.matches("<script>").count(), OWN_SCRIPTS);
    assert!(page.contains("default-src 'none'"), "the page forbids itself to ask anybody");
    for fetching in
        [" src=", "href=\"http", "url(", "@import", "<link", "<iframe", "fetch(", "XMLHttpRequest"]
    {
        assert!(!page.contains(fetching), "the page contains {fetching}");
    }
    assert!(page.contains("Copyright (c) 2022 Leon Sorokin"), "the licence travels with the library");
}

#[test]
fn reader_can_find_the_way() {
    let page = every_block("plain").to_html();
    let at = |what: &str| page.find(what).unwrap_or_else(|| panic!("no {what} in the page"));
    let order = [
        "<h1",
        "class=\"verdict fail\"",
        "<nav",
        "id=\"section-1\"",
        "<h2",
        "id=\"section-2\"",
        "<h3",
        "<footer",
    ];
    assert!(
        order.windows(2).all(|pair| at(pair[0]) < at(pair[1])),
        "the verdict comes first, headings in order"
    );
    assert!(page.contains("href=\"#section-2\""));
    assert!(page.contains(&format!("Freeplay {}", env!("CARGO_PKG_VERSION"))));
    let headings = page.matches("<th").count() - page.matches("<thead").count();
    let scoped = ["col", "row", "colgroup"].map(|scope| page.matches(&format!(" scope=\"{scope}\"")).count());
    println!("{headings} table headings, with scope {scoped:?}");
    assert_eq!(scoped.iter().sum::<usize>(), headings);
    assert_eq!(page.matches("class=\"alternative\"").count(), 3, "every chart is also said in words");
    assert!(page.contains("plain: 1.00 to 30.0 upwards") || page.contains("plain: 1.00 to 31.0 upwards"));
}

#[test]
fn contents_are_left_out_where_there_is_nothing_to_choose() {
    let page = Document::new("short").section(Section::new("only").with("text")).to_html();
    assert!(!page.contains("<nav"));
}

#[test]
fn table_marks_what_is_best_and_keeps_its_shape() {
    let table = Table::new("speeds")
        .column(Column::text("controller"))
        .column(Column::number("rms", "mm").fixed(3).lowest().group("deviation"))
        .column(Column::number("max", "mm").fixed(3).group("deviation"))
        .column(Column::number("same", "").highest())
        .row(["a".into(), 0.5991.into(), 0.7.into(), 1.0.into()])
        .row(["b".into(), 0.0111.into(), f64::NAN.into(), 1.0.into()])
        .row(["c".into(), Cell::default()]);
    let page = Document::new("t").overview(table).to_html();
    assert!(page.contains("<strong class=\"best\">0.011"), "the lowest is marked");
    assert_eq!(page.matches("<strong class=\"best\">").count(), 1, "a column of equal numbers has no best");
    assert!(page.contains("colspan=\"2\">deviation</th>"));
    assert!(page.contains("<span class=\"unit\">[mm]</span>") && page.contains(">–</td>"));
    let body = page.split("<tbody>").nth(1).unwrap().split("</tbody>").next().unwrap();
    for row in body.split("</tr>").filter(|row| row.contains("<tr>")) {
        assert_eq!(row.matches("<td").count() + row.matches("<th").count(), 4, "{row}");
    }
}

#[test]
fn same_name_same_colour() {
    let x = [0.0, 1.0];
    let chart = |names: &[&str]| {
        let empty = Chart::trace("c", Axis::new("x", ""), Axis::new("y", ""));
        names.iter().fold(empty, |chart, name| chart.series(Series::line(*name, &x, &x)))
    };
    let limit = Series::line("b, limit", &x, &x).like("b").dashed();
    let page = Document::new("t")
        .overview(Table::new("").column(Column::text("")).row([Cell::series("b")]))
        .section(Section::new("1").with(chart(&["a", "b"])))
        .section(Section::new("2").with(chart(&["b", "c"]).series(limit)))
        .to_html();
    let colours: Vec<Vec<u64>> = chart_data(&page)
        .iter()
        .map(|chart| {
            chart["series"].as_array().unwrap().iter().map(|s| s["colour"].as_u64().unwrap()).collect()
        })
        .collect();
    assert_eq!(colours, [vec![0, 1], vec![1, 2, 1]]);
    assert!(page.contains("class=\"swatch series-1\""), "the table shows the colour of b");
}

#[test]
fn bars_begin_at_zero() {
    for (y, expected) in [(Axis::new("y", ""), "[0]"), (Axis::log("y", ""), "[]")] {
        let chart =
            Chart::trace("c", Axis::new("x", ""), y).series(Series::bars("a", &[1.0, 2.0], &[5.0, 6.0]));
        let data = chart_data(&Document::new("t").overview(chart).to_html());
        assert_eq!(data[0]["in_view"].to_string(), expected);
    }
}

/// 12 s at 1 kHz, 40 noisy series with the longest numbers there are.
#[test]
fn report_of_a_long_run_stays_small() {
    let t: Vec<f64> = (0..12_000).map(|i| f64::from(i) * 1e-3).collect();
    let mut section = Section::new("all");
    for chart in 0..10 {
        let mut traces = Chart::trace("c", Axis::new("time", "s"), Axis::new("deviation", "mm"));
        for series in 0..4 {
            let y: Vec<f64> = t
                .iter()
                .map(|t| -1.2e-5 * (1.0 + (t * 7919.0 + f64::from(chart * 4 + series)).sin()))
                .collect();
            traces = traces.series(Series::line(format!("{series}"), &t, &y));
        }
        section = section.with(traces);
    }
    let page = Document::new("long").section(section).to_html();
    println!("{} bytes, at most 5000000", page.len());
    assert!(page.len() <= 5_000_000);
    assert!(chart_data(&page)[0]["series"][0]["y"].as_array().unwrap().len() > 5_000, "the room is used");
}

#[test]
fn file_is_written_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.html");
    let document = every_block("plain");
    document.write(&path).unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), document.to_html());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no part is left behind");

    let missing = folder.path().join("no such folder").join("report.html");
    let error = document.write(&missing).unwrap_err().to_string();
    println!("{error}");
    assert!(error.contains("no such folder") && error.contains("choose another folder"));

    let occupied = folder.path().join("occupied");
    std::fs::create_dir(&occupied).unwrap();
    document.write(&occupied).unwrap_err();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "a failed report leaves nothing behind");
}

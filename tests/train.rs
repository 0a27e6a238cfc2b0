//! The weights that ship with the project, on a short run that they have not seen.

mod common;

use common::freeplay;
use serde_json::Value;

const WEIGHTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../controller/weights/erkaya2018.narx.json");

#[test]
fn the_shipped_weights_predict_a_sharp_path_they_have_not_seen() {
    let ran = freeplay(&["train", "--evaluate", WEIGHTS, "--quick", "--format", "json"]).expect(0);
    let rows: Value = serde_json::from_str(&ran.stdout()).expect("JSON");
    let rows = rows.as_array().expect("rows");
    let around: Vec<&Value> = rows.iter().filter(|row| row["part"] == "detachment").collect();
    assert!(!around.is_empty(), "a sharp path makes the journal leave its bearing");
    for row in around {
        let [network, product] = ["network", "product"].map(|name| row[name].as_f64().expect("a number"));
        let baselines = row["baselines"].as_array().expect("baselines").iter();
        let best = baselines.map(|one| one[1].as_f64().expect("a number")).fold(f64::INFINITY, f64::min);
        let skill = 1.0 - (network / best).powi(2);
        println!(
            "{} {}: {:.2} µm, best baseline {:.2} µm, skill {skill:.3}",
            row["run"],
            row["axis"],
            network * 1e6,
            best * 1e6
        );
        assert!(best > 1e-6, "there is something to predict");
        assert!(skill > 0.5, "the bar around detachments");
        let twin = row["twin"].as_f64().expect("a number");
        assert!(
            product <= twin && product < 0.7 * best,
            "narx-qp forecasts no worse than its twin: {product}"
        );
    }
}

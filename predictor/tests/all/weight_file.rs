//! Tests of weight files: contents are restored bit for bit, and errors name the fault.
use freeplay_predictor::narx::NarxError;
use freeplay_predictor::network::NetworkError;
use freeplay_predictor::weight_file::{MismatchError, WeightFileError};
use freeplay_predictor::{Layout, Narx};
use proptest::prelude::{ProptestConfig, proptest};
use serde_json::{Value, json};

/// A file as another program might write it: 2 inputs × 1 lag + 1 output × 2 lags = 4 regressors, 4-2-1.
fn file() -> Value {
    json!({
        "format": "freeplay.narx", "version": 1,
        "provenance": {
            "arm": "paper", "arm_hash": "abc123", "joint": "joint_5", "command": "freeplay train",
            "scenarios": ["lissajous, T = 6 s"], "seed": 7, "proved": true
        },
        "inputs": ["tau1", "tau2"], "outputs": ["dx"],
        "layout": { "input_lags": [0], "output_lags": [0, 1], "horizon": 3, "input_at_target": false },
        "layers": [4, 2, 1], "activation": "tanh",
        "input_scaling": { "minimum": [-1.0, 0.1], "gain": [2.0, 0.3] },
        "output_scaling": { "minimum": [-6e-4], "gain": [1666.7] },
        "weights": [0.1, 0.2, 0.3, 0.4, 0.5, -0.1, -0.2, -0.3, -0.4, -0.5, 1e-3, 0.7, 1.0 / 3.0]
    })
}

fn read(value: &Value) -> Result<Narx, WeightFileError> {
    Narx::from_json(&value.to_string(), "weights.json")
}

#[test]
fn a_file_comes_back_as_it_was_written() {
    let narx = read(&file()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("weights.json");
    narx.save(&path).unwrap();
    let again = Narx::load(&path).unwrap();
    assert_eq!(again.to_json(), narx.to_json());
    assert_eq!(serde_json::from_str::<Value>(&narx.to_json()).unwrap(), file());
    assert_eq!(again.provenance(), narx.provenance());
    assert_eq!(again.layout().horizon, 3);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_finite_weight_comes_back_bit_for_bit(bits in proptest::collection::vec(0..=u64::MAX, 13)) {
        let finite = |bits: &u64| Some(f64::from_bits(*bits)).filter(|w| w.is_finite()).unwrap_or(-0.0);
        let weights: Vec<f64> = bits.iter().map(finite).collect();
        let mut file = file();
        file["weights"] = json!(weights);
        let narx = read(&file).unwrap();
        let again = Narx::from_json(&narx.to_json(), "again").unwrap();
        let same = |a: &f64, b: &f64| a.to_bits() == b.to_bits();
        assert!(again.network().weights().iter().zip(&weights).all(|(a, b)| same(a, b)));
    }
}

#[test]
fn bad_files_are_refused_with_their_reason() {
    type Change = fn(&mut Value);
    type Expected = fn(&WeightFileError) -> bool;
    let table: [(&str, Change, Expected); 18] = [
        (
            "format is",
            |f| f["format"] = json!("pyrenn"),
            |e| matches!(e, WeightFileError::OtherFormat { .. }),
        ),
        (
            "format is",
            |f| drop(f.as_object_mut().unwrap().remove("format")),
            |e| matches!(e, WeightFileError::OtherFormat { .. }),
        ),
        (
            "version 2",
            |f| f["version"] = json!(2),
            |e| matches!(e, WeightFileError::OtherVersion { found: 2, .. }),
        ),
        (
            "found text \"1\", expected a whole number",
            |f| f["version"] = json!("1"),
            |e| matches!(e, WeightFileError::Syntax { .. }),
        ),
        (
            "missing field `version`",
            |f| drop(f.as_object_mut().unwrap().remove("version")),
            |e| matches!(e, WeightFileError::Syntax { .. }),
        ),
        (
            "missing field `layout`",
            |f| drop(f.as_object_mut().unwrap().remove("layout")),
            |e| matches!(e, WeightFileError::Syntax { .. }),
        ),
        ("unknown field `extra`", |f| f["extra"] = json!(1), |e| matches!(e, WeightFileError::Syntax { .. })),
        (
            "unknown value `relu`",
            |f| f["activation"] = json!("relu"),
            |e| matches!(e, WeightFileError::Syntax { .. }),
        ),
        (
            "found `-1`, expected a whole number of 0 or more",
            |f| f["layout"]["horizon"] = json!(-1),
            |e| matches!(e, WeightFileError::Syntax { .. }),
        ),
        (
            "weight 4 is not a finite",
            |f| f["weights"][4] = Value::Null,
            |e| matches!(e, WeightFileError::NonFiniteWeight { index: 4, .. }),
        ),
        (
            "13 weights, but 12",
            |f| drop(f["weights"].as_array_mut().unwrap().pop()),
            |e| matches!(e, WeightFileError::Network { source: NetworkError::WrongWeightCount { .. }, .. }),
        ),
        (
            "layer sizes [4]",
            |f| f["layers"] = json!([4]),
            |e| matches!(e, WeightFileError::Network { source: NetworkError::BadSizes { .. }, .. }),
        ),
        (
            "6 regressors",
            |f| f["layout"]["input_lags"] = json!([0, 1]),
            |e| matches!(e, WeightFileError::Model { source: NarxError::NetworkShape { .. }, .. }),
        ),
        (
            "3 input and 1 output",
            |f| f["inputs"] = json!(["a", "b", "c"]),
            |e| matches!(e, WeightFileError::Model { source: NarxError::NetworkShape { .. }, .. }),
        ),
        (
            "horizon 0",
            |f| f["layout"]["horizon"] = json!(0),
            |e| matches!(e, WeightFileError::Model { source: NarxError::Layout(_), .. }),
        ),
        (
            "input scaling",
            |f| f["input_scaling"]["gain"] = json!([2.0]),
            |e| matches!(e, WeightFileError::Model { source: NarxError::Scaling { kind: "input", .. }, .. }),
        ),
        (
            "output scaling",
            |f| f["output_scaling"]["gain"] = json!([0.0]),
            |e| matches!(e, WeightFileError::Model { source: NarxError::Scaling { kind: "output", .. }, .. }),
        ),
        (
            "found nothing, expected a number",
            |f| f["output_scaling"]["minimum"] = json!([null]),
            |e| matches!(e, WeightFileError::Syntax { .. }),
        ),
    ];
    for (words, change, expected) in table {
        let mut bad = file();
        change(&mut bad);
        let error = read(&bad).unwrap_err();
        let message = error.to_string();
        assert!(expected(&error) && message.contains(words), "{words}: {message}");
        assert!(message.starts_with("weights.json: "), "{message}");
    }
}

#[test]
fn text_that_is_no_file_is_refused() {
    for text in ["", "{", "[]", "null", "weights", "{\"format\": \"freeplay.narx\", \"version\": 1"] {
        let error = Narx::from_json(text, "weights.json").unwrap_err();
        assert!(matches!(error, WeightFileError::Syntax { .. }), "{text}: {error}");
    }
    let huge = file().to_string().replace("0.001", "1e999");
    assert_ne!(huge, file().to_string());
    let error = Narx::from_json(&huge, "weights.json").unwrap_err();
    assert!(error.to_string().contains("number out of range"), "{error}");
    let folder = tempfile::tempdir().unwrap();
    let missing = Narx::load(&folder.path().join("none.json")).unwrap_err();
    assert!(matches!(&missing, WeightFileError::Io { .. }) && missing.to_string().contains("none.json"));
    assert!(read(&file()).unwrap().save(&folder.path().join("no/such/folder.json")).is_err());
}

#[test]
fn weights_for_something_else_are_refused() {
    let narx = read(&file()).unwrap();
    assert_eq!(narx.check_arm("renamed", "abc123"), Ok(()));
    let arm = narx.check_arm("other", "def456").unwrap_err();
    let message = arm.to_string();
    assert!(matches!(arm, MismatchError::OtherArm { .. }));
    assert!(
        ["paper", "abc123", "other", "def456", "freeplay train"].iter().all(|w| message.contains(w)),
        "{message}"
    );
    assert_eq!(narx.check_joint("joint_5"), Ok(()));
    assert!(matches!(narx.check_joint("joint_3"), Err(MismatchError::OtherJoint { .. })));
    assert_eq!(narx.check_channels(&["tau1", "tau2"], &["dx"]), Ok(()));
    let swapped = narx.check_channels(&["tau2", "tau1"], &["dx"]);
    assert!(matches!(swapped, Err(MismatchError::OtherChannels { kind: "input", .. })));
    assert!(matches!(narx.check_channels(&["tau1", "tau2"], &[]), Err(MismatchError::OtherChannels { .. })));
    let same = Layout { input_lags: vec![0], output_lags: vec![0, 1], horizon: 3, input_at_target: false };
    assert_eq!(narx.check_layout(&same), Ok(()));
    let later = Layout { horizon: 4, ..same };
    let message = narx.check_layout(&later).unwrap_err().to_string();
    assert!(message.contains("predict 3 ahead") && message.contains("predict 4 ahead"), "{message}");
}

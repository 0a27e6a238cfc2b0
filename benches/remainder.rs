//! Time of the learned remainder in one tick, compared with that of the network alone, also for inputs that need the arm's dynamics. Goal: 0.3 us.
//!
//! Sizes are those of the proved weights of `freeplay demo --nameless`: means of four networks of 8 or 16 units, of two of 10 and 10, and a region of 48
//! centres. `FREEPLAY_WEIGHTS=FILE` also times another file.

mod common;

use std::hint::black_box;
use std::path::Path;

use freeplay_arm::Arm;
use freeplay_controller::Motion;
use freeplay_controller::remainder::{InputGroup, Remainder, WeightFile};
use freeplay_model::paper_arm;
use freeplay_path::{JointPath, PathSpec};
use serde_json::json;

/// Time between two ticks, s.
const PERIOD: f64 = 1e-3;

fn main() {
    common::machine();
    let arm = paper_arm().arm;
    let path = JointPath::plan(&arm, &PathSpec { laps: 2, ..PathSpec::default() }, 1.0 / PERIOD)
        .expect("the smooth path");
    use InputGroup::{Elapsed, Load, Position, Turn, Velocity};
    let position: &[InputGroup] = &[Position];
    let sizes: [(&[usize], &[InputGroup]); 7] = [
        (&[32], position),
        (&[64], position),
        (&[20, 20], position),
        (&[32], &[Position, Velocity]),
        (&[32], &[Position, Velocity, Elapsed]),
        (&[32], &[Position, Turn]),
        (&[32], &[Position, Load]),
    ];
    for (units, groups) in sizes {
        let name = format!("{units:?} units on {groups:?}").to_lowercase();
        time(&name, &made(groups, units, &arm), &arm, &path);
    }
    if let Some(file) = std::env::var_os("FREEPLAY_WEIGHTS") {
        let file = WeightFile::load(Path::new(&file)).expect("a weight file");
        time(&file.learned.command.clone(), &file, &arm, &path);
    }
}

/// Times `file` along `path`.
fn time(name: &str, file: &WeightFile, arm: &Arm, path: &JointPath) {
    let ticks = (path.duration() / PERIOD) as u64;
    let mut remainder = Remainder::new(file, arm, PERIOD).expect("numbers that fit");
    let (mut q, mut v, mut a) = ([0.0; 6], [0.0; 6], [0.0; 6]);
    let mut tick = 0;
    common::measure(&format!("path alone, {name}"), "", 20_000, 50, || {
        tick = (tick + 1) % ticks;
        path.at(tick as f64 * PERIOD, &mut q, &mut v, &mut a);
        black_box((&q, &v, &a));
    });
    common::measure(&format!("path and remainder, {name}"), "(goal 0.3 more)", 20_000, 50, || {
        tick = (tick + 1) % ticks;
        path.at(tick as f64 * PERIOD, &mut q, &mut v, &mut a);
        black_box(remainder.at(tick, Motion { q: &q, v: &v, a: &a }));
    });
    assert!(remainder.usage().not_finite == 0, "the network answers");
    let network = file.narx().expect("a network").in_physical_units().expect("a network");
    let (mut scratch, row) = (network.scratch(), vec![0.1; network.inputs()]);
    common::measure(&format!("network alone, {name}"), "(yardstick)", 20_000, 50, || {
        black_box(network.forward(black_box(&row), &mut scratch));
    });
}

/// Creates weights of the usual size on `groups` of inputs, trusted along the whole path.
fn made(groups: &[InputGroup], units: &[usize], arm: &Arm) -> WeightFile {
    let names: Vec<String> = groups.iter().flat_map(|group| group.names(arm.dof())).collect();
    let region = [&[InputGroup::Position, InputGroup::Velocity][..], groups].concat();
    let region: Vec<InputGroup> =
        InputGroup::ALL.into_iter().filter(|group| region.contains(group)).collect();
    let inputs = names.len();
    let looks: Vec<InputGroup> =
        groups.iter().chain(region.iter().filter(|g| !groups.contains(g))).copied().collect();
    let width: usize = looks.iter().map(|group| group.width(arm.dof())).sum();
    let layers = [&[inputs], units, &[3]].concat();
    let weights: usize = layers.windows(2).map(|pair| (pair[0] + 1) * pair[1]).sum();
    let weights: Vec<f64> = (0..weights).map(|n| 0.1 * (n as f64).sin()).collect();
    let centres: Vec<Vec<f64>> =
        (0..48).map(|n| (0..width).map(|k| ((n * width + k) as f64).cos()).collect()).collect();
    let (zeros, ones) = (vec![-1.0; inputs], vec![1.0; inputs]);
    let axis = json!({ "lowest": -1e-3, "highest": 1e-3, "share": 1.0, "rms_um": 600.0, "left_um": 10.0, "r": null });
    let text = json!({
        "format": "freeplay.remainder", "version": 2,
        "learned": {
            "machine": { "arm": arm.name(), "arm_hash": "", "model_hash": "", "mode": "torque", "rate": 1000.0,
                         "gains": { "natural_frequency": 50.0, "damping_ratio": 1.0 } },
            "command": "by hand", "conditions": [], "inputs": groups, "axes": [axis, axis, axis],
            "region": { "inputs": looks, "gain": vec![1.0; width], "centres": centres, "trust": [[1e6, 1.0]] },
        },
        "network": {
            "format": "freeplay.narx", "version": 1,
            "provenance": { "arm": "", "arm_hash": "", "command": "by hand" },
            "inputs": names, "outputs": ["x", "y", "z"],
            "layout": { "input_lags": [], "output_lags": [], "horizon": 1, "input_at_target": true },
            "layers": layers, "activation": "tanh",
            "input_scaling": { "minimum": zeros, "gain": ones },
            "output_scaling": { "minimum": [-1, -1, -1], "gain": [1, 1, 1] },
            "weights": weights,
        },
        "receipt": { "proved": true, "chance": 0.001, "runs": [] },
    });
    WeightFile::parse(&text.to_string(), "made").expect("a weight file")
}

//! Properties of every kind of effect: names, units, round trips, linear terms, agreement of plant and recording.
use crate::common;
use freeplay_arm::Arm;
use freeplay_laws::{
    Absent, Baseline, Change, Columns, DriveFriction, DriveState, Kind, OPERATING_POINT, Place, Placed,
    Prediction, Range, Readings, Role, Scene, Site, Trajectory, kinds,
};
use freeplay_model::{EffectTable, parse_toml, to_toml};
use toml::{Table, Value};

use crate::common::{arm, greatest, motion, placed, raw};

const JOINT: usize = 2;

/// The words of an effect contain only its own parameters.
#[test]
fn words_hold_the_parameters() {
    for kind in kinds() {
        let named: Vec<&str> =
            kind.words.split('{').skip(1).filter_map(|rest| rest.split('}').next()).collect();
        println!("{}: {}", kind.name, kind.words);
        assert!(named.iter().all(|name| kind.parameter(name).is_some()), "{}: {named:?}", kind.name);
    }
}

fn site(kind: &Kind) -> Option<usize> {
    (kind.site != Site::Arm).then_some(JOINT)
}

/// A shape of `kind` from the middle of the search list; of a law with several operating points, the one for small coefficients.
fn shape(kind: &Kind, place: &Place) -> Table {
    let shapes = (kind.shapes)(place).into_iter();
    let shapes: Vec<Table> = shapes.filter(|shape| !shape.contains_key(OPERATING_POINT)).collect();
    assert!(!shapes.is_empty(), "{} has no shape to search on a rich motion", kind.name);
    // The last shape of backlash has gap and stiffness, that of a payload all ten terms. The first shape of radial play is a journal at
    // rest: a flight through another clearance follows another course.
    let index = match kind.name {
        "backlash" | "payload" => shapes.len() - 1,
        "joint_clearance" => 0,
        _ => (shapes.len() - 1) / 2,
    };
    shapes[index].clone()
}

/// Coefficients of a small effect: at most a third of a percent of the torque, and 0.3 mm.
fn coefficients(kind: &'static Kind, baseline: &Baseline, shape: &Table) -> Vec<f64> {
    if kind.name == "payload" {
        // A possible body.
        return [1.0, 0.05, -0.03, 0.08, 0.03, 0.03, 0.03, 0.001, -0.001, 0.002]
            .map(|share| 0.5 * share)
            .into();
    }
    let columns = kind.columns(baseline, site(kind), shape).unwrap();
    let torque = greatest(baseline.prediction().torque.iter().flatten());
    let size = |(index, (term, column)): (usize, &(freeplay_laws::Term, Change))| {
        let of = |columns: &Columns| greatest(columns.all_written().flat_map(|(_, column)| column));
        let torque_effect = of(&column.torque) / torque;
        let tool_effect = of(&column.tool).max(of(&column.link));
        let share = (0.003 / torque_effect).min(3e-4 / tool_effect);
        // Friction cannot become less than zero.
        let may_be_negative = term.least < 0.0 && kind.name != "presliding_friction";
        let sign = if index % 2 == 1 && may_be_negative { -1.0 } else { 1.0 };
        (sign * share / columns.len() as f64).clamp(term.least, term.most)
    };
    columns.iter().enumerate().map(size).collect()
}

fn sum(columns: &[(freeplay_laws::Term, Change)], coefficients: &[f64]) -> Change {
    let mut sum = columns[0].1.clone();
    sum.scale(0.0);
    columns.iter().zip(coefficients).for_each(|((_, column), coefficient)| sum.add(column, *coefficient));
    sum
}

/// Greatest difference of two predictions as a share of the greatest of `whole`, separately for torques and positions.
fn difference(a: &Prediction, b: &Prediction) -> f64 {
    let groups: [fn(&Prediction) -> Vec<f64>; 3] = [
        |p| p.torque.iter().flatten().copied().collect(),
        |p| p.tool.iter().flatten().copied().collect(),
        |p| p.link.iter().flatten().copied().collect(),
    ];
    let share = |group: &fn(&Prediction) -> Vec<f64>| {
        let (a, b) = (group(a), group(b));
        let off = a.iter().zip(&b).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
        let size = greatest(&a).max(greatest(&b));
        if size > 0.0 { off / size } else { 0.0 }
    };
    groups.iter().map(share).fold(0.0, f64::max)
}

/// The parameters of `kind` at a typical size.
fn typical(kind: &'static Kind, arm: &Arm, motion: &Trajectory) -> Table {
    let baseline = Baseline::new(arm, &[], motion, &raw).unwrap();
    let place = Place { scene: baseline.scene(), joint: site(kind) };
    let shape = shape(kind, &place);
    let coefficients = coefficients(kind, &baseline, &shape);
    kind.compose(&shape, &coefficients)
}

#[test]
fn every_entry_is_complete_and_names_only_what_exists() {
    for kind in kinds() {
        for text in [kind.name, kind.title, kind.equation, kind.source, kind.signature] {
            assert!(!text.trim().is_empty(), "{} has an empty text", kind.name);
        }
        assert_eq!(
            kinds().filter(|other| other.name == kind.name).count(),
            1,
            "{} is there twice",
            kind.name
        );
        assert!(
            !kind.confounders.is_empty() && !kind.needs.is_empty() && !kind.parameters.is_empty(),
            "{}",
            kind.name
        );
        for (other, _) in kind.contains.iter().chain(kind.confounders) {
            assert!(
                kinds().any(|kind| kind.name == *other),
                "{} names {other}, which is not there",
                kind.name
            );
        }
        for parameter in kind.parameters {
            if let Range::Number { least, most, absent: Absent::Is(default), .. } = parameter.range {
                assert!(least <= default && default <= most, "{}.{}", kind.name, parameter.name);
            }
        }
    }
}

/// An effect with every parameter survives a round trip through an arm file.
#[test]
fn effects_survive_an_arm_file() {
    let (arm, motion) = (arm(), motion(6, 50.0, 12.0));
    for kind in kinds() {
        let parameters = typical(kind, &arm, &motion);
        let joint = site(kind).map(|joint| arm.joints()[joint].name.clone());
        let table = EffectTable { kind: kind.name.into(), joint, parameters, line: 0 };
        let text = to_toml(&common::file(&arm, table.clone()));
        let read = parse_toml(&text, std::path::Path::new("round.toml")).unwrap();
        assert_eq!(read.effects[0].parameters, table.parameters, "{}", kind.name);
        let (before, after) =
            (Placed::new(&table, &arm).unwrap(), Placed::new(&read.effects[0], &read.arm).unwrap());
        assert_eq!(format!("{:?}", before.effect), format!("{:?}", after.effect), "{}", kind.name);
        let mut unknown = table.clone();
        unknown.parameters.insert("no_such_parameter".into(), Value::Float(1.0));
        let error = Placed::new(&unknown, &arm).unwrap_err().to_string();
        assert!(error.contains("no_such_parameter"), "{}: {error}", kind.name);
    }
}

/// The error for a number out of range or a missing one contains its name.
#[test]
fn numbers_out_of_range_and_missing_ones_are_refused() {
    let (arm, motion) = (arm(), motion(6, 50.0, 12.0));
    for kind in kinds() {
        let good = typical(kind, &arm, &motion);
        let joint = site(kind).map(|joint| arm.joints()[joint].name.clone());
        let refused = |parameters: Table, name: &str| {
            let table = EffectTable { kind: kind.name.into(), joint: joint.clone(), parameters, line: 7 };
            let error = Placed::new(&table, &arm).expect_err(name).to_string();
            assert!(error.contains(name) && error.contains("line 7"), "{}: {error}", kind.name);
        };
        for parameter in kind.parameters {
            if let Range::Number { least, most, absent, .. } = parameter.range {
                for beyond in [least - 1e-3 * least.abs().max(1e-3), 2.0 * most + 1.0, f64::NAN] {
                    let mut table = good.clone();
                    table.insert(parameter.name.into(), Value::Float(beyond));
                    refused(table, parameter.name);
                }
                if absent == Absent::Refused {
                    let mut table = good.clone();
                    table.remove(parameter.name);
                    refused(table, parameter.name);
                }
            }
        }
    }
}

/// For a fixed shape, the full prediction is an affine function of the coefficients, and its slopes are the columns: exactly for torques,
/// to second order for small shifts of the geometry.
#[test]
fn predictions_are_sums_of_the_terms() {
    let (arm, motion) = (arm(), motion(6, 50.0, 12.0));
    let baseline = Baseline::new(&arm, &[], &motion, &raw).unwrap();
    for kind in kinds() {
        let place = Place { scene: baseline.scene(), joint: site(kind) };
        let shape = shape(kind, &place);
        let columns = kind.columns(&baseline, place.joint, &shape).unwrap();
        let full = coefficients(kind, &baseline, &shape);
        let scaled = |factor: f64| -> Vec<f64> { full.iter().map(|c| factor * c).collect() };
        let shown = |factor: f64| {
            let effect = kind.place(&place, kind.compose(&shape, &scaled(factor))).unwrap();
            common::added(&arm, &[effect], &motion)
        };
        for (low, high) in [(0.5, 1.0), (1.0, 2.0)] {
            let mut increment = shown(high);
            increment.subtract(&shown(low));
            let off =
                difference(&increment, &common::whole(&arm, &motion, &sum(&columns, &scaled(high - low))));
            let size = greatest(increment.columns().flatten());
            println!(
                "{}, {low} to {high}: off by {off:.1e} of the change {size:.1e}, margin 2e-2",
                kind.name
            );
            assert!(size > 0.0, "{} shows nothing", kind.name);
            // The contact's penetration, some µm, grows with the cube root of the clearance.
            let margin = if kind.name == "joint_clearance" { 0.04 } else { 0.02 };
            assert!(off < margin, "{} is not affine in {full:?}: {off:e}", kind.name);
        }
    }
}

/// The short cut of [`Baseline::change`] equals the difference of two full predictions.
#[test]
fn the_short_cut_of_a_column_agrees_with_two_predictions() {
    let (arm, motion) = (arm(), motion(6, 50.0, 12.0));
    let baseline = Baseline::new(&arm, &[], &motion, &raw).unwrap();
    for kind in kinds() {
        let effect = placed(&arm, kind.name, site(kind), typical(kind, &arm, &motion));
        let short = common::whole(&arm, &motion, &baseline.change(&effect).unwrap());
        let full = common::added(&arm, &[effect], &motion);
        let off = difference(&short, &full);
        println!("{}: off by {off:.1e} of the effect, margin 1e-2", kind.name);
        assert!(off < 1e-2, "{}: {off:e}", kind.name);
    }
}

/// A column that is the difference of two predictions, in every shape: the change by the first minus that by the second, behind a low-pass.
#[test]
fn the_change_between_two_effects_is_the_difference_of_their_changes() {
    let (arm, motion) = (arm(), motion(6, 100.0, 6.0));
    let mean = |column: &[f64]| -> Vec<f64> {
        let before = column.first().into_iter().chain(column);
        before.zip(column).map(|(before, now)| 0.5 * (before + now)).collect()
    };
    let baseline = Baseline::new(&arm, &[], &motion, &mean).unwrap();
    let sizes = |change: &Change| {
        [&change.torque, &change.tool, &change.link]
            .map(|columns| greatest(columns.all_written().flat_map(|(_, column)| column)))
    };
    for kind in kinds() {
        let place = Place { scene: baseline.scene(), joint: site(kind) };
        for shape in (kind.shapes)(&place) {
            for (term, column) in kind.columns(&baseline, site(kind), &shape).unwrap() {
                let Some(minus) = &term.minus else { continue };
                let change = |of: &Table| baseline.change(&kind.place(&place, of.clone()).unwrap()).unwrap();
                let mut difference = change(&term.plus);
                let largest = sizes(&difference).map(|size| size * term.weight.abs());
                difference.add(&change(minus), -1.0);
                difference.scale(term.weight);
                difference.add(&column, -1.0);
                for (off, largest) in sizes(&difference).into_iter().zip(largest) {
                    println!("{}, {}: off by {off:.1e} of {largest:.1e}", kind.name, term.name);
                    assert!(off <= 1e-9 * largest, "{}, {}", kind.name, term.name);
                }
            }
        }
    }
}

/// Bounds of the terms keep the result physical: a negative extra friction is at most the friction of the arm file.
#[test]
fn bounds_know_the_nominal_friction() {
    let (arm, motion) = (arm(), motion(6, 50.0, 4.0));
    let scene = Scene::new(arm, &motion);
    let place = Place { scene: &scene, joint: Some(JOINT) };
    for (name, least) in
        [("coulomb_friction", -2.0), ("viscous_friction", -1.5), ("asymmetric_friction", -2.0)]
    {
        let kind = freeplay_laws::kind(name).unwrap();
        for term in kind.terms_at(&place, &Table::new()) {
            assert_eq!(term.least, least, "{name}");
        }
    }
}

/// Where an effect acts on the drives or on the sensors alone, plant and recording have the same law: at speeds without a smoothed sign,
/// one sub-step of the plant gives the predicted torque, and one reading the predicted offset. A recording's sample at the edge of an event has a share of it.
#[test]
fn drives_and_sensors_of_the_plant_say_the_same() {
    let (arm, motion) = (arm(), motion(6, 200.0, 8.0));
    let mut tried = 0;
    for kind in kinds() {
        let parameters = typical(kind, &arm, &motion);
        let edges = ["start", "end", "time"].map(|name| parameters.get(name)?.as_float());
        let effect = placed(&arm, kind.name, site(kind), parameters);
        let mut injection = freeplay_laws::Injection::default();
        effect.effect.inject(&mut injection);
        let memory = ["presliding_friction", "backlash"].contains(&kind.name);
        if memory || injection.drives.len() != 1 || !injection.rotors.is_empty() {
            continue;
        }
        let predicted = common::added(&arm, &[effect], &motion);
        let scene = Scene::new(arm.clone(), &motion);
        let (mut worst, mut size) = (0.0_f64, 0.0_f64);
        for point in 0..motion.len() {
            let [mut q, mut v, mut a] = [const { [0.0; 6] }; 3];
            motion.at(point, &mut q, &mut v, &mut a);
            let is_at_edge = edges.iter().flatten().any(|edge| (motion.t[point] - edge).abs() < 0.0025);
            if v[JOINT].abs() < 0.02 || kind.happens() && is_at_edge {
                continue;
            }
            let load: Vec<f64> = scene.load.iter().map(|load| load[point]).collect();
            let mut torque = [0.0; 6];
            let sign: Vec<f64> = v.iter().map(|v| DriveFriction::sign(*v)).collect();
            let stopping = vec![f64::MAX; v.len()];
            let now = DriveState {
                t: motion.t[point],
                step: 0.005,
                q: &q,
                v: &v,
                sign: &sign,
                stopping: &stopping,
                a: &a,
                load: &load,
            };
            injection.drives[0].act(&now, &mut torque);
            for (joint, torque) in torque.iter().enumerate() {
                worst = worst.max((torque + predicted.torque[joint][point]).abs());
                size = size.max(torque.abs());
            }
        }
        tried += 1;
        println!("{}: worst {worst:.1e} of {size:.1e}, margin 1e-9 of it", kind.name);
        assert!(size > 0.0 && worst <= 1e-9 * size, "{}", kind.name);
    }
    assert!(tried >= 8, "only {tried} kinds were compared");
}

/// A sensor's law, evaluated at every point, equals the prediction's `measure`.
#[test]
fn sensors_read_what_is_predicted() {
    let (arm, motion) = (arm(), motion(6, 200.0, 4.0));
    let clean = freeplay_laws::predict(&arm, &[], &motion, &raw).unwrap();
    for (name, text) in [("torque_offset", "offset = 0.7"), ("torque_gain", "gain = 1.1")] {
        let effect = common::effect(&arm, name, Some(JOINT), text);
        let mut injection = freeplay_laws::Injection::default();
        effect.effect.inject(&mut injection);
        let shown = freeplay_laws::predict(&arm, &[effect], &motion, &raw).unwrap();
        let mut worst = 0.0_f64;
        for point in 0..motion.len() {
            let mut torque: Vec<f64> = clean.torque.iter().map(|column| column[point]).collect();
            let mut none = [[0.0; 6]; 3];
            let [q, v, link] = &mut none;
            let mut readings =
                Readings { period: 0.005, q, v, torque: &mut torque, link, tool: &mut [0.0; 3] };
            injection.sensors[0].read(&mut readings);
            worst = torque
                .iter()
                .zip(&shown.torque)
                .fold(worst, |w, (t, column)| w.max((t - column[point]).abs()));
        }
        println!("{name}: worst {worst:.1e} N·m, margin 1e-9");
        assert!(worst < 1e-9);
    }
}

/// The role determines the treatment in a diagnosis; a coefficient makes every kind identifiable.
#[test]
fn every_kind_has_a_coefficient() {
    for kind in kinds() {
        let linear = kind.parameters.iter().any(|parameter| {
            matches!(
                parameter.range,
                Range::Number { role: Role::Linear, .. } | Range::Vector { role: Role::Linear, .. }
            )
        });
        assert!(linear, "{}", kind.name);
    }
}

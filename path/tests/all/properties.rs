//! For any scenario or file: a result or an error, never a panic, and a motion within its contract.

use crate::common;
use freeplay_path::{JointPath, PathKind, PathSpec, Size};
use proptest::prelude::{Just, ProptestConfig, Strategy, any, prop_oneof};
use proptest::{collection, option, prop_assert, proptest};

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![4 => -1.0..1.5_f64, 1 => any::<f64>(), 1 => Just(0.0)]
}

fn triple() -> impl Strategy<Value = [f64; 3]> {
    (number(), number(), number()).prop_map(|(x, y, z)| [x, y, z])
}

fn any_spec() -> impl Strategy<Value = PathSpec> {
    let kind = prop_oneof![
        Just(PathKind::Lissajous),
        Just(PathKind::Circle),
        Just(PathKind::Square),
        Just(PathKind::SquareSharp),
        Just(PathKind::JointSine)
    ];
    let size = option::of(prop_oneof![number().prop_map(Size::One), triple().prop_map(Size::Axes)]);
    let start = option::of(collection::vec(number(), 6..8));
    let time = (prop_oneof![0.01..10.0_f64, number()], 0_u32..4);
    (kind, triple(), size, triple(), time, option::of(number()), start).prop_map(
        |(kind, centre, size, rpy, (period, laps), blend, start)| PathSpec {
            kind,
            centre,
            size,
            rpy,
            period,
            laps,
            file: None,
            blend,
            start,
        },
    )
}

/// Evaluates the path over the whole motion and beyond; true if every number is finite.
fn finite_everywhere(path: &JointPath) -> bool {
    let [mut q, mut v, mut a] = [0, 1, 2].map(|_| vec![0.0; path.dof()]);
    (-5..105).all(|k| {
        path.at(f64::from(k) / 100.0 * path.duration(), &mut q, &mut v, &mut a);
        q.iter().chain(&v).chain(&a).all(|x| x.is_finite())
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_description_is_planned_or_refused(spec in any_spec(), rate in prop_oneof![50.0..500.0_f64, any::<f64>()]) {
        if let Ok(path) = JointPath::plan(&common::paper_arm(), &spec, rate) {
            prop_assert!(finite_everywhere(&path));
        }
    }

    #[test]
    fn reachable_circles_are_planned(x in 0.7..1.0_f64, y in -0.3..0.3_f64, z in 0.6..1.0_f64, size in 0.01..0.1_f64) {
        let spec = PathSpec {
            kind: PathKind::Circle, centre: [x, y, z], size: Some(Size::One(size)), period: 2.0, ..PathSpec::default()
        };
        let path = JointPath::plan(&common::paper_arm(), &spec, 100.0);
        prop_assert!(path.is_ok(), "{:?}", path.err());
    }

    #[test]
    fn any_text_is_read_or_refused(
        head in prop_oneof![Just("t,q1"), Just("q1,t,x"), Just("t,x,y,z"), Just("t,x,y,z,qx,qy,qz,qw"), Just("\"t")],
        rows in collection::vec(collection::vec(prop_oneof![
            4 => (0..9_u8).prop_map(|k| k.to_string()),
            2 => number().prop_map(|x| x.to_string()),
            1 => any::<String>(),
        ], 1..9), 0..9),
    ) {
        let rows: Vec<String> = rows.iter().enumerate().map(|(k, row)| format!("{k},{}", row.join(","))).collect();
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("path.csv");
        std::fs::write(&file, format!("{head}\n{}\n", rows.join("\n"))).expect("the folder is ours");
        let spec = PathSpec { kind: PathKind::File, file: Some(file), ..PathSpec::default() };
        for arm in [common::pendulum(), common::cylindrical()] {
            if let Ok(path) = JointPath::plan(&arm, &spec, 100.0) {
                prop_assert!(finite_everywhere(&path));
            }
        }
    }
}

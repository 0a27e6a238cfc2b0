//! The specification of a path in TOML: defaults, round trip, and all its errors.

use std::f64::consts::FRAC_PI_2;

use freeplay_path::{PathKind, PathSpec, Size, SpecError};

#[test]
fn an_empty_table_is_the_smooth_path_of_six_seconds() {
    let spec: PathSpec = toml::from_str("").expect("every field has a default");
    assert_eq!(spec, PathSpec::default());
    assert_eq!(
        (spec.kind, spec.centre, spec.period, spec.laps),
        (PathKind::Lissajous, [0.95, 0.0, 0.95], 6.0, 1)
    );
    assert_eq!(spec.rpy, [0.0, FRAC_PI_2, 0.0]);
    assert_eq!(spec.validate(), Ok(()));
}

#[test]
fn what_is_written_is_read_back() {
    let text = r#"
        kind = "square_sharp"
        centre = [0.9, 0.1, 0.8]
        size = 0.1
        rpy = [0.0, 1.0, 0.2]
        period = 12.0
        laps = 3
        blend = 0.01
        start = [0.0, 0.1, 0.2, 0.0, 1.5, 0.0]
    "#;
    let spec: PathSpec = toml::from_str(text).expect("a valid table");
    assert_eq!((spec.kind, spec.size, spec.blend), (PathKind::SquareSharp, Some(Size::One(0.1)), Some(0.01)));
    let again: PathSpec =
        toml::from_str(&toml::to_string(&spec).expect("it serialises")).expect("it reads back");
    assert_eq!(again, spec);
    let json: PathSpec =
        serde_json::from_str(&serde_json::to_string(&spec).expect("it serialises")).expect("it reads back");
    assert_eq!(json, spec);
}

#[test]
fn every_kind_has_the_name_that_errors_use() {
    for kind in [
        PathKind::Lissajous,
        PathKind::Circle,
        PathKind::Square,
        PathKind::SquareSharp,
        PathKind::File,
        PathKind::JointSine,
    ] {
        assert_eq!(serde_json::to_value(kind).expect("it serialises"), kind.name());
    }
}

#[test]
fn bad_tables_are_refused_with_the_key_and_the_range() {
    for (text, part) in [
        ("period = 0.0", "path.period = 0 s"),
        ("period = -1.0", "path.period = -1 s"),
        ("period = nan", "path.period = NaN s"),
        ("period = inf", "path.period = inf s"),
        ("period = 86401.0", "path.period = 86401 s"),
        ("laps = 0", "path.laps = 0"),
        ("laps = 100000", "last 600000 s"),
        ("centre = [0.1, nan, 0.0]", "path.centre holds NaN"),
        ("rpy = [inf, 0.0, 0.0]", "path.rpy holds inf"),
        ("start = [0.0, -inf]", "path.start holds -inf"),
        ("size = 0.1", "three amplitudes"),
        ("size = [0.1, 0.1, nan]", "path.size holds NaN"),
        ("kind = 'circle'\nsize = [0.1, 0.1, 0.1]", "one number"),
        ("kind = 'circle'\nsize = 0.0", "positive"),
        ("kind = 'square'\nsize = -0.1", "positive"),
        ("kind = 'square'\nblend = 0.0", "path.blend = 0"),
        ("kind = 'square'\nblend = 0.6", "path.blend = 0.6"),
        ("kind = 'circle'\nblend = 0.1", "path.blend has no meaning for kind = \"circle\""),
        ("file = 'a.csv'", "path.file has no meaning for kind = \"lissajous\""),
        ("kind = 'file'", "needs path.file"),
        ("kind = 'file'\nfile = 'a.csv'\nsize = 1.0", "path.size has no meaning for kind = \"file\""),
    ] {
        let spec: PathSpec = toml::from_str(text).expect("the table itself can be read");
        let error = spec.validate().expect_err(text);
        assert!(error.to_string().contains(part), "{text}: {error}");
    }
}

#[test]
fn tables_that_are_no_path_are_refused_while_reading() {
    for (text, part) in [
        ("kind = 'spiral'", "unknown variant `spiral`"),
        ("radius = 0.1", "unknown field `radius`"),
        ("kind = 'circle'\nsize = 'large'", "a number or an array of three numbers"),
        ("laps = -1", "invalid value"),
        ("centre = [0.0, 1.0]", "invalid length 2"),
    ] {
        let error = toml::from_str::<PathSpec>(text).expect_err(text).to_string();
        assert!(error.contains(part), "{text}: {error}");
    }
}

#[test]
fn the_limits_themselves_are_allowed() {
    let spec = PathSpec { period: 86_400.0, ..PathSpec::default() };
    assert_eq!(spec.validate(), Ok(()));
    let twice = PathSpec { laps: 2, ..spec };
    assert_eq!(twice.validate(), Err(SpecError::TooLong { laps: 2, lap: 86_400.0 }));
    let halves = PathSpec { kind: PathKind::Square, blend: Some(0.5), ..PathSpec::default() };
    assert_eq!(halves.validate(), Ok(()));
}

//! Tests of task files: accepted texts, refused texts and the error messages.

use std::path::Path;

use freeplay_controller::{
    Controller, ControllerError, LimitsFrom, QuasiStaticControl, RunInfo, Task, TaskError, TaskMode, built_in,
};
use freeplay_shm::{Mode, Pace};
use proptest::prelude::{ProptestConfig, prop_assert, proptest};

const RUN: RunInfo =
    RunInfo { joints: 6, mode: Mode::Torque, pace: Pace::Lockstep, period_ns: 1_000_000, ticks: 10 };

#[test]
fn a_task_survives_being_written() {
    let mut task = Task {
        gravity: Some([0.0, 0.1, -9.0]),
        mode: TaskMode::Driven,
        limits: LimitsFrom::None,
        ..Task::default()
    };
    task.path.period = 12.0;
    task.path.file = None;
    task.options.insert("blend".into(), 0.25.into());
    let text = task.to_toml().unwrap();
    println!("{text}");
    assert_eq!(Task::parse(&text, "t").unwrap(), task);
    assert_eq!(Task::parse("model = \"paper\"", "t").unwrap(), Task::default());
}

#[test]
fn paths_are_taken_from_the_folder_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("task.toml");
    std::fs::write(&file, "model = \"arm.toml\"\n[path]\nkind = \"file\"\nfile = \"p.csv\"\n").unwrap();
    let task = Task::load(&file).unwrap();
    assert_eq!(Path::new(&task.model), folder.path().join("arm.toml"));
    assert_eq!(task.path.file, Some(folder.path().join("p.csv")));
}

#[test]
fn bad_task_files_are_refused_with_the_place() {
    let cases = [
        ("", "model"),
        ("model = 3", "expected text in quotes"),
        ("model = \"paper\"\nmodle = 1", "line 2"),
        ("model = \"paper\"\nclearance = 0.0006", "unknown field `clearance`"),
        ("model = \"paper\"\nmode = \"torq\"", "unknown value `torq`"),
        ("model = \"paper\"\nrate = 0", "rate = 0 is out of range"),
        ("model = \"paper\"\nrate = nan", "rate = NaN is out of range"),
        ("model = \"paper\"\ngravity = [0, 0]", "expected a list of 3 values"),
        ("model = \"paper\"\ngravity = [0.0, 0.0, inf]", "gravity = inf"),
        ("model = \"paper\"\n[gains]\nnatural_frequency = -1", "gains.natural_frequency = -1"),
        ("model = \"paper\"\n[gains]\ndamping_ratio = 1e9", "gains.damping_ratio"),
        ("model = \"paper\"\n[gains]\nki = 1", "unknown field `ki`"),
        ("model = \"paper\"\n[path]\nkind = \"spiral\"", "unknown value `spiral`"),
        ("model = \"paper\"\nmodel = \"paper\"", "duplicate key"),
        ("\u{0}", "line 1"),
    ];
    for (text, expected) in cases {
        let error = Task::parse(text, "task.toml").expect_err(text).to_string();
        println!("{text:?}: {error}\n");
        assert!(error.contains(expected) && error.contains("task.toml"), "{text:?}: {error}");
    }
    let error = Task::load(Path::new("/nowhere/task.toml")).unwrap_err();
    assert!(matches!(error, TaskError::Unreadable { .. }), "{error}");
}

#[test]
fn controllers_refuse_what_does_not_fit() {
    let task = |text: &str| Task::parse(&format!("model = \"paper\"\n{text}"), "task.toml").unwrap();
    let cases = [
        ("[options]\nblnd = 1", RUN, "unknown field `blnd`"),
        ("[options]\nblend = 0", RUN, "blend must be"),
        ("[options]\naverage = -1", RUN, "average must be"),
        ("[options]\naverage = 0.005", RUN, "average must be"),
        ("[options.weights]\nchange = 0", RUN, "weights.change"),
        ("[options.weights]\nposition = [1, 1, -1]", RUN, "weights.position"),
        ("", RunInfo { joints: 7, ..RUN }, "has 6 joints, the plant's arm has 7"),
        ("", RunInfo { mode: Mode::Driven, ..RUN }, "mode = torque, but the plant has driven"),
        ("", RunInfo { period_ns: 2_000_000, ..RUN }, "rate = 1000 per second"),
        ("[path]\nperiod = -1", RUN, "path.period"),
        ("[path]\ncentre = [9.0, 0.0, 0.0]", RUN, "cannot reach"),
    ];
    for (text, run, expected) in cases {
        let error = QuasiStaticControl::default().start(&task(text), &run).expect_err(text).to_string();
        println!("{text:?}: {error}");
        assert!(error.contains(expected), "{text:?}: {error}");
    }
    let missing = Task { model: "/nowhere/arm.toml".to_owned(), ..Task::default() };
    let error = built_in("computed-torque").unwrap().start(&missing, &RUN).unwrap_err();
    assert!(matches!(error, ControllerError::Custom(_)), "{error}");
    let error = built_in("computed-torque").unwrap().start(&task("[options]\nblend = 1"), &RUN).unwrap_err();
    assert!(error.to_string().contains("unknown field `blend`"), "{error}");
    assert!(built_in("narx").is_none());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

    /// 4000 texts, each a valid file with one piece replaced by random text; the reader accepts or refuses them, but never
    /// panics.
    #[test]
    fn no_text_makes_the_reader_panic(at in 0usize..400, length in 0usize..12, piece in ".{0,12}") {
        let mut task = Task { gravity: Some([0.0, 0.0, -9.81]), ..Task::default() };
        task.options.insert("blend".into(), 0.25.into());
        let good = task.to_toml().unwrap();
        let start = good.floor_char_boundary(at.min(good.len()));
        let end = good.floor_char_boundary((start + length).min(good.len()));
        let text = format!("{}{piece}{}", &good[..start], &good[end..]);
        if let Err(error) = Task::parse(&text, "task.toml") {
            prop_assert!(error.to_string().contains("task.toml"));
        }
    }
}

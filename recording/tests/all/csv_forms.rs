//! Usual forms of CSV: every form of the same recording is read as that recording.

use freeplay_recording::{ImportOptions, Mapping, Recording, import, read};

const ROWS: usize = 60;

/// The common content of all forms: time from 0, two joints with their torques.
fn value(column: usize, row: usize) -> f64 {
    let t = row as f64 * 0.01;
    match column {
        0 => t,
        1 => (3.0 * t).sin(),
        2 => 0.5 - t,
        3 => 10.0 * (5.0 * t).cos(),
        _ => -3.25,
    }
}

/// A file of rows made by `row`, below `header`.
fn text(header: &str, row: impl Fn([f64; 5], usize) -> String) -> String {
    let rows = (0..ROWS).map(|k| row([0, 1, 2, 3, 4].map(|column| value(column, k)), k) + "\n");
    std::iter::once(header.to_owned()).chain(rows).collect()
}

/// Cells one after the other, with `separator` between them and `decimal` within.
fn cells(values: [f64; 5], separator: &str, decimal: &str) -> String {
    values.map(|value| format!("{value:.6}").replace('.', decimal)).join(separator)
}

fn read_text(text: &str) -> Result<Recording, String> {
    let folder = tempfile::tempdir().expect("a folder");
    // The ending carries no information.
    let path = folder.path().join("run.dat");
    std::fs::write(&path, text).expect("written");
    read(&path, None).map_err(|error| error.to_string())
}

/// Fails unless `recording` equals the common content of all forms.
fn check(name: &str, recording: &Recording) {
    assert_eq!((recording.len(), recording.joints()), (ROWS, 2), "{name}: {:?}", recording.columns());
    let tau = recording.tau.as_ref().unwrap_or_else(|| panic!("{name} has torques"));
    let columns = [&recording.t, &recording.q[0], &recording.q[1], &tau[0], &tau[1]];
    for (column, found) in columns.iter().enumerate() {
        for (row, found) in found.iter().enumerate() {
            let begin = if column == 0 { recording.t[0] } else { 0.0 };
            let off = (found - begin - value(column, row)).abs();
            assert!(off < 1e-6, "{name}: column {column}, row {row}: {found}, off by {off:.1e}");
        }
    }
}

/// Header and row of each form that needs no mapping.
#[test]
fn forms_that_need_no_mapping() {
    type Form<'a> = (&'a str, &'a str, &'a dyn Fn([f64; 5], usize) -> String);
    let plain = |v: [f64; 5], _: usize| cells(v, ",", ".");
    let [q1, q2] = ["shoulder_pan_joint", "elbow_joint"];
    let named = format!("time [ms];{q1}_pos [deg];{q2}_pos [deg];{q1}_eff [Nm];{q2}_eff [Nm]\n");
    let scaled = |v: [f64; 5]| [v[0] * 1e3, v[1].to_degrees(), v[2].to_degrees(), v[3], v[4]];
    let listed = "timestamp,name,position,effort\n";
    let stamp = |t: f64| format!("2024-11-20T10:{:02}:{:09.6}Z", 7 + (t / 60.0) as u32, t % 60.0);
    let forms: [Form; 22] = [
        ("plain", "t,q1,q2,tau1,tau2\n", &plain),
        ("semicolons", "t;q1;q2;tau1;tau2\n", &|v, _| cells(v, ";", ".")),
        ("semicolons and commas", "t;q1;q2;tau1;tau2\n", &|v, _| cells(v, ";", ",")),
        ("tabs", "t\tq1\tq2\ttau1\ttau2\n", &|v, _| cells(v, "\t", ".")),
        ("blanks", "t  q1 q2  tau1 tau2\n", &|v, _| format!("  {}", cells(v, "   ", "."))),
        ("bars", "t|q1|q2|tau1|tau2\n", &|v, _| cells(v, "|", ".")),
        ("BOM and CRLF", "\u{feff}t,q1,q2,tau1,tau2\r\n", &|v, _| cells(v, ",", ".") + "\r"),
        ("comments", "# cell 7, Monday\n% made by hand\nt,q1,q2,tau1,tau2\n", &|v, k| {
            if k == 9 { format!("# a mark, here\n{}", plain(v, k)) } else { plain(v, k) }
        }),
        ("savetxt", "# t,q1,q2,tau1,tau2\n", &plain),
        ("savetxt with blanks", "# t q1 q2 tau1 tau2\n", &|v, _| cells(v, " ", ".")),
        ("index", ",t,q1,q2,tau1,tau2\n", &|v, k| format!("{k},{}", plain(v, k))),
        ("index as R writes it", "t,q1,q2,tau1,tau2\n", &|v, k| format!("\"{}\",{}", k + 1, plain(v, k))),
        ("trailing in rows", "t,q1,q2,tau1,tau2\n", &|v, k| plain(v, k) + ","),
        ("trailing in the header", "t,q1,q2,tau1,tau2,\n", &plain),
        ("trailing in both", "t,q1,q2,tau1,tau2,\n", &|v, k| plain(v, k) + ","),
        ("split stamps", "sec,nanosec,q1,q2,tau1,tau2\n", &|v, k| {
            format!("{},{}{}", 1_732_000_000 + k / 100, k % 100 * 10_000_000, &plain(v, k)[8..])
        }),
        ("ISO time", "stamp,q1,q2,tau1,tau2\n", &|v, k| format!("{}{}", stamp(v[0]), &plain(v, k)[8..])),
        ("ISO index", ",q1,q2,tau1,tau2\n", &|v, k| {
            format!("{}{}", stamp(v[0]).replace('T', " ").replace('Z', "+00:00"), &plain(v, k)[8..])
        }),
        ("units below the names", "Time;J1;J2;M1;M2\ns;rad;rad;Nm;Nm\n", &|v, _| cells(v, ";", ",")),
        ("units in brackets", &named, &|v, _| cells(scaled(v), ";", ",")),
        ("lists in a cell", listed, &|v, _| {
            format!("{},\"['{q1}', '{q2}']\",\"[{}, {}]\",\"[{} {}]\"", v[0], v[1], v[2], v[3], v[4])
        }),
        (
            "rostopic -p",
            "%time,field.name0,field.name1,field.position0,field.position1,field.effort0,field.effort1\n",
            &|v, k| {
                format!(
                    "{},{q1},{q2}{}",
                    1_732_000_000_000_000_000 + k as u64 * 10_000_000,
                    &plain(v, k)[8..]
                )
            },
        ),
    ];
    for (name, header, row) in forms {
        let recording = read_text(&text(header, row)).unwrap_or_else(|error| panic!("{name}: {error}"));
        check(name, &recording);
        if ["units in brackets", "lists in a cell", "rostopic -p"].contains(&name) {
            let joints = recording.joint_names.join(",");
            assert!(joints == format!("{q1},{q2}") || joints == "shoulder_pan,elbow", "{name}: {joints}");
        }
    }
}

#[test]
fn logs_of_robots_and_tools() {
    let quoted = |names: [String; 5]| names.join(",") + "\n";
    let numbered = [
        "__time",
        "/joint_states/position[0]",
        "/joint_states/position[1]",
        "/joint_states/effort[0]",
        "/joint_states/effort[1]",
    ];
    let of = |joint: &str, what: &str| format!("/joint_states/{joint}/{what}");
    let named = [
        "__time".to_owned(),
        of("pan", "position"),
        of("elbow", "position"),
        of("pan", "effort"),
        of("elbow", "effort"),
    ];
    for (name, header) in
        [("PlotJuggler, numbers", quoted(numbered.map(str::to_owned))), ("PlotJuggler, names", quoted(named))]
    {
        let made = text(&header, |v, _| cells([1.7e9 + v[0], v[1], v[2], v[3], v[4]], ",", "."));
        check(name, &read_text(&made).unwrap_or_else(|error| panic!("{name}: {error}")));
    }
    let header = "timestamp target_q_0 target_q_1 actual_q_0 actual_q_1 actual_current_0 actual_current_1 actual_TCP_pose_0 runtime_state\n";
    let made =
        text(header, |v, _| format!("{} 9 9 {} {} {} {} 0.5 2", 5000.0 + v[0], v[1], v[2], v[3], v[4]));
    let recording = read_text(&made).expect("a log of the Real-Time Data Exchange");
    check("RTDE", &recording);
    assert!(recording.q_ref.is_some() && recording.guessed.is_some_and(|toml| toml.contains("amperes")));
}

#[test]
fn a_file_without_a_header_is_read_by_a_mapping() {
    let made = text("", |v, _| cells(v, ",", "."));
    let folder = tempfile::tempdir().expect("a folder");
    let [data, map] = ["run.csv", "map.toml"].map(|name| folder.path().join(name));
    std::fs::write(&data, made).expect("written");
    let mappings = [
        "[t]\ncolumns = \"1\"\n[q]\ncolumns = \"q{}\"\n[tau]\ncolumns = \"tau{}\"\n",
        "[t]\ncolumns = \"1\"\n[q]\ncolumns = [\"2\", \"3\"]\n[tau]\ncolumns = [\"4\", \"5\"]\n",
        "[t]\ncolumns = \"1\"\n[q]\ncolumns = \"{}\"\nfirst = 2\n[tau]\ncolumns = \"{}\"\nfirst = 4\n",
    ];
    for mapping in mappings {
        std::fs::write(&map, mapping).expect("written");
        let mapping = Some(Mapping::load(&map).expect("a mapping"));
        let options = ImportOptions { mapping, ..ImportOptions::default() };
        check("without a header", &import(&data, &options).expect("it reads"));
    }
}

/// The guessed mapping, used as a mapping file, gives the same recording.
#[test]
fn a_guess_can_be_given_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let [data, map] = ["run.csv", "map.toml"].map(|name| folder.path().join(name));
    let made = text("Time [ms];a_pos;b_pos;a_torque;b_torque\n", |v, _| {
        cells([v[0] * 1e3, v[1], v[2], v[3], v[4]], ";", ",")
    });
    std::fs::write(&data, made).expect("written");
    let guessed = read(&data, None).expect("it reads");
    check("guessed", &guessed);
    std::fs::write(&map, guessed.guessed.as_ref().expect("a guess")).expect("written");
    let options =
        ImportOptions { mapping: Some(Mapping::load(&map).expect("a mapping")), ..ImportOptions::default() };
    let again = import(&data, &options).expect("it reads");
    check("given back", &again);
    assert_eq!(again.joint_names, guessed.joint_names);
}

#[test]
fn what_is_missing_is_missing_there_and_the_rest_is_used() {
    let lacking = |lacks: &dyn Fn(usize, usize) -> bool, cell: &str| {
        text("t,q1,q2,tau1,tau2\n", |v, k| {
            (0..5)
                .map(|column| if lacks(column, k) { cell.to_owned() } else { v[column].to_string() })
                .collect::<Vec<_>>()
                .join(",")
        })
    };
    for cell in ["", "nan", "NaN", "null", "n/a", "inf"] {
        let recording =
            read_text(&lacking(&|column, k| column == 4 || (column == 3 && k < 7), cell)).expect("it reads");
        let tau = recording.tau.as_ref().expect("torques");
        assert!(
            tau[1].iter().all(|x| x.is_nan()) && tau[0].iter().filter(|x| x.is_nan()).count() == 7,
            "{cell:?}"
        );
        let said = recording.notes.join("; ");
        assert!(said.contains("tau1 in 7 of 60 samples, tau2 throughout"), "{said}");
    }
    let recording = read_text(&lacking(&|column, _| column > 2, "nan")).expect("it reads");
    assert_eq!(recording.columns(), ["t", "q1", "q2"], "a group without numbers is no group");
    let recording = read_text(&lacking(&|column, k| (column == 0 && k == 3) || (column == 2 && k == 8), ""))
        .expect("it reads");
    assert_eq!(recording.len(), ROWS - 2);
    let said = recording.notes.join("; ");
    assert!(
        said.contains("2 of 60 rows are left out") && said.contains("column q2 holds no number in 1"),
        "{said}"
    );
    let partial = read_text(&text("t,q1,q2,tau2,z\n", |v, _| cells(v, ",", "."))).expect("it reads");
    assert!(
        partial.tau.is_some_and(|tau| tau[0][0].is_nan())
            && partial.tool.is_some_and(|tool| tool[2][0] == -3.25)
    );
}

#[test]
fn late_and_repeated_stamps_are_put_right_and_counted() {
    let mut rows: Vec<String> =
        (0..ROWS).map(|k| cells([0, 1, 2, 3, 4].map(|column| value(column, k)), ",", ".")).collect();
    rows.swap(10, 11);
    rows.insert(30, rows[30].clone());
    let recording = read_text(&format!("t,q1,q2,tau1,tau2\n{}\n", rows.join("\n"))).expect("it reads");
    check("sorted", &recording);
    let said = recording.notes.join("; ");
    assert!(said.contains("1 late, sorted by time; 1 repeated, dropped"), "{said}");
}

//! The receipt of a blind proof: verification detects any later change, field by field.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use crate::common::fresh_folder;
use freeplay_concealed::{Case, Machine, Quota, draw_set};
use serde_json::{Map, Value, json};
use sha2::{Digest, Sha256};
use tempfile::TempDir;

/// Receipts that one call verifies.
const BATCH: usize = 400;

/// The exit code of `freeplay blind` with `arguments` in `folder`, and its output.
fn blind(folder: &Path, arguments: &[&str]) -> (i32, String) {
    let output =
        Command::new(crate::common::FREEPLAY).arg("blind").args(arguments).current_dir(folder).output();
    let output = output.expect("it starts");
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    (output.status.code().expect("an exit code"), text.concat())
}

/// As [`blind`]; fails unless the exit code is `code`.
fn blind_to(code: i32, folder: &Path, arguments: &[&str]) -> String {
    let (found, text) = blind(folder, arguments);
    assert_eq!(found, code, "{arguments:?}\n{text}");
    text
}

fn read(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).expect("a receipt")).expect("JSON")
}

/// The seed of a set of two quick cases. Seconds pass until it is found.
static QUICK: LazyLock<String> = LazyLock::new(|| {
    let kinds = ["coulomb_friction", "viscous_friction", "quadratic_drag", "torque_offset", "friction_drift"];
    let quick =
        |case: &Case| case.machine == Machine::Slide && kinds.contains(&case.effects[0].kind.as_str());
    let all_quick = |seed: &u64| draw_set(&Quota::small(2), *seed).expect("cases").iter().all(quick);
    (1..100_000).find(all_quick).expect("a seed").to_string()
});

/// Two shards with one quick case each, in the folders 1 and 2, their receipts merged in the folder all, and the list of their seals.
fn two_shards() -> TempDir {
    let folder = fresh_folder();
    for shard in ["1", "2"] {
        let part = format!("{shard}/2");
        let arguments = [
            "--cases",
            "2",
            "--seed",
            QUICK.as_str(),
            "--shard",
            &part,
            "--out",
            shard,
            "--quiet",
            "--history",
            "sets.jsonl",
        ];
        blind_to(0, folder.path(), &arguments);
    }
    blind_to(0, folder.path(), &["--merge", "1", "2", "--out", "all", "--quiet"]);
    folder
}

/// The canonical text, implemented anew from the documentation.
fn canonical(value: &Value) -> String {
    match value {
        Value::Object(fields) => {
            let mut keys: Vec<&String> = fields.keys().collect();
            keys.sort();
            let pair = |key: &&String| format!("{}:{}", json!(key), canonical(&fields[key.as_str()]));
            format!("{{{}}}", keys.iter().map(pair).collect::<Vec<_>>().join(","))
        }
        Value::Array(elements) => {
            format!("[{}]", elements.iter().map(canonical).collect::<Vec<_>>().join(","))
        }
        Value::Number(number) if number.is_f64() => {
            format!("f{:016x}", number.as_f64().expect("a number").to_bits())
        }
        other => other.to_string(),
    }
}

/// SHA-256 of a purpose, a newline and the canonical text.
fn hash(purpose: &str, value: &Value) -> String {
    let digest = Sha256::digest(format!("{purpose}\n{}", canonical(value)));
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The hash of a whole receipt.
fn hash_of(receipt: &Value) -> String {
    let fields = receipt.as_object().expect("a table").iter().filter(|(key, _)| *key != "sha256");
    hash("receipt", &Value::Object(fields.map(|(key, value)| (key.clone(), value.clone())).collect()))
}

/// Recomputes every hash of `part` from the content of `receipt`: commitments, answers, stages.
fn hash_part_anew(part: &mut Value, cases: &Value) {
    let names: Vec<String> = part["sealed"].as_object().expect("a table").keys().cloned().collect();
    let of = |pick: &dyn Fn(&Value) -> Value| -> Value {
        names.iter().map(|name| (name.clone(), pick(&cases[name]))).collect::<Map<_, _>>().into()
    };
    for name in part["commitments"].as_object().expect("a table").keys().cloned().collect::<Vec<_>>() {
        part["commitments"][&name] =
            hash("truth", &json!([cases[&name]["salt"], cases[&name]["truth"]])).into();
    }
    part["answers"] = hash("answers", &of(&|case| case["answer"].clone())).into();
    let brought = BTreeMap::from([
        ("freeze", json!([part["program"], part["machine"]])),
        ("seed", part["draw"].clone()),
        ("seal", json!([part["sealed"], part["commitments"], part["not_made"], part["seconds"][0]])),
        ("answer", json!([part["answers"], part["isolation"], part["seconds"][1]])),
        ("reveal", of(&|case| json!([case["salt"], case["truth"]]))),
    ]);
    let mut before = String::new();
    for stage in part["stages"].as_array_mut().expect("stages") {
        let name = stage["name"].as_str().expect("a name").to_owned();
        stage["brought"] = hash(&name, &brought[name.as_str()]).into();
        before = hash("chain", &json!([before, name, stage["at"], stage["brought"]]));
        stage["chain"] = before.clone().into();
    }
}

/// Recomputes every hash of `receipt`.
fn hash_anew(receipt: &mut Value) {
    let cases = receipt["cases"].clone();
    let mut parts = receipt["parts"].take();
    parts.as_array_mut().expect("parts").iter_mut().for_each(|part| hash_part_anew(part, &cases));
    receipt["parts"] = parts;
    receipt["sha256"] = hash_of(receipt).into();
}

/// A receipt with one change.
struct Variation {
    /// The change and its place.
    what: String,
    text: String,
}

/// Every JSON pointer in `value`, its own included.
fn pointers(value: &Value, at: &str, all: &mut Vec<String>) {
    all.push(at.to_owned());
    match value {
        Value::Object(fields) => {
            for (key, below) in fields {
                pointers(below, &format!("{at}/{}", key.replace('~', "~0").replace('/', "~1")), all);
            }
        }
        Value::Array(elements) => {
            elements.iter().enumerate().for_each(|(k, below)| pointers(below, &format!("{at}/{k}"), all));
        }
        _ => (),
    }
}

/// Replacements for `value`: close values of its type, and values of other types.
fn others(value: &Value) -> Vec<Value> {
    match value {
        Value::Null => vec![json!(0), json!({}), json!("")],
        Value::Bool(value) => vec![json!(!value), Value::Null],
        Value::Number(number) => match (number.as_u64(), number.as_f64()) {
            (Some(number), _) => vec![json!(number + 1), json!(number as f64), Value::Null],
            (None, Some(number)) => {
                vec![json!(f64::from_bits(number.to_bits() + 1)), json!(-number - 1.0), Value::Null]
            }
            (None, None) => Vec::new(),
        },
        Value::String(text) => {
            let mut last = text.clone();
            let end = last.pop().unwrap_or('x');
            last.push(if end == '0' { '1' } else { '0' });
            vec![json!(last), json!(format!("{text} ")), json!(""), Value::Null]
        }
        Value::Array(_) => vec![json!([]), json!({}), Value::Null],
        Value::Object(_) => vec![json!({}), json!([]), Value::Null],
    }
    .into_iter()
    .filter(|other| canonical(other) != canonical(value))
    .collect()
}

/// The text of `value` with the field at `twice` repeated with the same value.
fn written(value: &Value, at: &str, twice: &str) -> String {
    match value {
        Value::Object(fields) => {
            let mut pairs = Vec::new();
            for (key, below) in fields {
                let place = format!("{at}/{}", key.replace('~', "~0").replace('/', "~1"));
                let pair = format!("{}:{}", json!(key), written(below, &place, twice));
                pairs.extend(std::iter::repeat_n(pair, if place == twice { 2 } else { 1 }));
            }
            format!("{{{}}}", pairs.join(","))
        }
        Value::Array(elements) => {
            let below = elements.iter().enumerate().map(|(k, e)| written(e, &format!("{at}/{k}"), twice));
            format!("[{}]", below.collect::<Vec<_>>().join(","))
        }
        other => other.to_string(),
    }
}

/// Every variation of `receipt`. With `anew` the hash of the whole is recomputed, as by a cheat who knows of that hash alone.
fn variations(receipt: &Value, anew: bool) -> Vec<Variation> {
    let mut all = Vec::new();
    let unchanged = canonical(receipt);
    let mut places = Vec::new();
    pointers(receipt, "", &mut places);
    for place in &places {
        let here = receipt.pointer(place).expect("a value");
        let mut add = |what: &str, change: &dyn Fn(&mut Value)| {
            let mut changed = receipt.clone();
            change(&mut changed);
            if anew && changed.get("sha256").is_some() {
                changed["sha256"] = hash_of(&changed).into();
            }
            if canonical(&changed) != unchanged {
                all.push(Variation { what: format!("{what} {place}"), text: changed.to_string() });
            }
        };
        let into = |changed: &mut Value, value: Value| *changed.pointer_mut(place).expect("a value") = value;
        if !place.is_empty() {
            for other in others(here) {
                add(&format!("change to {other}"), &|changed| into(changed, other.clone()));
            }
            add("remove", &|changed| remove(changed, place));
        }
        if let Value::Object(_) = here {
            add("unknown field in", &|changed| {
                changed.pointer_mut(place).expect("a value")["unknown"] = json!(1)
            });
        }
        if let Value::Array(elements) = here {
            for k in 0..elements.len() {
                add(&format!("element {k} twice in"), &|changed| {
                    let list = changed.pointer_mut(place).and_then(Value::as_array_mut).expect("a list");
                    list.insert(k, list[k].clone());
                });
            }
            for k in 1..elements.len() {
                add(&format!("elements {} and {k} swapped in", k - 1), &|changed| {
                    changed.pointer_mut(place).and_then(Value::as_array_mut).expect("a list").swap(k - 1, k);
                });
            }
            add("element added to", &|changed| {
                changed.pointer_mut(place).and_then(Value::as_array_mut).expect("a list").push(json!("x"));
            });
        }
        let parent = place.rfind('/').map(|end| receipt.pointer(&place[..end]).expect("a value"));
        if !anew && parent.is_some_and(Value::is_object) {
            all.push(Variation { what: format!("twice {place}"), text: written(receipt, "", place) });
        }
    }
    all
}

fn remove(value: &mut Value, place: &str) {
    let (parent, key) = place.rsplit_once('/').expect("a place");
    match value.pointer_mut(parent).expect("a value") {
        Value::Object(fields) => drop(fields.shift_remove(&key.replace("~1", "/").replace("~0", "~"))),
        Value::Array(elements) => drop(elements.remove(key.parse().expect("a number"))),
        _ => unreachable!("only tables and lists hold values"),
    }
}

/// The text of `value` with all keys in the reverse order.
fn reversed(value: &Value) -> Value {
    match value {
        Value::Object(fields) => fields
            .iter()
            .rev()
            .map(|(key, below)| (key.clone(), reversed(below)))
            .collect::<Map<_, _>>()
            .into(),
        Value::Array(elements) => elements.iter().map(reversed).collect(),
        other => other.clone(),
    }
}

/// Verifies all `variations` in batches; returns those that verification accepted.
fn uncaught(variations: &[Variation], folder: &Path) -> Vec<String> {
    let mut missed = Vec::new();
    for batch in variations.chunks(BATCH) {
        let paths: Vec<PathBuf> = (0..batch.len()).map(|k| folder.join(format!("{k}.json"))).collect();
        for (path, variation) in paths.iter().zip(batch) {
            std::fs::write(path, &variation.text).expect("a receipt");
        }
        let mut arguments = vec!["--format", "json", "--verify"];
        arguments.extend(paths.iter().map(|path| path.to_str().expect("a path")));
        let text = blind_to(1, folder, &arguments);
        let verdicts: Value = serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}"));
        let verdicts = verdicts.as_array().cloned().unwrap_or_else(|| vec![verdicts]);
        assert_eq!(verdicts.len(), batch.len());
        for (verdict, variation) in verdicts.iter().zip(batch) {
            let names = |check: &Value| {
                check["good"] == false && check["found"].as_str().is_some_and(|f| f.len() > 4)
            };
            if verdict["good"] != false
                || !verdict["checks"].as_array().is_some_and(|all| all.iter().any(names))
            {
                missed.push(variation.what.clone());
            }
        }
    }
    missed
}

#[test]
fn every_field_is_bound() {
    let folder = two_shards();
    let alone = read(&folder.path().join("1/receipt.json"));
    let first = alone["cases"].as_object().and_then(|cases| cases.keys().next()).expect("a case");
    let first = format!("/cases/{first}/");
    let mut counts = Vec::new();
    for which in ["1", "all"] {
        let receipt = read(&folder.path().join(which).join("receipt.json"));
        // The order of keys and the spaces between them do not matter.
        let same = format!("{:#}", reversed(&receipt));
        std::fs::write(folder.path().join("same.json"), same).expect("a receipt");
        blind_to(0, folder.path(), &["--verify", "same.json"]);
        for anew in [false, true] {
            let mut all = variations(&receipt, anew);
            // The hash of the whole detects any change of a field under it, so that one change per field suffices. Both receipts contain the first case.
            let whole = |what: &str| what.starts_with("twice") || which == "1" && what.starts_with("remove");
            let part = |what: &str| which == "1" || !what.contains(&first);
            all.retain(|Variation { what, .. }| if anew { part(what) } else { whole(what) });
            assert!(all.len() > 500, "{} variations are too few", all.len());
            let missed = uncaught(&all, folder.path());
            let how = if anew { "its hash computed anew" } else { "as it stands" };
            counts.push(format!("{which}, {how}: {} variations, {} not caught", all.len(), missed.len()));
            assert!(missed.is_empty(), "{which}, {how}: {missed:#?}");
        }
    }
    println!("{counts:#?}");
}

/// The same for a folder that someone else sealed, with commitments of the earlier construction, before and after its truth is revealed.
#[test]
fn every_field_is_bound_of_a_folder_of_someone_else() {
    let folder = two_shards();
    let path = |name: &str| folder.path().join(name);
    let receipt = read(&path("1/receipt.json"));
    std::fs::rename(path("1/sealed"), path("third")).expect("a folder");
    let (name, case) = receipt["cases"].as_object().and_then(|cases| cases.iter().next()).expect("a case");
    let (salt, truth) = ("00ff", case["truth"].to_string());
    let mut digest = Sha256::new();
    for text in [salt, truth.as_str()] {
        digest.update((text.len() as u64).to_le_bytes());
        digest.update(text);
    }
    let commitment: String = digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    let mut told = case["truth"].clone();
    told["salt"] = json!(salt);
    std::fs::write(path("third/commitments.json"), json!({ name: commitment }).to_string()).expect("a file");
    std::fs::write(path("truth.json"), json!({ "cases": { name: told } }).to_string()).expect("a file");
    let mut other = told.clone();
    other["effects"] = json!([]);
    std::fs::write(path("other.json"), json!({ "cases": { name: other } }).to_string()).expect("a file");
    let twice = format!("{{ \"cases\": {{}}, \"cases\": {} }}", json!({ name: told }));
    std::fs::write(path("twice.json"), twice).expect("a file");
    blind_to(0, folder.path(), &["--analyse", "third", "--quiet"]);
    let refused = |truth: &str, why: &str| {
        let said = blind_to(3, folder.path(), &["--score", "third", truth]);
        assert!(said.contains(why), "{said}");
    };
    refused("other.json", "is not the one committed to");
    refused("twice.json", "occurs twice");
    let before = read(&path("third/receipt.json"));
    blind_to(0, folder.path(), &["--verify", "third/receipt.json"]);
    blind_to(0, folder.path(), &["--score", "third", "truth.json", "--quiet"]);
    blind_to(0, folder.path(), &["--verify", "third/receipt.json"]);
    for (which, receipt) in [("before", before.clone()), ("after", read(&path("third/receipt.json")))] {
        let all = variations(&receipt, true);
        let missed = uncaught(&all, folder.path());
        println!("{which} the truth is told: {} variations, {} not caught", all.len(), missed.len());
        assert!(missed.is_empty(), "{which}: {missed:#?}");
    }
    // A changed answer is not scored.
    let mut changed = before;
    changed["cases"][name]["answer"]["verdict"] = json!("unknown");
    changed["sha256"] = hash_of(&changed).into();
    std::fs::write(path("third/receipt.json"), changed.to_string()).expect("a receipt");
    refused("truth.json", "the committed answers have");
}

/// An implementation of the hashes from their description alone reproduces every hash of real receipts; so does the Python of the docs.
#[test]
fn a_third_person_computes_the_same_hashes() {
    let folder = two_shards();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/blind/verify.py");
    for which in ["1", "2", "all"] {
        let path = folder.path().join(which).join("receipt.json");
        let receipt = read(&path);
        let mut again = receipt.clone();
        hash_anew(&mut again);
        assert_eq!(again, receipt);
        let python = Command::new("python3").arg(&script).arg(&path).output().expect("python3");
        assert!(python.status.success(), "{}", String::from_utf8_lossy(&python.stderr));
        again["parts"][0]["machine"] = json!("another");
        again["sha256"] = hash_of(&again).into();
        std::fs::write(folder.path().join("other.json"), again.to_string()).expect("a receipt");
        let python = Command::new("python3").arg(&script).arg("other.json").current_dir(&folder).output();
        assert!(!python.expect("python3").status.success(), "the script finds what was changed");
    }
}

/// Attempts to cheat for a better score. Each adapts the hash of the whole; the last recomputes all hashes.
#[test]
fn cheats_are_caught() {
    let folder = two_shards();
    let receipt = read(&folder.path().join("all/receipt.json"));
    let names: Vec<String> = receipt["cases"].as_object().expect("cases").keys().cloned().collect();
    let (one, two) = (names[0].as_str(), names[1].as_str());
    let caught = |what: &str, by: &str, all_hashes: bool, cheat: &dyn Fn(&mut Value)| {
        let mut changed = receipt.clone();
        cheat(&mut changed);
        if all_hashes {
            hash_anew(&mut changed);
        }
        changed["sha256"] = hash_of(&changed).into();
        std::fs::write(folder.path().join("cheat.json"), changed.to_string()).expect("a receipt");
        let text = blind_to(1, folder.path(), &["--verify", "cheat.json", "--history", "sets.jsonl"]);
        let found = text.lines().find(|line| line.contains("FAIL") && line.contains(by));
        println!("{what}: {}", found.unwrap_or_else(|| panic!("{what} is not caught by {by}:\n{text}")));
    };
    let part_of =
        |receipt: &Value, name: &str| usize::from(receipt["parts"][0]["sealed"].get(name).is_none());
    caught("no parts", "nothing binds the cases", false, &|r| r["parts"] = json!([]));
    caught("a case dropped", "was sealed and is missing", false, &|r| {
        drop(r["cases"].as_object_mut().map(|c| c.shift_remove(one)))
    });
    caught("a case dropped from the seal, too", "were drawn", true, &|r| {
        let part = part_of(r, one);
        drop(r["cases"].as_object_mut().map(|c| c.shift_remove(one)));
        r["parts"][part]["sealed"] = json!({});
        r["parts"][part]["commitments"] = json!({});
    });
    caught("a case added", "was not sealed", false, &|r| r["cases"]["00"] = r["cases"][one].clone());
    caught("a case added to the seal, too", "were drawn", true, &|r| {
        r["cases"]["00"] = r["cases"][one].clone();
        let part = part_of(r, one);
        for of in ["sealed", "commitments"] {
            r["parts"][part][of]["00"] = r["parts"][part][of][one].clone();
        }
    });
    caught("a case by another name", "no name of this draw", true, &|r| {
        let part = part_of(r, one);
        for of in ["sealed", "commitments"] {
            let value = r["parts"][part][of].as_object_mut().and_then(|table| table.shift_remove(one));
            r["parts"][part][of]["00"] = value.expect("a case");
        }
        let case = r["cases"].as_object_mut().and_then(|table| table.shift_remove(one));
        r["cases"]["00"] = case.expect("a case");
    });
    caught("answers swapped", "the committed answers have", false, &|r| {
        let (a, b) = (r["cases"][one]["answer"].clone(), r["cases"][two]["answer"].clone());
        (r["cases"][one]["answer"], r["cases"][two]["answer"]) = (b, a);
    });
    caught("an answer made right, its score kept", "the committed answers have", false, &|r| {
        r["cases"][one]["answer"]["verdict"] = json!("unknown");
    });
    caught("another truth, all hashes anew", "history", true, &|r| {
        r["cases"][one]["truth"]["seed"] = json!(1);
    });
    caught("another answer, all hashes anew", "score", true, &|r| {
        r["cases"][one]["answer"]["verdict"] = json!("unknown");
        r["cases"][one]["answer"]["effects"] = json!([]);
    });
    caught("another program, all hashes anew", "frozen was the program", true, &|r| {
        r["parts"][0]["program"]["sha256"] = json!("00");
    });
    caught("another machine", "content of stage freeze", false, &|r| {
        r["parts"][0]["machine"] = json!("faster")
    });
    caught("shorter time", "content of stage answer", false, &|r| r["parts"][1]["seconds"][1] = json!(0.5));
    caught("isolation made better", "isolation", true, &|r| r["parts"][0]["isolation"] = json!({ "all": 1 }));
    caught("one shard twice", "same cases", true, &|r| r["parts"][1] = r["parts"][0].clone());
    let text = std::fs::read_to_string(folder.path().join("all/receipt.json")).expect("a receipt");
    std::fs::write(folder.path().join("cheat.json"), &text[..text.len() / 2]).expect("a receipt");
    blind_to(3, folder.path(), &["--verify", "cheat.json"]);
}

/// No shard counts twice, neither the same receipt nor the same draw made again. Receipts that do not verify are not merged; receipts that the earlier schema
/// left open do not verify.
#[test]
fn receipts_are_merged_once() {
    let folder = two_shards();
    let seed = read(&folder.path().join("1/receipt.json"))["parts"][0]["draw"]["seed"].to_string();
    let twice = blind_to(3, folder.path(), &["--merge", "1", "1", "--out", "twice"]);
    assert!(twice.contains("hold the same cases"), "{twice}");
    let overlapping = blind_to(3, folder.path(), &["--merge", "all", "2", "--out", "twice"]);
    assert!(overlapping.contains("hold the same cases"), "{overlapping}");
    let whole = ["--cases", "2", "--seed", &seed, "--out", "whole", "--quiet"];
    blind_to(0, folder.path(), &whole);
    let [again, first] = ["whole", "1"].map(|which| read(&folder.path().join(which).join("receipt.json")));
    let names =
        |receipt: &Value| receipt["cases"].as_object().expect("cases").keys().cloned().collect::<Vec<_>>();
    assert!(
        names(&first).iter().all(|name| !names(&again).contains(name)),
        "names do not follow from the seed"
    );
    let redrawn = blind_to(3, folder.path(), &["--merge", "1", "whole", "--out", "twice"]);
    assert!(redrawn.contains("hold the same cases"), "{redrawn}");
    let mut earlier = first;
    earlier["schema"] = json!("freeplay.receipt/1");
    std::fs::create_dir(folder.path().join("earlier")).expect("a folder");
    std::fs::write(folder.path().join("earlier/receipt.json"), earlier.to_string()).expect("a receipt");
    for arguments in [&["--verify", "earlier/receipt.json"][..], &["--merge", "1", "earlier", "--out", "x"]] {
        let told = blind_to(3, folder.path(), arguments);
        let program = earlier["parts"][0]["program"]["sha256"].as_str().expect("a hash");
        assert!(told.contains("the program that made it") && told.contains(program), "{told}");
    }
    earlier["schema"] = json!("freeplay.receipt/2");
    earlier["parts"] = json!([]);
    std::fs::write(folder.path().join("earlier/receipt.json"), earlier.to_string()).expect("a receipt");
    blind_to(3, folder.path(), &["--merge", "1", "earlier", "--out", "x"]);
    assert!(
        !folder.path().join("x").exists() && !folder.path().join("twice").exists(),
        "nothing was written"
    );
}

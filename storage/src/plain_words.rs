//! Rewrites messages of parsers in the terms of the person who wrote the file or argument.
//!
//! Parsers name types of the program: `invalid type: string "fast", expected f64`. A person who writes a scenario knows numbers, text, lists and
//! tables. The module rewrites messages of `serde` and of the standard library's `parse`; all other messages stay unchanged.

/// Rewrites the message `said` of a parser in plain words. If it contains an excerpt of the line, only the sentence changes.
#[must_use]
pub fn plain_words(said: &str) -> String {
    let said = without_error_number(said.trim_end());
    let (picture, sentence) = said.rsplit_once('\n').unwrap_or(("", &said));
    let separator = if picture.is_empty() { "" } else { "\n" };
    // The JSON parser puts the position after its sentence, the TOML parser before it.
    let (place, sentence, group) = match placed(sentence) {
        Some((sentence, place)) => (format!("{place}: "), sentence, "an object"),
        None => (String::new(), sentence, "a table"),
    };
    format!("{picture}{separator}{place}{}", in_words(sentence, group))
}

/// `said` without the error number that the standard library appends to a message of the operating system.
#[must_use]
pub fn without_error_number(said: &str) -> String {
    let mut text = said.to_owned();
    while let Some(start) = text.find(" (os error ") {
        let Some(end) = text[start..].find(')') else { break };
        text.replace_range(start..=start + end, "");
    }
    text
}

/// Splits a sentence from the position after it, as in `… at line 3 column 1`.
fn placed(sentence: &str) -> Option<(&str, String)> {
    let (sentence, place) = sentence.rsplit_once(" at line ")?;
    let (line, column) = place.split_once(" column ")?;
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    (is_number(line) && is_number(column)).then(|| (sentence, format!("line {line}, column {column}")))
}

/// Rewrites a sentence; `group` is the file format's term for keys with values.
fn in_words(sentence: &str, group: &str) -> String {
    let after = |start: &str| sentence.strip_prefix(start);
    if let Some((found, wanted)) = after("invalid type: ")
        .or_else(|| after("invalid value: "))
        .and_then(|rest| rest.rsplit_once(", expected "))
    {
        return format!("found {}, expected {}", found_words(found, group), wanted_words(wanted, group));
    }
    if let Some((length, wanted)) = after("invalid length ").and_then(|rest| rest.split_once(", expected ")) {
        return format!("found {length} values, expected {}", wanted_words(wanted, group));
    }
    if let Some(rest) = after("unknown variant ") {
        return format!("unknown value {rest}");
    }
    if let Some(rest) = after("duplicate field ") {
        return format!("the field {rest} stands twice");
    }
    if let Some(rest) = after("EOF while parsing ") {
        return format!("the file ends inside {}", inside(rest, group));
    }
    if let Some((value, bounds)) = sentence.split_once(" is not in ")
        && let Some((least, most)) = bounds.split_once("..")
    {
        return outside(value, least, most);
    }
    if sentence.starts_with("data did not match any variant of ") {
        return "a value has another form than is expected here".to_owned();
    }
    match sentence {
        "expected value" => "expected a value",
        "expected ident" => "expected true, false or null",
        "trailing characters" => "there is more text behind the end",
        "recursion limit exceeded" => "values are nested too deeply",
        "invalid digit found in string" => "expected a whole number",
        "cannot parse integer from empty string" => "it is empty, expected a whole number",
        "number too large to fit in target type" => "the number is too large",
        "number too small to fit in target type" => "the number is too small",
        "invalid float literal" => "expected a number such as 0.25 or 1e-3",
        "cannot parse float from empty string" => "it is empty, expected a number",
        "provided string was not `true` or `false`" => "expected true or false",
        other => return other.replace("literal string", "text in quotes"),
    }
    .to_owned()
}

/// Text for a number out of range; the upper limit may be the largest number of its type.
fn outside(value: &str, least: &str, most: &str) -> String {
    let most = most.trim_start_matches('=');
    if most == u64::MAX.to_string() || most == i64::MAX.to_string() {
        return format!("{value} is below {least}, expected {least} or more");
    }
    format!("{value} is out of range, expected a whole number between {least} and {most}")
}

/// Text for the value found in the file.
fn found_words(found: &str, group: &str) -> String {
    for kind in ["integer ", "floating point ", "boolean ", "character "] {
        if let Some(value) = found.strip_prefix(kind) {
            return value.to_owned();
        }
    }
    if let Some(value) = found.strip_prefix("string ") {
        return format!("text {value}");
    }
    match found {
        "null" | "unit value" | "Option value" => "nothing",
        "sequence" => "a list",
        "map" => group,
        "byte array" => "bytes",
        other => return if other.ends_with(" variant") { "a name".to_owned() } else { other.to_owned() },
    }
    .to_owned()
}

/// Text for the expected value.
fn wanted_words(wanted: &str, group: &str) -> String {
    let counted = ["an array of length ", "a tuple of size "];
    if let Some(count) = counted.into_iter().find_map(|start| wanted.strip_prefix(start)) {
        return format!("a list of {count} values");
    }
    match wanted {
        "f32" | "f64" => "a number",
        "u8" => "a whole number from 0 to 255",
        "u16" => "a whole number from 0 to 65535",
        "u32" => "a whole number from 0 to 4294967295",
        "u64" | "u128" | "usize" => "a whole number of 0 or more",
        "i8" | "i16" | "i32" | "i64" | "i128" | "isize" => "a whole number",
        "a boolean" => "true or false",
        "a string" | "a borrowed string" | "string" | "str" => "text in quotes",
        "a character" => "a single character in quotes",
        "path string" => "a path in quotes",
        "a sequence" => "a list",
        "a map" | "map" => group,
        "fewer elements in array" => "fewer",
        "fewer elements in map" => "fewer keys",
        "string or map" | "string or table" => "a name in quotes",
        "variant identifier" | "field identifier" => "a name",
        other => {
            let is_group = ["struct ", "tuple struct ", "internally tagged enum ", "adjacently tagged enum "]
                .into_iter()
                .any(|start| other.starts_with(start));
            let is_name = other.starts_with("enum ");
            return if is_group {
                group.to_owned()
            } else if is_name {
                "a name".to_owned()
            } else {
                other.to_owned()
            };
        }
    }
    .to_owned()
}

/// Text for the element in which a JSON file ended.
fn inside(what: &str, group: &str) -> String {
    match what {
        "a string" => "text in quotes".to_owned(),
        "an object" => group.to_owned(),
        other => other.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::plain_words;

    #[test]
    fn sentences_of_parsers_are_said_in_words_of_the_file() {
        for (said, words) in [
            ("invalid type: string \"fast\", expected f64", "found text \"fast\", expected a number"),
            ("invalid value: integer `-1`, expected u64", "found `-1`, expected a whole number of 0 or more"),
            (
                "invalid type: sequence, expected struct PathSpec at line 2 column 9",
                "line 2, column 9: found a list, expected an object",
            ),
            (
                "invalid type: floating point `0.5`, expected u32",
                "found `0.5`, expected a whole number from 0 to 4294967295",
            ),
            (
                "invalid length 2, expected an array of length 3",
                "found 2 values, expected a list of 3 values",
            ),
            (
                "unknown variant `slow`, expected `realtime` or `lockstep`",
                "unknown value `slow`, expected `realtime` or `lockstep`",
            ),
            ("unknown field `a`, expected `b`", "unknown field `a`, expected `b`"),
            (
                "EOF while parsing an object at line 1 column 8",
                "line 1, column 8: the file ends inside an object",
            ),
            ("invalid digit found in string", "expected a whole number"),
            ("0 is not in 1..=1000", "0 is out of range, expected a whole number between 1 and 1000"),
            ("0 is not in 1..18446744073709551615", "0 is below 1, expected 1 or more"),
            // Text of the person stays unchanged, whatever it contains.
            (
                "invalid type: string \", expected f64\", expected u8",
                "found text \", expected f64\", expected a whole number from 0 to 255",
            ),
            (
                "cannot read a.toml: No such file or directory (os error 2); check",
                "cannot read a.toml: No such file or directory; check",
            ),
        ] {
            assert_eq!(plain_words(said), words);
        }
    }

    #[test]
    fn the_picture_of_the_line_stays() {
        let said = "TOML parse error at line 1, column 8\n  |\n1 | rate = \"fast\"\n  |        ^^^^^^\ninvalid type: string \"fast\", expected f64\n";
        let words = plain_words(said);
        assert!(words.starts_with("TOML parse error at line 1, column 8\n  |\n1 | rate"), "{words}");
        assert!(words.ends_with("^^^^^^\nfound text \"fast\", expected a number"), "{words}");
    }
}

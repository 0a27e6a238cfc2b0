//! Canonical text of a JSON value, so that a hash does not depend on spaces, the order of keys or the notation of numbers.
//!
//! Objects have their keys sorted by code point; there are no spaces between tokens; strings escape only `"`, `\` and control characters; an integer is its
//! decimal digits; any other number is `f` and the 16 hexadecimal digits of its IEEE 754 double, the sign first.

use std::collections::BTreeMap;

use serde_json::Value;

/// The canonical text of `value`.
pub fn canonical(value: &Value) -> String {
    let mut text = String::new();
    write(value, &mut text);
    text
}

fn write(value: &Value, text: &mut String) {
    match value {
        Value::Object(fields) => {
            let sorted: BTreeMap<&String, &Value> = fields.iter().collect();
            let mut before = '{';
            for (key, value) in sorted {
                text.push(before);
                text.push_str(&Value::from(key.as_str()).to_string());
                text.push(':');
                write(value, text);
                before = ',';
            }
            text.push_str(if before == '{' { "{}" } else { "}" });
        }
        Value::Array(elements) => {
            text.push('[');
            for (index, element) in elements.iter().enumerate() {
                if index > 0 {
                    text.push(',');
                }
                write(element, text);
            }
            text.push(']');
        }
        Value::Number(number) if number.is_f64() => {
            let bits = number.as_f64().unwrap_or_default().to_bits();
            text.push_str(&format!("f{bits:016x}"));
        }
        Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => {
            text.push_str(&value.to_string());
        }
    }
}

/// The first difference between `this` and `other`, as a JSON pointer; `None` if their canonical texts are equal.
pub fn difference(this: &Value, other: &Value) -> Option<String> {
    match (this, other) {
        (Value::Object(a), Value::Object(b)) => {
            let missing = b.keys().find(|key| !a.contains_key(*key));
            a.iter()
                .find_map(|(key, value)| match b.get(key) {
                    Some(other) => difference(value, other).map(|below| format!("/{}{below}", escaped(key))),
                    None => Some(format!("/{}", escaped(key))),
                })
                .or_else(|| missing.map(|key| format!("/{}", escaped(key))))
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            let mut pairs = a.iter().zip(b).enumerate();
            pairs.find_map(|(index, (a, b))| difference(a, b).map(|below| format!("/{index}{below}")))
        }
        _ => (canonical(this) != canonical(other)).then(String::new),
    }
}

/// A key in the form of a JSON pointer (RFC 6901).
fn escaped(key: &str) -> String {
    key.replace('~', "~0").replace('/', "~1")
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::{canonical, difference};

    fn of(text: &str) -> String {
        canonical(&serde_json::from_str::<Value>(text).expect("JSON"))
    }

    /// Order of keys, spaces and the notation of a number do not matter; the type of a number and the order of elements do.
    #[test]
    fn one_value_has_one_text() {
        assert_eq!(
            of(r#"{ "b": [1, 2.5], "a": "é\u0001\"" }"#),
            "{\"a\":\"é\\u0001\\\"\",\"b\":[1,f4004000000000000]}"
        );
        assert_eq!(of(r#"{"a":1e2,"b":{}}"#), of(r#"{"b":{},"a":100.0}"#));
        assert_ne!(of("1"), of("1.0"));
        assert_ne!(of("0.0"), of("-0.0"));
        assert_ne!(of("[1,2]"), of("[2,1]"));
        assert_ne!(of(r#"["a,b"]"#), of(r#"["a","b"]"#));
        assert_eq!(of("18446744073709551615"), "18446744073709551615");
    }

    #[test]
    fn a_difference_has_a_place() {
        let this = json!({ "a": [1, { "b/c": 2.0 }] });
        assert_eq!(difference(&this, &this), None);
        assert_eq!(difference(&this, &json!({ "a": [1, { "b/c": 2 }] })).as_deref(), Some("/a/1/b~1c"));
        assert_eq!(difference(&this, &json!({ "a": [1, { "b/c": 2.0 }], "d": 0 })).as_deref(), Some("/d"));
        assert_eq!(difference(&this, &json!({ "a": [1] })).as_deref(), Some("/a"));
    }
}

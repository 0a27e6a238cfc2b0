//! JSON without repeated keys. With a reader that takes the last of two, one file could have two meanings.

use std::fmt;
use std::path::Path;

use serde::de::{
    Deserialize, DeserializeOwned, DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor,
};
use serde_json::{Map, Number, Value};

use freeplay_storage::plain_words;
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::read_text;

/// Parses `text`.
///
/// # Errors
/// A syntax error, or a repeated key, with line and column; the latter has the category [`serde_json::error::Category::Data`].
pub fn parse(text: &str) -> Result<Value, serde_json::Error> {
    serde_json::from_str::<Strict>(text).map(|strict| strict.0)
}

/// The JSON in a file that should be `what`, as [`freeplay_terminal::files::read_json`], without repeated keys.
///
/// # Errors
/// A file that can't be read; the fault with line and column, and the expected file.
pub fn read<T: DeserializeOwned>(path: &Path, what: &str) -> Result<T, Failure> {
    let wrong = |why: String| Failure::input(format!("{}: {why}; give {what}", path.display()));
    let text = read_text(path)?;
    if text.trim().is_empty() {
        return Err(wrong("the file is empty".to_owned()));
    }
    let value = parse(&text).map_err(|error| wrong(plain_words(&error.to_string())))?;
    serde_json::from_value(value).map_err(|error| wrong(plain_words(&error.to_string())))
}

struct Strict(Value);

impl<'de> Deserialize<'de> for Strict {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Reader.deserialize(deserializer).map(Strict)
    }
}

struct Reader;

impl<'de> DeserializeSeed<'de> for Reader {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Reader {
    type Value = Value;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a JSON value")
    }

    fn visit_unit<E: Error>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<Value, E> {
        Ok(Value::Bool(value))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Value, E> {
        Ok(Value::from(value))
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Value, E> {
        Ok(Value::from(value))
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Value, E> {
        Number::from_f64(value).map(Value::Number).ok_or_else(|| E::custom("a number that is not finite"))
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Value, E> {
        Ok(Value::from(value))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut access: A) -> Result<Value, A::Error> {
        let mut elements = Vec::new();
        while let Some(element) = access.next_element_seed(Reader)? {
            elements.push(element);
        }
        Ok(Value::Array(elements))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut access: A) -> Result<Value, A::Error> {
        let mut fields = Map::new();
        while let Some(key) = access.next_key::<String>()? {
            if fields.contains_key(&key) {
                return Err(A::Error::custom(format!("the key {key:?} occurs twice")));
            }
            let value = access.next_value_seed(Reader)?;
            fields.insert(key, value);
        }
        Ok(Value::Object(fields))
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, error::Category};

    use super::parse;

    #[test]
    fn values_are_those_of_any_reader() {
        let text = r#"{ "a": [null, true, -3, 18446744073709551615, 2.5e-3, "x"], "b": { "a": {} } }"#;
        assert_eq!(parse(text).expect("JSON"), serde_json::from_str::<Value>(text).expect("JSON"));
    }

    #[test]
    fn a_key_that_stands_twice_is_refused_with_its_place() {
        let error = parse("{ \"a\": {\n \"b\": 1, \"b\": 1 } }").expect_err("refused");
        assert_eq!(error.classify(), Category::Data);
        assert!(error.to_string().contains("\"b\" occurs twice at line 2"), "{error}");
        assert_eq!(parse("{ \"a\": 1").expect_err("refused").classify(), Category::Eof);
    }
}

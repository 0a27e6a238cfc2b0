//! Names of the folders of cases. They follow from a key of the operating system, never from the seed.
//!
//! The analysts do not know the key, so that a name reveals neither index nor seed. The receipt contains it, so that `--verify` can check each name against the
//! draw.

use serde_json::json;

use super::hash;

/// Hexadecimal digits of a name.
const DIGITS: usize = 16;

/// The name of case `index` of a set whose names follow from `key`.
pub fn name(key: &str, index: usize) -> String {
    let mut name = hash::of_json("name", &json!([key, index]));
    name.truncate(DIGITS);
    name
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::name;

    /// Names are distinct and follow the key, and their order is not that of the cases.
    #[test]
    fn names_tell_nothing() {
        let names: Vec<String> = (0..2000).map(|index| name("00ff", index)).collect();
        assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), 2000);
        assert!(names.iter().all(|name| name.len() == 16));
        assert!((0..2000).all(|index| name("00fe", index) != names[index]));
        let rising = names.windows(2).filter(|pair| pair[0] < pair[1]).count();
        println!("{rising} of 1999 neighbours rise");
        // Half of them by chance; 5 standard deviations of the count of rises in a random order, √((n + 1) / 12), are 65.
        assert!(rising.abs_diff(1000) < 65);
    }
}

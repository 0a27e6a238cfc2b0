//! Names in sentences, and matching of joint names in two files.

/// Most names that a sentence lists.
const MOST: usize = 4;

/// `` `a`, `b` and 3 more ``.
pub(super) fn listed<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.into_iter().collect();
    let shown: Vec<String> = names.iter().take(MOST).map(|name| format!("`{name}`")).collect();
    let more = names.len().saturating_sub(MOST);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{}{more}", shown.join(", "))
}

/// `1 joint`, `2 joints`.
pub(super) fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// For each of `names` the matching joint of `joints`: the one with that name, else the only one whose name differs only by a prefix that
/// ends in `_` or `/`, since drivers add or omit such prefixes.
pub fn match_joints<'a>(
    names: &[String],
    joints: impl Iterator<Item = &'a str> + Clone,
) -> Vec<Option<usize>> {
    let but_for_a_prefix = |long: &str, short: &str| {
        long.strip_suffix(short).is_some_and(|prefix| !short.is_empty() && prefix.ends_with(['_', '/']))
    };
    let of = |name: &String| {
        let exact = joints.clone().position(|joint| joint == name);
        let mut alike = joints
            .clone()
            .enumerate()
            .filter(|(_, joint)| but_for_a_prefix(joint, name) || but_for_a_prefix(name, joint));
        exact.or_else(|| match (alike.next(), alike.next()) {
            (Some((index, _)), None) => Some(index),
            _ => None,
        })
    };
    names.iter().map(of).collect()
}

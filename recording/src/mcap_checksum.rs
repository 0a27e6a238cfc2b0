//! The checksum of a recording's metadata. MCAP has one for chunks, attachments and whole sections, but none for a metadata record.

use std::collections::BTreeMap;

/// The key of the checksum over all other keys and values.
const KEY: &str = "metadata_crc32";

/// The CRC-32 of keys and values in the order of the keys, each behind its length.
fn checksum(metadata: &BTreeMap<String, String>) -> String {
    let mut hash = crc32fast::Hasher::new();
    for text in metadata.iter().flat_map(|(key, value)| [key, value]) {
        hash.update(&(text.len() as u64).to_le_bytes());
        hash.update(text.as_bytes());
    }
    format!("{:08x}", hash.finalize())
}

/// The metadata with their checksum.
pub(crate) fn signed(mut metadata: BTreeMap<String, String>) -> BTreeMap<String, String> {
    metadata.remove(KEY);
    let checksum = checksum(&metadata);
    metadata.insert(KEY.to_owned(), checksum);
    metadata
}

/// The metadata without their checksum; `None` if it does not match. Files of other tools have no checksum and are accepted.
pub(crate) fn verified(mut metadata: BTreeMap<String, String>) -> Option<BTreeMap<String, String>> {
    if let Some(expected) = metadata.remove(KEY) {
        return (checksum(&metadata) == expected).then_some(metadata);
    }
    // The damage may be in the key of the checksum itself.
    for key in metadata.keys().cloned().collect::<Vec<_>>() {
        let mut others = metadata.clone();
        if others.remove(&key).is_some_and(|value| value == checksum(&others)) {
            return Some(others);
        }
    }
    Some(metadata)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::{KEY, signed, verified};

    #[test]
    fn a_change_is_noticed() {
        let metadata = BTreeMap::from([("a".to_owned(), "b".to_owned())]);
        let mut kept = signed(metadata.clone());
        assert_eq!(verified(kept.clone()), Some(metadata));
        kept.insert("a".to_owned(), "c".to_owned());
        assert_eq!(verified(kept.clone()), None);
        let mut renamed = signed(kept.clone());
        let value = renamed.remove(KEY).expect("signed");
        renamed.insert("metadata_crc33".to_owned(), value);
        assert_eq!(verified(renamed).map(|metadata| metadata.len()), Some(1), "the key of the checksum");
        kept.remove(KEY);
        assert!(verified(kept).is_some(), "a file of somebody else");
    }
}

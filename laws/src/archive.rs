//! The state variables of a simulation as a flat list of 64-bit words: an exact copy that can be restored to the last bit.
//!
//! A type saves and restores its variables by one function, so that both directions have the same order.

/// A list of words for saving or restoring state variables.
#[derive(Debug)]
pub struct Archive<'a>(Direction<'a>);

#[derive(Debug)]
enum Direction<'a> {
    Save(&'a mut Vec<u64>),
    /// The remaining words; `None` once the list was too short.
    Restore(Option<&'a [u64]>),
}

impl<'a> Archive<'a> {
    /// An archive that appends variables to `words`.
    pub fn save(words: &'a mut Vec<u64>) -> Archive<'a> {
        Archive(Direction::Save(words))
    }

    /// An archive that restores variables from `words`.
    pub fn restore(words: &'a [u64]) -> Archive<'a> {
        Archive(Direction::Restore(Some(words)))
    }

    /// True if all words of the list have been restored; always true for an archive that saves.
    pub fn is_complete(&self) -> bool {
        match &self.0 {
            Direction::Save(_) => true,
            Direction::Restore(left) => left.is_some_and(<[u64]>::is_empty),
        }
    }

    /// Saves `value`, or returns the word to restore; returns `value` if the list is too short.
    fn word(&mut self, value: u64) -> u64 {
        match &mut self.0 {
            Direction::Save(words) => {
                words.push(value);
                value
            }
            Direction::Restore(left) => match left.and_then(<[u64]>::split_first) {
                Some((word, rest)) => {
                    *left = Some(rest);
                    *word
                }
                None => {
                    *left = None;
                    value
                }
            },
        }
    }

    /// Saves or restores a real number.
    pub fn real(&mut self, value: &mut f64) {
        *value = f64::from_bits(self.word(value.to_bits()));
    }

    /// Saves or restores real numbers.
    pub fn reals<'v>(&mut self, values: impl IntoIterator<Item = &'v mut f64>) {
        values.into_iter().for_each(|value| self.real(value));
    }

    /// Saves or restores a count.
    pub fn count(&mut self, value: &mut u64) {
        *value = self.word(*value);
    }

    /// Saves or restores a flag.
    pub fn flag(&mut self, value: &mut bool) {
        *value = self.word(u64::from(*value)) != 0;
    }
}

#[cfg(test)]
mod tests {
    use super::Archive;

    fn transfer_state(archive: &mut Archive, real: &mut f64, count: &mut u64, flag: &mut bool) {
        archive.real(real);
        archive.count(count);
        archive.flag(flag);
    }

    #[test]
    fn variables_come_back_and_a_list_of_another_length_is_noticed() {
        let mut words = Vec::new();
        transfer_state(&mut Archive::save(&mut words), &mut -0.0, &mut 7, &mut true);
        let (mut real, mut count, mut flag) = (1.0, 0, false);
        let mut archive = Archive::restore(&words);
        transfer_state(&mut archive, &mut real, &mut count, &mut flag);
        assert!(archive.is_complete());
        assert_eq!((real.to_bits(), count, flag), ((-0.0_f64).to_bits(), 7, true));
        for other in [&words[..2], &[words.as_slice(), &[0]].concat()] {
            let mut archive = Archive::restore(other);
            transfer_state(&mut archive, &mut real, &mut count, &mut flag);
            assert!(!archive.is_complete());
        }
    }
}

//! The state of an instance, as a value and as bytes.
//!
//! A state contains the values of all parameters and inputs and the state variables of the machine, so that the time to restore it does not depend on
//! the simulated time. Its bytes begin with a mark of the format and a token of arm file and version, and end with a digest.

use sha2::{Digest, Sha256};

use crate::fault::Fault;
use crate::variables::Value;

/// First bytes of a serialised state; the number increases with the format.
const MARK: &[u8; 8] = b"fpstate2";

/// Number of words before the values.
const HEAD: usize = 6;

/// Length of a digest, bytes.
const DIGEST: usize = 32;

/// A state of an instance.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// The instantiation token of the FMU: a hash of its arm file and version.
    pub(crate) token: String,
    /// Numeric code of the mode.
    pub(crate) mode: u8,
    /// Time of the importer at the start, s.
    pub(crate) start: f64,
    /// Number of steps since then.
    pub(crate) steps: u64,
    /// True if servos were commanded since then.
    pub(crate) is_commanded: bool,
    /// Values of parameters and inputs, by value reference.
    pub(crate) values: Vec<Value>,
    /// State variables of the machine; `None` before it is built.
    pub(crate) machine: Option<Vec<u64>>,
}

impl State {
    /// The state as bytes, little-endian.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MARK.to_vec();
        bytes.extend_from_slice(&Sha256::digest(&self.token));
        let machine = self.machine.as_deref();
        let head: [u64; HEAD] = [
            u64::from(self.mode),
            self.start.to_bits(),
            self.steps,
            u64::from(self.is_commanded),
            self.values.len() as u64,
            u64::from(machine.is_some()),
        ];
        let values = self.values.iter().flat_map(|value| match value {
            Value::Real(number) => [0, number.to_bits()],
            Value::Whole(number) => [1, u64::from(number.cast_unsigned())],
            Value::Truth(truth) => [2, u64::from(*truth)],
        });
        let words = head.into_iter().chain(values).chain(machine.unwrap_or_default().iter().copied());
        words.for_each(|word| bytes.extend_from_slice(&word.to_le_bytes()));
        let digest = Sha256::digest(&bytes);
        bytes.extend_from_slice(&digest);
        bytes
    }

    /// The length of [`State::to_bytes`].
    pub fn size(&self) -> usize {
        let words = HEAD + 2 * self.values.len() + self.machine.as_ref().map_or(0, Vec::len);
        MARK.len() + DIGEST + 8 * words + DIGEST
    }

    /// Parses a state of the FMU with this `token` from the `bytes` of [`State::to_bytes`].
    ///
    /// # Errors
    /// [`Fault::NoState`] for other bytes, [`Fault::Foreign`] for those of another FMU or version, [`Fault::Damaged`].
    pub(crate) fn from_bytes(bytes: &[u8], token: &str) -> Result<State, Fault> {
        let rest = bytes.strip_prefix(MARK).ok_or(Fault::NoState)?;
        let (named, _) = rest.split_first_chunk::<DIGEST>().ok_or(Fault::Damaged)?;
        if *named != *Sha256::digest(token) {
            return Err(Fault::Foreign);
        }
        let (content, digest) = bytes.split_last_chunk::<DIGEST>().ok_or(Fault::Damaged)?;
        if *digest != *Sha256::digest(content) {
            return Err(Fault::Damaged);
        }
        State::of_content(content.get(MARK.len() + DIGEST..).unwrap_or_default(), token).ok_or(Fault::Damaged)
    }

    fn of_content(content: &[u8], token: &str) -> Option<State> {
        let (words, left) = content.as_chunks::<8>();
        let mut words = words.iter().map(|word| u64::from_le_bytes(*word));
        let mut next = || words.next();
        let (mode, start, steps) = (u8::try_from(next()?).ok()?, f64::from_bits(next()?), next()?);
        let is_commanded = next()? == 1;
        let (count, has_machine) = (next()?, next()? == 1);
        let value = |kind, word| match kind {
            0 => Some(Value::Real(f64::from_bits(word))),
            1 => u32::try_from(word).ok().map(|word| Value::Whole(word.cast_signed())),
            2 => Some(Value::Truth(word == 1)),
            _ => None,
        };
        let values = (0..count).map(|_| value(next()?, next()?)).collect::<Option<_>>()?;
        let machine: Vec<u64> = words.collect();
        let is_whole = left.is_empty() && (has_machine || machine.is_empty());
        let machine = has_machine.then_some(machine);
        is_whole.then(|| State { token: token.to_owned(), mode, start, steps, is_commanded, values, machine })
    }
}

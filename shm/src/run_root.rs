//! [`RunRoot`]: the folder of one run on tmpfs.

use crate::address::Address;
use crate::error::LinkError;

/// The folder of one run in shared memory, of mode 0700. Whoever starts a run holds it; dropping it removes everything
/// of the run.
#[derive(Debug)]
pub struct RunRoot {
    address: Address,
}

impl RunRoot {
    /// Removes what dead runs left behind, then makes the folder of a new run.
    ///
    /// # Errors
    /// [`LinkError::Folder`] if the system refuses, [`LinkError::NotPrivate`] if the folder of all runs is not ours alone.
    pub fn create() -> Result<Self, LinkError> {
        unimplemented!()
    }

    /// What other processes need to find the run.
    #[must_use]
    pub fn address(&self) -> &Address {
        &self.address
    }

    /// Removes what runs that no longer live left behind and returns their ids.
    pub fn sweep_dead() -> Vec<String> {
        unimplemented!()
    }
}

//! `freeplay blind --matrix`: the swept kinds and machines.

use clap::Args;
use freeplay_concealed::{CATALOGUE, Machine, Matrix};
use freeplay_terminal::exit::Failure;

/// Options that select the cases of a matrix.
#[derive(Args, Debug)]
pub struct Sweep {
    /// Test every kind of the catalogue at every joint where it can occur, at three severities, on arms with six (the paper's),
    /// three and seven joints. The matrix also has 200 negative controls.
    #[arg(long, conflicts_with = "full")]
    matrix: bool,
    /// Limit the matrix to this kind. Several are allowed.
    #[arg(long, value_name = "KIND", requires = "matrix", value_parser = CATALOGUE)]
    kind: Vec<String>,
    /// Limit the matrix to this machine, one of the seven of the generator. Several are allowed.
    #[arg(long, value_name = "NAME", requires = "matrix", value_parser = Machine::ALL.map(Machine::name))]
    machine: Vec<String>,
    /// Number of negative controls in addition to the matrix.
    #[arg(long, value_name = "N", requires = "matrix", default_value_t = Matrix::CONTROL_COUNT)]
    negative: usize,
}

impl Sweep {
    /// The matrix; `None` if the command line requests none.
    ///
    /// # Errors
    /// None of the kinds has a place on any of the machines.
    pub fn matrix(&self) -> Result<Option<Matrix>, Failure> {
        if !self.matrix {
            return Ok(None);
        }
        let mut matrix = Matrix { negative: self.negative, ..Matrix::whole() };
        if !self.kind.is_empty() {
            matrix.kinds.retain(|kind| self.kind.contains(kind));
        }
        if !self.machine.is_empty() {
            let asked = |machine: &Machine| self.machine.iter().any(|name| name == machine.name());
            matrix.machines = Machine::ALL.into_iter().filter(asked).collect();
        }
        if matrix.places().map_err(Failure::internal)?.is_empty() {
            let (kinds, machines) = (self.kind.join(", "), self.machine.join(", "));
            return Err(Failure::usage(format!(
                "{kinds} has no place on {machines}; give another --kind or --machine"
            )));
        }
        Ok(Some(matrix))
    }
}

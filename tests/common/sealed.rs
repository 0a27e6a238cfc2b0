//! Sealed cases on the machine with one axis, which are quick.

use std::path::Path;

use freeplay_concealed::{Case, Demand, Family, Machine, Made, Noise, Severity, generate, write_sealed};

/// Makes the case of `seed` with a strong effect of `kind`, or without an effect, and writes its sealed part into the folder `to`.
pub fn seal_slide(to: &Path, seed: u64, kind: Option<&str>) -> Made {
    let demand = |kind: &str| Demand { kind: kind.to_owned(), joint: None, severity: Severity::Strong };
    let case = Case {
        machine: Machine::Slide,
        effects: kind.into_iter().map(demand).collect(),
        family: Some(Family::Fourier),
        noise: Noise::Low,
        hollow: false,
        seed,
    };
    let made = generate(&case).expect("a case");
    write_sealed(to, &made).expect("files");
    made
}

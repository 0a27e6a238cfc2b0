//! Units of the catalogue in FMI's form: products of powers of base units.

/// Exponents of kg, m, s and rad.
type Exponents = [i32; 4];

/// Names of the base units in their order.
pub(crate) const BASES: [&str; 4] = ["kg", "m", "s", "rad"];

/// Units with a name of their own.
const NAMED: [(&str, Exponents); 10] = [
    ("kg", [1, 0, 0, 0]),
    ("m", [0, 1, 0, 0]),
    ("s", [0, 0, 1, 0]),
    ("rad", [0, 0, 0, 1]),
    ("N", [1, 1, -2, 0]),
    ("J", [1, 2, -2, 0]),
    ("Pa", [1, -1, -2, 0]),
    ("Hz", [0, 0, -1, 0]),
    ("1", [0; 4]),
    ("W", [1, 2, -3, 0]),
];

/// The exponents of `unit`, such as `N*m*s/rad`; `None` if it is not a product of whole powers of these units.
pub(crate) fn exponents(unit: &str) -> Option<Exponents> {
    let mut sum = [0; 4];
    for (place, part) in unit.split('/').enumerate() {
        let sign = if place == 0 { 1 } else { -1 };
        for factor in part.trim_matches(['(', ')']).split('*') {
            let (name, power) = factor.split_once('^').unwrap_or((factor, "1"));
            let power: i32 = power.parse().ok()?;
            let (_, exponents) = NAMED.iter().find(|(known, _)| *known == name)?;
            sum.iter_mut().zip(exponents).for_each(|(sum, exponent)| *sum += sign * power * exponent);
        }
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::exponents;

    #[test]
    fn a_unit_is_a_product_of_powers() {
        assert_eq!(exponents("N*m*s/rad"), Some([1, 2, -1, -1]));
        assert_eq!(exponents("kg*m^2"), Some([1, 2, 0, 0]));
        assert_eq!(exponents("rad/(N*m)"), Some([-1, -2, 2, 1]));
        assert_eq!(exponents("N/m^1.5"), None);
    }
}

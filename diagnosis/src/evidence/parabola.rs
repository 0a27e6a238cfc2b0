//! The log evidence over a nonlinear parameter, as a parabola through three values near its maximum.

/// A parabola with a maximum.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parabola {
    /// Place of the maximum, from the middle value.
    vertex: f64,
    /// Curvature: the log evidence falls from its maximum by half of this times the square of the distance.
    curvature: f64,
}

impl Parabola {
    /// The parabola through three values at equal distances `step`; `None` if it has no maximum or if a value is not finite.
    pub(crate) fn new([under, middle, over]: [f64; 3], step: f64) -> Option<Self> {
        let curvature = (2.0 * middle - under - over) / (step * step);
        let vertex = (over - under) / (2.0 * step * curvature);
        (curvature > 0.0 && vertex.is_finite()).then_some(Self { vertex, curvature })
    }

    /// Place of the maximum, from the middle value.
    pub(crate) fn vertex(&self) -> f64 {
        self.vertex
    }

    /// Rise from the middle value to the maximum.
    pub(crate) fn rise(&self) -> f64 {
        0.5 * self.curvature * self.vertex * self.vertex
    }

    /// Standard deviation of the parameter: the distance from the maximum at which the log evidence is lower by 1/2.
    pub(crate) fn deviation(&self) -> f64 {
        self.curvature.sqrt().recip()
    }
}

#[cfg(test)]
mod tests {
    use super::Parabola;

    #[test]
    fn three_values_of_a_parabola_give_its_maximum() {
        let value = |x: f64| 7.0 - 0.5 * ((x - 0.3) / 0.2).powi(2);
        let parabola = Parabola::new([-0.1, 0.0, 0.1].map(value), 0.1).expect("a maximum");
        println!("{parabola:?}");
        assert!((parabola.vertex() - 0.3).abs() < 1e-12);
        assert!((parabola.deviation() - 0.2).abs() < 1e-12);
        assert!((parabola.rise() - (7.0 - value(0.0))).abs() < 1e-12);
        assert!(Parabola::new([1.0, 0.0, 1.0], 0.1).is_none(), "a minimum");
        assert!(Parabola::new([1.0, 1.0, 1.0], 0.1).is_none(), "a constant");
    }
}

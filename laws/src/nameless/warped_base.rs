//! A warped base plate: the arm above it leans, depending on the position of the first joint.
//!
//! Law: the arm leans about a horizontal axis by θ(q₁) = a (cos n q₁, sin n q₁, 0) \[rad\], n being the number of waves of the plate per
//! turn; the tool moves by θ × p, p \[m\] its position in the base frame. Torques do not change: the lean is small.
//! Source: the tilt error motion of a rotary axis, ISO 230-7:2015, §3.

use nalgebra::Vector3;

use crate::archive::Archive;
use crate::columns::Columns;
use crate::effect::Effect;
use crate::injection::{Injection, Readings, SensorLaw};
use crate::kind::{Kind, Occurrence, Seen, Terms, one_shape};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;
use crate::scene::{Scene, tool_positions};

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "warped_base",
    title: "a warped base",
    words: "a base with a tilt of {tilt} in {waves} waves a turn",
    site: Site::Arm,
    parameters: &[
        Parameter::number("tilt", "greatest tilt", "rad", [0.0, 0.1]),
        Parameter::number("waves", "waves in a turn of the first joint", "1/rev", [0.0, 100.0]),
    ],
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::POSE,
    rough: false,
    shakes: false,
    equation: "θ = a (cos n q₁, sin n q₁, 0), and the tool moves by θ × p",
    source: "ISO 230-7:2015, §3",
    signature: "the tool deviates by a tilt that turns with the first joint",
    confounders: &[("base_tilt", "does not turn with the first joint")],
    contains: &[],
    needs: &[Need::Tool],
    terms: Terms::LINEAR,
    shapes: one_shape,
    build: |values| Ok(Box::new(WarpedBase { tilt: values.number("tilt")?, waves: values.number("waves")? })),
};

#[derive(Clone, Copy, Debug)]
struct WarpedBase {
    tilt: f64,
    waves: f64,
}

impl WarpedBase {
    /// Displacement of a tool at `tool` with the first joint at `q`, m.
    fn moves(self, q: f64, tool: Vector3<f64>) -> Vector3<f64> {
        let angle = self.waves * q;
        Vector3::new(self.tilt * angle.cos(), self.tilt * angle.sin(), 0.0).cross(&tool)
    }
}

impl Effect for WarpedBase {
    fn displace(&self, scene: &Scene, tool: &mut Columns) {
        let nominal = tool_positions(&scene.arm, &scene.motion.q);
        for point in 0..scene.motion.len() {
            let place = Vector3::new(nominal[0][point], nominal[1][point], nominal[2][point]);
            let moved = self.moves(scene.motion.q[0][point], place);
            moved.iter().enumerate().for_each(|(axis, moved)| tool[axis][point] += moved);
        }
    }

    fn inject(&self, injection: &mut Injection) {
        injection.tool.push(Box::new(*self));
    }
}

impl SensorLaw for WarpedBase {
    fn read(&mut self, readings: &mut Readings) {
        let tool = Vector3::from_column_slice(&readings.tool[..3]);
        let moved = self.moves(readings.q[0], tool);
        readings.tool.iter_mut().zip(moved.iter()).for_each(|(tool, moved)| *tool += moved);
    }

    fn transfer_state(&mut self, _: &mut Archive) {}
}

#[cfg(test)]
mod tests {
    use super::WarpedBase;
    use nalgebra::Vector3;

    /// At q₁ = 0 the lean is about x: a tool on x does not move, one on z moves towards −y.
    #[test]
    fn the_lean_turns_with_the_first_joint() {
        let base = WarpedBase { tilt: 1e-3, waves: 1.0 };
        let tool = Vector3::new(1.0, 0.0, 0.5);
        assert!((base.moves(0.0, tool) - Vector3::new(0.0, -0.5e-3, 0.0)).norm() < 1e-15);
        let quarter = base.moves(std::f64::consts::FRAC_PI_2, tool);
        assert!((quarter - Vector3::new(0.5e-3, 0.0, -1e-3)).norm() < 1e-15, "{quarter}");
    }
}

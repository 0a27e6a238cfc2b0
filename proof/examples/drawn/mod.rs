//! Random arms of three links on servos, shared by several examples.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Joints of the arm, one behind the other: the first turns about the vertical, the others in the plane of gravity.
pub const JOINTS: [&str; 3] = ["pan", "lift", "elbow"];

/// The table of the link behind the joint number `joint`: 0.2 to 0.8 kg, 0.15 to 0.35 m.
pub fn link(rng: &mut ChaCha8Rng, joint: usize) -> String {
    let (mass, length) = (rng.random_range(0.2..0.8), rng.random_range(0.15..0.35));
    let name = JOINTS[joint];
    let axis = if joint == 0 { "[0.0, 0.0, 1.0]" } else { "[0.0, -1.0, 0.0]" };
    let origin = if joint == 0 { 0.0 } else { length };
    let inertia = mass * length * length / 12.0 + 1e-4;
    format!(
        "[[joint]]\nname = \"{name}\"\ntype = \"revolute\"\naxis = {axis}\norigin = {{ xyz = [{origin}, 0.0, 0.0] }}\nmass = {mass}\n\
         com = [{}, 0.0, 0.0]\ninertia = {{ ixx = {inertia}, iyy = {inertia}, izz = {inertia}, ixy = 0.0, ixz = 0.0, iyz = 0.0 }}\n",
        0.5 * length
    )
}

/// The table of a servo at `joint` with a lag of 20 to 100 ms, and its stiffness, 8 to 40 N·m/rad.
pub fn servo(rng: &mut ChaCha8Rng, joint: &str) -> (String, f64) {
    let stiffness = rng.random_range(8.0..40.0);
    let damping = stiffness * rng.random_range(0.02..0.1);
    let table = format!(
        "[[effect]]\nkind = \"servo\"\njoint = \"{joint}\"\nstiffness = {stiffness}\ndamping = {damping}\n"
    );
    (table, stiffness)
}

//! The paper's Tables 1 and 2, and the values chosen for those that it does not give.

use freeplay_arm::Arm;
use freeplay_laws::{Clearance, ClearanceTable};
use freeplay_model::paper_arm;
use freeplay_report::{Cell, Column, Table};
use freeplay_terminal::exit::Failure;

use super::case::CLEARANCES;

/// Masses, lengths and inertias of the four links (Table 1).
pub fn links() -> Table {
    let arm = paper_arm().arm;
    let mut table = Table::new("The paper's Table 1: the arm's links")
        .column(Column::text("link"))
        .column(Column::text("moves with"))
        .column(Column::number("length", "m").fixed(3))
        .column(Column::number("mass", "kg").fixed(2));
    for element in ["Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"] {
        table = table.column(Column::number(element, "kg·m²").group("inertia about the centre of mass"));
    }
    let heavy = arm.joints().iter().enumerate().filter(|(_, joint)| joint.inertia.mass > 0.0);
    for (place, (index, joint)) in heavy.enumerate() {
        let i = &joint.inertia.about_com;
        table = table.row([
            format!("link {}", place + 1).into(),
            joint.name.replace('_', " ").into(),
            length(&arm, index).into(),
            joint.inertia.mass.into(),
            i[(0, 0)].into(),
            i[(1, 1)].into(),
            i[(2, 2)].into(),
            i[(0, 1)].into(),
            i[(0, 2)].into(),
            i[(1, 2)].into(),
        ]);
    }
    table.note("Frames with z up; the paper's y points up. Off-diagonal elements are −∫xy dm. Two combinations of the inertias have no influence on any motion or load of this arm and are chosen, see `model/arms/erkaya2018.toml`.")
}

/// Distance from the joint `index` to the next one at another place, or to the tool, m.
fn length(arm: &Arm, index: usize) -> f64 {
    let next = arm.joints().iter().skip(index + 1).map(|joint| joint.placement.translation.vector.norm());
    next.chain([arm.tool().translation.vector.norm()]).find(|length| *length > 0.0).unwrap_or(0.0)
}

/// Parameters of joint and simulation (Table 2), as used in the runs.
///
/// # Errors
/// An impossible clearance.
pub fn simulation() -> Result<Table, Failure> {
    let play = ClearanceTable::new(CLEARANCES[0] * 1e-3);
    let stiffness: Result<Vec<String>, Failure> = CLEARANCES
        .iter()
        .map(|c| {
            let clearance = Clearance::new(&ClearanceTable::new(c * 1e-3)).map_err(Failure::internal)?;
            Ok(format!("{:.4e}", clearance.normal.stiffness))
        })
        .collect();
    let rows = [
        ("radial clearance c", "0.2, 0.4, 0.6 mm", "as the paper".to_owned()),
        ("Young's modulus", "71.7 GPa", format!("{} GPa", play.material.young * 1e-9)),
        ("Poisson's ratio", "0.33", play.material.poisson.to_string()),
        ("restitution e", "0.9", play.restitution.to_string()),
        ("dynamic friction μ_d", "0.01", play.friction.to_string()),
        ("static friction μ_s", "–", format!("{} (= μ_d: no Stribeck bump)", play.friction)),
        ("speeds v_s, v_d of the friction law", "–", format!("{}, {} m/s", play.static_speed, play.dynamic_speed)),
        ("floor of the impact speed", "–", format!("{} m/s", play.impact_speed_floor)),
        ("bearing radius", "–", format!("{} mm; the journal is c smaller", play.bearing_radius * 1e3)),
        ("contact stiffness K (Eq. 4)", "–", format!("{} N/m^1.5", stiffness?.join(", "))),
        ("integration step", "1 ms", "20 µs: at 1 ms the contact, which lasts half of that, cannot be integrated; 1 ms is the step of the output".to_owned()),
        ("times of the lap", "6 s, 12 s", "as the paper".to_owned()),
        ("samples of the network", "750, 1500", "125 Hz, every eighth tick".to_owned()),
        ("network", "4 × 10 sigmoid units, delays 2/2", "tanh; u(t), u(t−1), u(t−2), y(t−1), y(t−2)".to_owned()),
        ("training", "Levenberg–Marquardt, 50/20/30 %", "MATLAB's rule; random and block split".to_owned()),
    ];
    let mut table = Table::new("The paper's Table 2 and its open values: joint, simulation, network")
        .column(Column::text("parameter"))
        .column(Column::text("in the paper"))
        .column(Column::text("taken here").wrapping());
    for (name, paper, here) in rows {
        table = table.row([Cell::from(name), paper.into(), here.into()]);
    }
    Ok(table)
}

/// Open points of the paper besides numbers, and the choices for them.
pub fn left_open() -> Table {
    let mut table = Table::new("Open choices of the paper")
        .column(Column::text("what"))
        .column(Column::text("choice here, and reason").wrapping());
    for (what, taken) in [
        (
            "which robot",
            "its lengths are those of a KUKA KR 6: base offsets 0.675 m and 0.260 m are taken from there",
        ),
        ("four links for six joints", "the bodies after joints 1 and 5 carry no mass"),
        ("centres of mass", "at mid length"),
        (
            "the path",
            "a smooth Lissajous curve, each lap from rest to rest, and a square of 0.30 m with sharp corners (accelerating for 0.4 % of a side)",
        ),
        (
            "drive of the joints",
            "both: prescribed motion, which its figures of forces suggest, and computed torque at 1 kHz (ω = 50 rad/s, ζ = 1)",
        ),
        ("load that turns joint 5 across its play", "a pure couple about its axis"),
        (
            "the sign of friction (Eqs. 6 and 7)",
            "corrected: as printed it pushes along the sliding; both are run, see the claims",
        ),
        ("tension in the contact", "none: F_N ≥ 0"),
        ("split of the samples", "both at random (MATLAB's default) and in blocks of time"),
        (
            "the network's input u(t)",
            "the torque of the very sample that is predicted, as Eq. 10 has it; a controller would not have it",
        ),
    ] {
        table = table.row([Cell::from(what), taken.into()]);
    }
    table
}

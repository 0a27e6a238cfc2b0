//! A reading as a mapping file for the recorded file: the format of `--mapping`.

use freeplay_recording::{Quantity, Recording, Sources};

use super::reading::Reading;

/// `reading` as a mapping of the columns of `recording`, under their names in the file; `None` for a reading that changes nothing.
pub(crate) fn mapping(reading: &Reading, recording: &Recording) -> Option<String> {
    if reading.is_plain() {
        return None;
    }
    let mut sources = Sources::of(recording);
    correct_positions(reading, &mut sources);
    for quantity in &mut sources.quantities {
        match quantity.key.as_str() {
            "t" => quantity.scale.iter_mut().for_each(|scale| *scale *= reading.time_unit),
            "tau" => {
                quantity.reorder(&reading.torques.iter().map(|torque| torque.source).collect::<Vec<_>>());
                for (joint, torque) in reading.torques.iter().enumerate() {
                    quantity.scale[joint] *= torque.factor;
                    quantity.offset[joint] *= torque.factor;
                }
                quantity.delay += reading.torque_delay;
            }
            "tool" | "orientation" => quantity.delay += reading.tool_delay,
            _ => {}
        }
    }
    sources.gravity_compensated |= reading.gravity_added;
    let head = "# Mapping of this recording. Correct wrong entries, and pass this file with --mapping.\n";
    Some(format!("{head}{}", sources.to_toml(&recording.joint_names)))
}

/// Positions and velocities: order, signs, units, zeros, jumps, and their dependence on other joints.
fn correct_positions(reading: &Reading, sources: &mut Sources) {
    let order: Vec<usize> = reading.positions.iter().map(|position| position.source).collect();
    let place = |joint: usize| order.iter().position(|&old| old == joint).unwrap_or(joint);
    let factor = |joint: usize| reading.positions[joint].sign * reading.positions[joint].unit;
    // A position that included another one in the file still does, with the new signs and places.
    for (joint, other, k) in &mut sources.relative {
        (*joint, *other) = (place(*joint), place(*other));
        *k *= factor(*joint) / factor(*other);
    }
    let relative = sources.relative.clone();
    let of_joints =
        |quantity: &&mut Quantity| matches!(quantity.key.as_str(), "q" | "qd" | "q_ref" | "q_link");
    for quantity in sources.quantities.iter_mut().filter(of_joints) {
        quantity.reorder(&order);
        let has_zeros = quantity.key != "qd";
        for joint in 0..order.len() {
            quantity.scale[joint] *= factor(joint);
            quantity.offset[joint] *= factor(joint);
            if has_zeros {
                quantity.offset[joint] += reading.positions[joint].zero;
            }
        }
        quantity.unwrap |= reading.unwrap && has_zeros;
        if has_zeros {
            for &(joint, other, k) in &relative {
                quantity.offset[joint] += k * reading.positions[other].zero;
            }
        }
    }
    for (joint, position) in reading.positions.iter().enumerate() {
        if let Some((other, factor)) = position.relative {
            sources.relative.push((joint, other, factor));
        }
    }
}

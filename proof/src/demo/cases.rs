//! The machines of the demonstration, with their concealed physics.

use freeplay_laws::{ArmParts, LawError};
use freeplay_model::{ArmFile, EffectTable, paper_arm};
use toml::{Table, Value};

/// A machine that differs from its model.
#[derive(Clone, Debug)]
pub struct Case {
    /// Name of its folder, and on the command line.
    pub name: &'static str,
    /// The concealed physics, in words.
    pub hidden: &'static str,
    /// The concealed effect; `None` for a machine that equals its model.
    pub effect: Option<EffectTable>,
    /// Rotor inertias in the model by the index of their joint, kg·m²: an elastic or loose gear transmits only the torque of its link, without that of the rotor.
    pub rotors: &'static [(usize, f64)],
    /// A notch in the gear of this joint, added to the recorded torque: no effect of the catalogue.
    pub notch: Option<Notch>,
}

/// Resisting torque of a gear with one damaged tooth while that tooth is in mesh: F exp(−((q − q₀)/w)²) sign q̇.
#[derive(Clone, Copy, Debug)]
pub struct Notch {
    /// Index of the joint.
    pub joint: usize,
    /// Greatest torque F, N·m.
    pub torque: f64,
    /// Position of q₀ in the joint's recorded range, 0 to 1.
    pub place: f64,
    /// Width w, as a share of that range.
    pub width: f64,
}

impl Case {
    /// The nominal model: the paper's arm, and its rotors where they matter.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn nominal(&self) -> Result<ArmFile, LawError> {
        let mut file = paper_arm();
        let mut parts = ArmParts::of(&file.arm);
        for &(joint, inertia) in self.rotors {
            parts.joints[joint].rotor_inertia = inertia;
        }
        file.arm = parts.into_arm(file.arm.name())?;
        Ok(file)
    }

    /// The true machine: the nominal model with the concealed effect.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn truth(&self) -> Result<ArmFile, LawError> {
        Ok(ArmFile { effects: self.effect.iter().cloned().collect(), ..self.nominal()? })
    }
}

/// An `[[effect]]` table.
pub fn with<const N: usize>(
    kind: &str,
    joint: Option<&str>,
    parameters: [(&str, Value); N],
) -> Option<EffectTable> {
    let parameters: Table = parameters.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
    Some(EffectTable { kind: kind.to_owned(), joint: joint.map(str::to_owned), parameters, line: 0 })
}

/// All machines, in the order of the table.
pub fn all() -> Vec<Case> {
    let case = |name, hidden, effect| Case { name, hidden, effect, rotors: &[], notch: None };
    vec![
        case(
            "clearance",
            "0.6 mm of radial play in joint_5",
            with("joint_clearance", Some("joint_5"), [("clearance", 0.0006.into())]),
        ),
        case(
            "friction",
            "40 N·m of Coulomb friction in joint_3",
            with("coulomb_friction", Some("joint_3"), [("coulomb", 40.0.into())]),
        ),
        Case {
            rotors: &[(0, 8.0)],
            ..case(
                "backlash",
                "a gap of 2 mrad in the gear of joint_1",
                with(
                    "backlash",
                    Some("joint_1"),
                    [("gap", 0.002.into()), ("stiffness", 1e5.into()), ("damping", 1000.0.into())],
                ),
            )
        },
        case(
            "payload",
            "4 kg on the last link",
            with("payload", None, [("mass", 4.0.into()), ("com", vec![0.1, 0.0, 0.02].into())]),
        ),
        case(
            "delay",
            "encoders that are 2.5 ms late",
            with("time_delay", None, [("delay", 0.0025.into()), ("channel", "position".into())]),
        ),
        case("nothing", "nothing: the machine is its model", None),
        Case {
            notch: Some(Notch { joint: 1, torque: 25.0, place: 0.45, width: 0.07 }),
            ..case("notch", "a damaged tooth in joint_2's gear (not in the catalogue)", None)
        },
    ]
}

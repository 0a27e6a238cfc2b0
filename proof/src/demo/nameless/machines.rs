//! The machines, the paths for their commissioning, and those for the verdict.

use freeplay_laws::NAMELESS;
use freeplay_model::EffectTable;
use freeplay_path::{PathKind, PathSpec, Size};

use super::super::cases::with;

/// A machine with concealed physics.
#[derive(Clone, Debug)]
pub struct Machine {
    /// Name of its folder, and on the command line.
    pub name: &'static str,
    /// The concealed physics, in words.
    pub hidden: &'static str,
    /// The concealed effects.
    pub effects: Vec<EffectTable>,
    /// True if a part of it has no name in the catalogue.
    pub is_nameless: bool,
}

/// All machines.
pub fn all() -> Vec<Machine> {
    let play = || with("joint_clearance", Some("joint_5"), [("clearance", 6e-4.into())]);
    let detent = |joint, torque: f64, position: f64| {
        let place = [("torque", torque.into()), ("position", position.into()), ("width", 0.08.into())];
        with("detent", Some(joint), place)
    };
    let cable = || {
        let hook = toml::Value::from(vec![0.3, 0.4, 2.0]);
        let rest = [("mass", 0.4.into()), ("length", 1.0.into()), ("stiffness", 8.0.into())];
        let [mass, length, stiffness] = rest;
        with("cable_drag", None, [("hook", hook), mass, length, stiffness])
    };
    let warped = |tilt: f64| with("warped_base", None, [("tilt", tilt.into()), ("waves", 3.0.into())]);
    let drift = || {
        let drift = toml::Value::from(vec![0.0, 1e-4, -1.5e-4]);
        with("thermal_drift", None, [("drift", drift), ("time", 6.0.into())])
    };
    let rub = || with("coulomb_friction", Some("joint_3"), [("coulomb", 20.0.into())]);
    let machine = |name, hidden, effects: Vec<Option<EffectTable>>| {
        let effects: Vec<EffectTable> = effects.into_iter().flatten().collect();
        let is_nameless = effects.iter().any(|effect| NAMELESS.iter().any(|kind| kind.name == effect.kind));
        Machine { name, hidden, effects, is_nameless }
    };
    vec![
        machine("play", "play of joint 5, nothing nameless", vec![play()]),
        machine(
            "play-detent",
            "play of joint 5, a detent in joint 3",
            vec![play(), detent("joint_3", 6.0, 0.35)],
        ),
        machine("play-cable", "play of joint 5, a cable on the tool", vec![play(), cable()]),
        machine("play-warped", "play of joint 5, a warped base", vec![play(), warped(3e-4)]),
        machine("play-drift", "play of joint 5, a drift of the tool", vec![play(), drift()]),
        machine(
            "play-all",
            "play of joint 5, detent, cable, warped base and drift",
            vec![play(), detent("joint_3", 6.0, 0.35), cable(), warped(3e-4), drift()],
        ),
        machine("detent", "a detent in joint 2", vec![detent("joint_2", 20.0, 0.3)]),
        machine("cable", "a cable on the tool", vec![cable()]),
        machine("warped", "a warped base", vec![warped(5e-4)]),
        machine("cable-drift", "a cable on the tool and a drift", vec![cable(), drift()]),
        machine(
            "friction-warped",
            "20 N·m of Coulomb friction in joint 3, a warped base",
            vec![rub(), warped(3e-4)],
        ),
        machine("nothing-nameless", "nothing: the machine is its model", vec![]),
    ]
}

/// The paths of a demonstration with periods in proportion to `period`, s; the comments give them for 6 s.
#[derive(Clone, Copy, Debug)]
pub struct DemoPaths {
    /// Time of a lap of the first path, s.
    pub period: f64,
}

impl DemoPaths {
    /// Paths for commissioning, with a tracker: in 6, 5 and 8 s.
    pub fn commissioning(self) -> [(&'static str, PathSpec); 3] {
        let axes = |axes| Some(Size::Axes(axes));
        [
            ("one", self.path(PathKind::Lissajous, None, 6.0, CENTRE)),
            ("two", self.path(PathKind::Lissajous, axes([0.2, 0.15, 0.1]), 5.0, CENTRE)),
            ("three", self.path(PathKind::Square, Some(Size::One(0.2)), 8.0, CENTRE)),
        ]
    }

    /// Paths for the verdict, without a tracker: in 5, 7 and 9 s.
    pub fn judged(self) -> [(&'static str, PathSpec); 3] {
        let (wide, small) = (Size::Axes([0.1, 0.2, 0.08]), Size::Axes([0.12, 0.12, 0.03]));
        [
            ("wide, fast", self.path(PathKind::Lissajous, Some(wide), 5.0, CENTRE)),
            ("small and aside", self.path(PathKind::Lissajous, Some(small), 7.0, [0.93, 0.05, 0.97])),
            ("square, slow", self.path(PathKind::Square, Some(Size::One(0.12)), 9.0, CENTRE)),
        ]
    }

    /// A path with the first joint far beyond all commissioning paths: in 6 s.
    pub fn far_outside(self) -> PathSpec {
        self.path(PathKind::Lissajous, Some(Size::Axes([0.1, 0.1, 0.05])), 6.0, [0.65, 0.55, 0.75])
    }

    /// A path whose lap takes `seconds` s if that of the first one takes 6 s.
    fn path(self, kind: PathKind, size: Option<Size>, seconds: f64, centre: [f64; 3]) -> PathSpec {
        PathSpec { kind, size, period: seconds * self.period / 6.0, centre, ..PathSpec::default() }
    }
}

/// Middle of most paths, base frame, m.
const CENTRE: [f64; 3] = [0.95, 0.0, 0.95];

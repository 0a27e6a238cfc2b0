//! The built-in controllers on arms of one to eight joints, one of them prismatic, with play at the first revolute joint.

use freeplay_arm::{Arm, Inertia, Joint, JointFriction, JointKind, Limits, Workspace, forward_kinematics};
use freeplay_controller::{Answer, BUILT_IN, RunInfo, Task, built_in};
use freeplay_model::{ArmFile, EffectTable, load, to_toml};
use freeplay_path::{JointPath, PathKind};
use freeplay_shm::{CommandStatus, Mode, Pace, State};
use nalgebra::{Isometry3, Matrix3, Unit, Vector3};

fn chain(n: usize) -> Arm {
    let joints = (0..n)
        .map(|i| Joint {
            name: format!("joint_{i}"),
            kind: if i == 2 { JointKind::Prismatic } else { JointKind::Revolute },
            axis: Unit::new_normalize(Vector3::new(0.2, 1.0, 0.3 * i as f64)),
            placement: Isometry3::translation(0.1, 0.05, 0.3),
            limits: Limits { lower: -1.5, upper: 1.5, velocity: 3.0, acceleration: 30.0, effort: 1e3 },
            friction: JointFriction { viscous: 0.1, coulomb: 0.2 },
            rotor_inertia: 0.0,
            inertia: Inertia {
                mass: 2.0,
                com: Vector3::new(0.05, 0.0, 0.1),
                about_com: Matrix3::identity() * 0.02,
            },
        })
        .collect();
    Arm::new("chain", joints, Isometry3::translation(0.1, 0.0, 0.2), Vector3::new(0.0, 0.0, -9.81)).unwrap()
}

#[test]
fn arms_of_one_to_eight_joints_are_controlled() {
    let folder = tempfile::tempdir().unwrap();
    for n in 1..=8 {
        let parameters = toml::Table::from_iter([("clearance".to_owned(), toml::Value::from(3e-4))]);
        let effect = EffectTable {
            kind: "joint_clearance".to_owned(),
            joint: Some("joint_0".to_owned()),
            parameters,
            line: 0,
        };
        let file = ArmFile { arm: chain(n), effects: vec![effect], ignored: Vec::new() };
        let model = folder.path().join(format!("chain_{n}.toml"));
        std::fs::write(&model, to_toml(&file)).unwrap();
        let mut task = Task { model: model.display().to_string(), ..Task::default() };
        task.path.kind = PathKind::JointSine;
        let arm = load(&model).unwrap().arm;
        let path = JointPath::plan(&arm, &task.path, task.rate).unwrap();
        let run =
            RunInfo { joints: n, mode: Mode::Torque, pace: Pace::Lockstep, period_ns: 1_000_000, ticks: 400 };
        for name in BUILT_IN {
            let mut controller = built_in(name).unwrap();
            controller.start(&task, &run).unwrap();
            let mut last = Answer::BLANK;
            for tick in 0..400 {
                let mut state = State::new(1, n);
                state.tick = tick;
                for (reference, at) in [(&mut state.reference, tick), (&mut state.reference_next, tick + 1)] {
                    path.at(at as f64 * 1e-3, &mut reference.q, &mut reference.qd, &mut reference.qdd);
                }
                (state.q, state.qd, state.applied) = (state.reference.q, state.reference.qd, last.value);
                last = Answer::BLANK;
                controller.answer(&state, &mut last);
                assert_eq!(last.status, CommandStatus::Ok, "{name}, {n} joints, tick {tick}");
            }
            let reach = forward_kinematics(&arm, &mut Workspace::new(&arm), &vec![0.0; n]);
            println!(
                "{n} joints, {name}: deviation {:.3} mm, torque of the first joint {:.2} N·m, reach {:.1} m",
                1e3 * Vector3::from(last.deviation).norm(),
                last.value[0],
                reach.translation.vector.norm()
            );
            let predicted = Vector3::from(last.deviation).norm();
            let expected = if name != "computed-torque" { 3e-4 } else { 0.0 };
            assert!((predicted - expected).abs() < 5e-6, "{predicted}");
            assert!(last.value[0].abs() > 0.1);
        }
    }
}

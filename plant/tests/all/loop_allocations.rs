//! The plant's loop itself allocates nothing: apart from iceoryx2's one block per published message (48 bytes, counted in `shm`), a longer
//! run allocates exactly as often as a shorter one.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use crossbeam::queue::ArrayQueue;
use freeplay_laws::Effects;
use freeplay_model::{ArmFile, EffectTable, paper_arm};
use freeplay_path::{JointPath, PathSpec};
use freeplay_plant::{ControllerSet, Ending, PlannedSwap, Plant, PlantConfig, ReflexSpec, SensorsSpec};
use freeplay_shm::{Backoff, Command, ControllerLink, Hello, Mode, Offer, Pace, PlantLink, RunFolder, State};

/// Effects with laws in the sub-steps and in the sensors.
fn effects_of_all_stages() -> Vec<EffectTable> {
    let table = |kind: &str, name: &str, value: f64, joint: &str| EffectTable {
        kind: kind.to_owned(),
        joint: Some(joint.to_owned()),
        parameters: toml::Table::from_iter([(name.to_owned(), value.into())]),
        line: 0,
    };
    vec![
        table("joint_clearance", "clearance", 0.6e-3, "joint_5"),
        table("coulomb_friction", "coulomb", 2.0, "joint_2"),
        table("encoder_offset", "offset", 1e-3, "joint_3"),
    ]
}

/// Runs `ticks` ticks against a controller in another thread; returns the number of allocations of the plant's thread, and the records.
///
/// With several `controllers`, another one becomes active every ten ticks.
fn play(ticks: u64, controllers: usize) -> (u64, usize) {
    let root = RunFolder::create().expect("a run");
    let address = root.address().clone();
    let offer = Offer {
        joints: 6,
        mode: Mode::Driven,
        pace: Pace::Lockstep,
        period_ns: 1_000_000,
        ticks,
        task: String::new(),
    };
    let link = PlantLink::open(&address, controllers, offer).expect("the plant's end");
    let arm = paper_arm().arm;
    let path = Arc::new(JointPath::plan(&arm, &PathSpec::default(), 1000.0).expect("the smooth path"));
    let file = ArmFile { arm, effects: effects_of_all_stages(), ignored: Vec::new() };
    let effects = Effects::of(&file).expect("effects that the catalogue knows");
    let arm = file.arm;
    let swap = |tick| PlannedSwap { tick, to: (tick / 10) as usize % controllers };
    let swaps = (10..ticks).step_by(10).map(swap).collect();
    let config = PlantConfig {
        arm,
        effects: Arc::new(effects),
        mode: Mode::Driven,
        pace: Pace::Lockstep,
        period_ns: 1_000_000,
        substeps: 20,
        ticks,
        sensors: SensorsSpec::default(),
        seed: 1,
        hold: 20,
        patience: Duration::from_secs(10),
        answer_patience: None,
        command_every: 1,
        evidence: false,
        controller_set: ControllerSet { controllers, swaps, blend: 7, ..ControllerSet::default() },
        reflex: ReflexSpec::default(),
        natural_frequency: 50.0,
    };
    let queue = Arc::new(ArrayQueue::new(ticks as usize));
    let mut plant = Plant::new(config, path, link, address.run(), Arc::clone(&queue)).expect("a plant");
    let follow = |slot: u32| {
        let address = address.clone();
        move || {
            let hello = Hello::new("follower", slot, 0);
            let (mut link, _) =
                ControllerLink::connect(&address, hello, Duration::from_secs(10)).expect("welcome");
            let mut backoff = Backoff::for_this_machine();
            loop {
                let Some(state) = link.next_state().expect("a link") else {
                    backoff.wait();
                    continue;
                };
                backoff.reset();
                let mut command = Command::answer_to(&state, slot);
                (command.value, command.velocity) = (state.reference_next.q, state.reference_next.qd);
                command.acceleration = state.reference_next.qdd;
                link.send(&command).expect("sent");
                if state.has(State::FLAG_LAST) {
                    break;
                }
            }
        }
    };
    let threads: Vec<_> = (0..controllers as u32).map(|slot| std::thread::spawn(follow(slot))).collect();
    let stop = AtomicBool::new(false);
    let mut ending = None;
    let counted = allocation_counter::measure(|| ending = Some(plant.run(&stop).expect("a run").ending));
    threads.into_iter().for_each(|thread| thread.join().expect("a controller"));
    assert!(
        controllers == 1 || plant.manager().swaps().len() as u64 == (ticks - 1) / 10,
        "{}",
        plant.manager().swaps().len()
    );
    assert_eq!(ending, Some(Ending::Finished));
    assert_eq!(plant.missed_deadlines().missed, 0);
    (counted.count_total, queue.len())
}

#[test]
fn a_longer_run_allocates_no_more_than_the_transport_does() {
    for controllers in [1, 3] {
        let (short, long) = (play(50, controllers), play(550, controllers));
        println!("{controllers} controllers: 50 ticks: {} allocations, 550 ticks: {}", short.0, long.0);
        assert_eq!((short.1, long.1), (50, 550), "every tick is recorded");
        // The number of checks for controllers at the start, which allocate, differs by a few; an allocation in every 25th tick would
        // exceed this.
        let start_differs = 20;
        assert!(
            long.0 - short.0 <= 500 + start_differs,
            "beside the start, one block a published message: {}",
            long.0 - short.0
        );
    }
}

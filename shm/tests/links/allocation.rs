//! Allocations of a tick after set-up: none by this crate, and one small block by iceoryx2 per sent message.

use std::hint::black_box;
use std::ops::Range;
use std::os::unix::fs::MetadataExt;

use allocation_counter::{AllocationInfo, measure};
use freeplay_shm::{
    Backoff, Command, ControllerLink, Hello, MAX_SLOTS, MEMORY, PlantLink, ROOM, RunFolder, State,
};

use crate::leftovers::traces;
use crate::{PATIENCE, greet, open_plant};

/// The first ticks settle connections, since the controller has just connected; in the last ticks, it leaves.
const MEASURED: Range<u64> = 20..220;
const TICKS: u64 = 240;

/// iceoryx2 0.10 counts the references to a loaned message in a heap block of 48 bytes, which it frees when the message is sent;
/// the link then loans the next. The block comes from the thread's cache of the allocator, without a lock or a system call.
const BYTES_PER_MESSAGE_SENT: u64 = 48;

#[test]
fn a_tick_allocates_nothing_but_the_block_of_a_loan() {
    let run = RunFolder::create().unwrap();
    let mut plant = open_plant(&run, 1);
    let address = run.address().clone();
    let controller = std::thread::spawn(move || {
        let (mut link, _) = ControllerLink::connect(&address, Hello::new("frugal", 0, 0), PATIENCE).unwrap();
        let used = controller_ticks(&mut link);
        assert_eq!(link.lost(), 0);
        used
    });
    greet(&mut plant, 1);
    let used_by_plant = plant_ticks(&mut plant, run.address().run());
    let used_by_controller = controller.join().unwrap();

    for (side, (sending, all_else)) in [("plant", used_by_plant), ("controller", used_by_controller)] {
        println!("{side}: sending {sending:?}, all else {all_else:?}");
        assert_eq!(all_else, AllocationInfo::default(), "{side}");
        let messages = MEASURED.end - MEASURED.start;
        assert!(sending.count_total <= messages && sending.count_current == 0, "{side}");
        assert!(sending.bytes_total <= messages * BYTES_PER_MESSAGE_SENT, "{side}");
    }
    assert!(measure(|| drop(black_box(Box::new(5)))).count_total > 0, "the counter counts");
}

#[test]
fn a_plant_with_all_slots_allocates_less_than_it_asks_for_before() {
    let run = RunFolder::create().unwrap();
    let used = measure(|| drop(black_box(open_plant(&run, MAX_SLOTS))));
    println!("{used:?} of {MEMORY}");
    // The check allocates MEMORY and frees it, so the peak is at least MEMORY.
    let without_check = used.bytes_total - MEMORY as u64;
    assert!((1..MEMORY as u64 / 2).contains(&without_check), "{without_check} bytes");
}

#[test]
fn a_plant_with_all_slots_has_less_in_shared_memory_than_it_asks_for_before() {
    let run = RunFolder::create().unwrap();
    let _plant = open_plant(&run, MAX_SLOTS);
    let segments = traces(run.address()).into_iter().map(|path| path.metadata().unwrap());
    let (sizes, blocks): (Vec<u64>, Vec<u64>) =
        segments.filter(|found| found.is_file()).map(|found| (found.len(), found.blocks() * 512)).unzip();
    println!("{} of {ROOM} bytes, in blocks {}", sizes.iter().sum::<u64>(), blocks.iter().sum::<u64>());
    // Each controller adds a segment and a connection to those of the plant.
    assert!((1..ROOM / 4).contains(&sizes.iter().sum()), "{sizes:?}");
    // All memory for later writes is already allocated.
    assert!(sizes.iter().zip(&blocks).all(|(size, blocks)| size <= blocks), "{sizes:?} in {blocks:?}");
}

/// Allocations by publishing, and by everything else in the measured ticks.
fn plant_ticks(plant: &mut PlantLink, run: u64) -> (AllocationInfo, AllocationInfo) {
    let mut used = (AllocationInfo::default(), AllocationInfo::default());
    let mut backoff = Backoff::for_this_machine();
    for tick in 0..TICKS {
        let state = State { tick, ..State::new(run, 7) };
        let sending = measure(|| plant.publish(&state).unwrap());
        backoff.reset();
        let all_else = measure(|| {
            while plant.newest_command(0).unwrap().is_none_or(|command| command.tick != tick) {
                assert!(backoff.wait() < PATIENCE.as_nanos() as u64);
            }
            assert!(plant.greet().unwrap().is_empty());
        });
        if MEASURED.contains(&tick) {
            used.0 += sending;
            used.1 += all_else;
        }
    }
    used
}

/// Allocations by sending, and by everything else in the measured ticks.
fn controller_ticks(link: &mut ControllerLink) -> (AllocationInfo, AllocationInfo) {
    let mut used = (AllocationInfo::default(), AllocationInfo::default());
    let mut backoff = Backoff::for_this_machine();
    for tick in 0..TICKS {
        let mut newest = None;
        backoff.reset();
        let all_else = measure(|| {
            while newest.is_none() {
                newest = link.next_state().unwrap();
                assert!(backoff.wait() < PATIENCE.as_nanos() as u64);
            }
        });
        let command = Command::answer_to(&newest.unwrap(), 0);
        let sending = measure(|| link.send(&command).unwrap());
        if MEASURED.contains(&tick) {
            used.0 += sending;
            used.1 += all_else;
        }
    }
    used
}

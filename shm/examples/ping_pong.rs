//! Measures the round-trip time of a state and its command over the links and over iceoryx2 alone, and the lateness of a sleeper.
//!
//! ```text
//! cargo run --release -p freeplay-shm --example ping_pong [-- --fifo]
//! ```
//!
//! Two processes exchange messages, each tied to a core. Both transports carry the same `State` and `Command` and alternate
//! within one run, so that disturbances of the machine affect both alike. Both read each message completely, as a user does
//! (`black_box`): iceoryx2 returns a reference into shared memory, and most of the time is spent fetching its target from the
//! other core. `--fifo` requests `SCHED_FIFO`, priority 80.

use std::env;
use std::error::Error;
use std::hint::{black_box, spin_loop};
use std::process::{Child, Command as Process};
use std::time::Duration;

use freeplay_shm::{
    Address, Backoff, BareController, BarePlant, Command, ControllerLink, Hello, Machine, Mode, Offer, Pace,
    PlantLink, RtRequest, RunFolder, Schedule, State, now_ns, prepare, sleep_then_spin_until,
};
use hdrhistogram::Histogram;

type Outcome<T> = Result<T, Box<dyn Error>>;

const TURNS: usize = 100;
const ROUNDS: u64 = 4_000;
const WARM_UP: u64 = 400;
const PATIENCE: Duration = Duration::from_secs(20);
const QUANTILES: [f64; 3] = [0.5, 0.99, 0.999];

fn main() -> Outcome<()> {
    let (flags, addresses): (Vec<String>, Vec<String>) =
        env::args().skip(1).partition(|text| text.starts_with("--"));
    let is_fifo = flags.iter().any(|flag| flag == "--fifo");
    match addresses.as_slice() {
        [] => plant(is_fifo),
        [ours, bare] => controller(&ours.parse()?, &bare.parse()?, is_fifo),
        _ => Err("usage: ping_pong [--fifo]".into()),
    }
}

/// Requests core `cpu` and, with `is_fifo`, priority 80; prints refusals.
fn set_up(cpu: usize, is_fifo: bool) {
    let request = RtRequest { priority: is_fifo.then_some(80), cpu: Some(cpu), lock_memory: is_fifo };
    for line in prepare(&request).refusals() {
        println!("{line}");
    }
}

fn plant(is_fifo: bool) -> Outcome<()> {
    let start = now_ns();
    let (ours, bare) = (RunFolder::create()?, RunFolder::create()?);
    let made = now_ns();
    let mut plant = PlantLink::open(ours.address(), 1, offer())?;
    println!(
        "a run made in {:.0} µs, the plant's end opened in {:.0} µs",
        us(made - start) / 2.0,
        us(now_ns() - made)
    );
    let mut bare_ends = BarePlant::open(bare.address())?;
    let mut controller = start_controller(ours.address(), bare.address(), is_fifo)?;
    set_up(0, is_fifo);
    println!("{:#?}", Machine::read());
    while plant.greet()?.is_empty() {
        spin_loop();
    }

    let run = ours.address().run();
    let mut total = [Histogram::new(3)?, Histogram::new(3)?];
    let mut ratios = Histogram::<u64>::new(3)?;
    for _ in 0..TURNS {
        let of_ours = measure(run, |state| plant_round(&mut plant, state))?;
        let of_bare = measure(run, |state| bare_plant_round(&mut bare_ends, state))?;
        ratios.record((1000.0 * ratio(&of_ours, &of_bare)) as u64)?;
        total[0].add(of_ours)?;
        total[1].add(of_bare)?;
    }
    println!("{} states and their commands each way, µs:    p50      p99    p99.9", total[0].len());
    println!("these links                               {}", row(&total[0]));
    println!("iceoryx2 alone                            {}", row(&total[1]));
    println!(
        "ratio at p50: {:.3}; of {TURNS} turns the median {:.3}",
        ratio(&total[0], &total[1]),
        us(ratios.value_at_quantile(0.5))
    );
    controller.wait()?;
    lateness(200_000)?;
    lateness(0)
}

fn controller(ours: &Address, bare: &Address, is_fifo: bool) -> Outcome<()> {
    let start = now_ns();
    let (mut link, _) = ControllerLink::connect(ours, Hello::new("ping-pong", 0, 7), PATIENCE)?;
    println!("the controller's end opened in {:.0} µs, greeting included", us(now_ns() - start));
    let mut bare_ends = BareController::open(bare)?;
    set_up(1, is_fifo);
    for _ in 0..TURNS {
        for _ in 0..WARM_UP + ROUNDS {
            controller_round(&mut link)?;
        }
        for _ in 0..WARM_UP + ROUNDS {
            bare_controller_round(&mut bare_ends)?;
        }
    }
    Ok(())
}

/// Starts this program a second time as the controller.
fn start_controller(ours: &Address, bare: &Address, is_fifo: bool) -> Outcome<Child> {
    let mut process = Process::new(env::current_exe()?);
    process.arg(ours.to_string()).arg(bare.to_string());
    Ok(process.args(is_fifo.then_some("--fifo")).spawn()?)
}

fn offer() -> Offer {
    let (period_ns, ticks) = (1_000_000, TURNS as u64 * ROUNDS);
    Offer { joints: 7, mode: Mode::Torque, pace: Pace::Lockstep, period_ns, ticks, task: String::new() }
}

/// Measures the times of rounds after a warm-up.
fn measure(run: u64, mut round: impl FnMut(&State) -> Outcome<()>) -> Outcome<Histogram<u64>> {
    let mut histogram = Histogram::new(3)?;
    for tick in 0..WARM_UP + ROUNDS {
        let start = now_ns();
        let state = State { tick, published_ns: start, ..State::new(run, 7) };
        round(&state)?;
        if tick >= WARM_UP {
            histogram.record(now_ns() - start)?;
        }
    }
    Ok(histogram)
}

fn plant_round(plant: &mut PlantLink, state: &State) -> Outcome<()> {
    plant.publish(state)?;
    let mut backoff = Backoff::for_this_machine();
    loop {
        match plant.newest_command(0)? {
            Some(command) if command.tick == state.tick => {
                black_box(&command);
                return Ok(());
            }
            _ => backoff.wait(),
        };
    }
}

fn controller_round(link: &mut ControllerLink) -> Outcome<()> {
    let mut backoff = Backoff::for_this_machine();
    loop {
        if let Some(state) = link.next_state()? {
            link.send(&Command::answer_to(black_box(&state), 0))?;
            return Ok(());
        }
        backoff.wait();
    }
}

fn bare_plant_round(plant: &mut BarePlant, state: &State) -> Outcome<()> {
    plant.publish(state)?;
    loop {
        match plant.next_command()? {
            Some(command) if command.tick == state.tick => {
                black_box(&command);
                return Ok(());
            }
            _ => spin_loop(),
        }
    }
}

fn bare_controller_round(controller: &mut BareController) -> Outcome<()> {
    loop {
        if let Some(state) = controller.next_state()? {
            controller.send(&Command::answer_to(black_box(&state), 0))?;
            return Ok(());
        }
        spin_loop();
    }
}

/// Measures the lateness of [`sleep_then_spin_until`] at 1 kHz for 5 s.
fn lateness(spin_ns: u64) -> Outcome<()> {
    let schedule = Schedule { start_ns: now_ns() + 1_000_000, period_ns: 1_000_000 };
    let mut histogram = Histogram::<u64>::new(3)?;
    for tick in 0..5_000 {
        let woken_ns = sleep_then_spin_until(schedule.due_ns(tick), spin_ns);
        histogram.record(schedule.late_ns(tick, woken_ns))?;
    }
    let spin_us = spin_ns / 1000;
    println!(
        "late at 1 kHz for 5 s, spinning the last {spin_us} µs: {}  max {:.1}",
        row(&histogram),
        us(histogram.max())
    );
    Ok(())
}

fn row(histogram: &Histogram<u64>) -> String {
    QUANTILES.map(|quantile| format!("{:8.2}", us(histogram.value_at_quantile(quantile)))).join(" ")
}

fn ratio(ours: &Histogram<u64>, bare: &Histogram<u64>) -> f64 {
    ours.value_at_quantile(0.5) as f64 / bare.value_at_quantile(0.5) as f64
}

fn us(ns: u64) -> f64 {
    ns as f64 / 1000.0
}

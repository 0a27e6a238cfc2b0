//! Measures distributions instead of means: every batch is one sample.

use std::hint::black_box;
use std::time::Instant;

use hdrhistogram::Histogram;

/// Times `work` in batches of `batch` calls after a warm-up and prints its distribution per call, in `unit` ns.
pub fn measure(
    name: &str,
    yardstick: &str,
    samples: u32,
    batch: u32,
    mut work: impl FnMut(),
) -> Histogram<u64> {
    let mut histogram = Histogram::<u64>::new(3).expect("three digits are possible");
    for _ in 0..samples / 10 {
        work();
    }
    for _ in 0..samples {
        let start = Instant::now();
        for _ in 0..batch {
            black_box(&mut work)();
        }
        let picoseconds = start.elapsed().as_nanos() as u64 * 1000 / u64::from(batch);
        histogram.record(picoseconds).expect("the histogram resizes itself");
    }
    let us = |quantile: f64| histogram.value_at_quantile(quantile) as f64 * 1e-6;
    println!(
        "{name:<44} p50 {:>9.3}  p99 {:>9.3}  p99.9 {:>9.3}  max {:>9.3} us   {yardstick}",
        us(0.5),
        us(0.99),
        us(0.999),
        histogram.max() as f64 * 1e-6
    );
    histogram
}

/// Prints one line about the machine of the figures.
pub fn machine() {
    let machine = freeplay_shm::Machine::read();
    println!("machine: {}, {} cores, {}", machine.cpu, machine.cores, machine.kernel);
}

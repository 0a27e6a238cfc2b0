//! Time of the learned remainder of a weight file in a tick: `cargo run --release -p freeplay-controller --example remainder_timing -- WEIGHTS`.
//!
//! Along the paper's path, after a warm-up: the whole answer (inputs, region, network), and the network alone; median and 99th percentile, ns.

use std::path::Path;
use std::time::Instant;

use freeplay_controller::compensation::Motion;
use freeplay_controller::{Remainder, WeightFile};
use freeplay_model::paper_arm;
use freeplay_path::{JointPath, PathSpec};

/// Calls timed together, because reading the clock takes 20 ns.
const TOGETHER: u64 = 20;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let name = std::env::args().nth(1).ok_or("name a weight file of the paper's arm")?;
    let file = WeightFile::load(Path::new(&name))?;
    let arm = paper_arm().arm;
    let path = JointPath::plan(&arm, &PathSpec::default(), 1000.0)?;
    let mut remainder = Remainder::new(&file, &arm, 1e-3)?;
    let narx = file.narx()?;
    let mut scratch = narx.network().scratch();
    let x = vec![0.1; narx.network().inputs()];
    let [mut q, mut v, mut a] = [vec![0.0; 6], vec![0.0; 6], vec![0.0; 6]];
    let (mut whole, mut network, mut sum) = (Vec::new(), Vec::new(), 0.0);
    for tick in 0..6000_u64 {
        path.at(tick as f64 * 1e-3, &mut q, &mut v, &mut a);
        let begun = Instant::now();
        for call in 0..TOGETHER {
            sum += remainder.at(tick * TOGETHER + call, Motion { q: &q, v: &v, a: &a }).x;
        }
        whole.push(begun.elapsed().as_nanos() as f64 / TOGETHER as f64);
        let begun = Instant::now();
        for _ in 0..TOGETHER {
            sum += narx.network().forward(&x, &mut scratch)[0];
        }
        network.push(begun.elapsed().as_nanos() as f64 / TOGETHER as f64);
    }
    for (what, times) in [("inputs, region and network", &mut whole), ("network alone", &mut network)] {
        times.sort_by(f64::total_cmp);
        let at = |share: f64| times[(share * (times.len() - 1) as f64) as usize];
        println!("{what}: p50 {:.0} ns, p99 {:.0} ns", at(0.5), at(0.99));
    }
    println!("layers {:?}, sum {sum:e}", narx.network().sizes());
    Ok(())
}

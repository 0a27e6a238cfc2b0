//! Independent streams of random numbers from one seed, so that draws for one purpose never shift those for another.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// The stream of `seed` for `purpose`.
pub(crate) fn stream(seed: u64, purpose: &str) -> ChaCha8Rng {
    // FNV-1a (Fowler, Noll & Vo 1991): any good mixing of the name would do, but it must never change.
    let hash = purpose.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(hash);
    rng
}

/// A random number with the standard normal distribution.
pub(crate) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// A random number between `low` and `high`, both above zero, log-uniform.
pub(crate) fn log_uniform(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    uniform(rng, low.ln(), high.ln()).exp()
}

/// A random number between `low` and `high`, uniform.
pub(crate) fn uniform(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    use rand::RngExt;
    low + (high - low) * rng.random::<f64>()
}

/// −1 or 1.
pub(crate) fn sign(rng: &mut ChaCha8Rng) -> f64 {
    if uniform(rng, 0.0, 1.0) < 0.5 { -1.0 } else { 1.0 }
}

/// One of `items`, which must not be empty.
pub(crate) fn pick<T: Copy>(rng: &mut ChaCha8Rng, items: &[T]) -> T {
    let index = (uniform(rng, 0.0, 1.0) * items.len() as f64) as usize;
    items[index.min(items.len() - 1)]
}

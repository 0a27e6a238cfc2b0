//! The same work for many cases, on several cores.

use std::thread::Builder;

use crate::exit::Failure;

/// Calls `work` with every number below `count` on all cores; returns the results in that order.
///
/// # Errors
/// The first failure; some of the other calls may be missing then.
pub fn on_all_cores<T: Send>(
    count: usize,
    work: impl Fn(usize) -> Result<T, Failure> + Sync,
) -> Result<Vec<T>, Failure> {
    on_cores(std::thread::available_parallelism().map_or(1, usize::from), count, work)
}

/// As [`on_all_cores`], with `workers` calls at a time.
///
/// # Errors
/// As [`on_all_cores`].
pub fn on_cores<T: Send>(
    workers: usize,
    count: usize,
    work: impl Fn(usize) -> Result<T, Failure> + Sync,
) -> Result<Vec<T>, Failure> {
    let next = std::sync::atomic::AtomicUsize::new(0);
    let workers = workers.clamp(1, count.max(1));
    let done: Vec<Result<Vec<(usize, T)>, Failure>> = std::thread::scope(|scope| {
        let take = || {
            let mut mine = Vec::new();
            loop {
                let index = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                if index >= count {
                    return Ok(mine);
                }
                mine.push((index, work(index)?));
            }
        };
        // This thread is one of the workers: if the system has no threads left, it does all the work.
        let threads: Vec<_> =
            (1..workers).map_while(|_| Builder::new().spawn_scoped(scope, take).ok()).collect();
        let own = take();
        let lost = || Err(Failure::internal("a thread of the simulation failed; its message is above"));
        let others = threads.into_iter().map(|thread| thread.join().unwrap_or_else(|_| lost()));
        std::iter::once(own).chain(others).collect()
    });
    let mut all = Vec::with_capacity(count);
    for results in done {
        all.extend(results?);
    }
    all.sort_by_key(|(index, _)| *index);
    Ok(all.into_iter().map(|(_, result)| result).collect())
}

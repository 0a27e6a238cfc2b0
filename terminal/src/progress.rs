//! Progress of a long command: on a terminal one line, rewritten from the start; otherwise a plain line from time to time.

use std::fmt::Write;
use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressState, ProgressStyle};

use crate::flags::is_quiet;
use crate::output::tell;
use crate::step_line;

/// Time between two updates of the rewritten line.
const PICTURE: Duration = Duration::from_millis(200);
/// Time between two plain lines.
const LINE: Duration = Duration::from_secs(10);

/// A bar on standard error up to `length`, in the form of the `template` of `indicatif`, followed by the remaining time.
pub fn bar(length: u64, template: &str) -> ProgressBar {
    dressed(ProgressBar::new(length), &format!("{template}{{left}}"), left)
}

/// A line with `words` for work that takes `seconds` of real time.
pub fn clock(words: String, seconds: f64) -> ProgressBar {
    let told = move |state: &ProgressState, out: &mut dyn Write| {
        let passed = state.elapsed().as_secs_f64();
        // A failed write is ignored.
        let _ = write!(out, "{passed:.0} s, {} left", in_words(seconds - passed));
    };
    dressed(ProgressBar::new_spinner(), "{spinner} {msg} {left}", told).with_message(words)
}

/// Shows `words` in the rewritten line as the present work; true if there is a terminal for it.
pub fn step(words: &str) -> bool {
    if is_quiet() || !std::io::stderr().is_terminal() {
        return false;
    }
    let spinner = || dressed(ProgressBar::new_spinner(), "{spinner} {elapsed} {msg}", |_, _| {});
    step_line::show(words, spinner)
}

fn dressed(
    bar: ProgressBar,
    template: &str,
    left: impl Fn(&ProgressState, &mut dyn Write) + Clone + Send + Sync + 'static,
) -> ProgressBar {
    if is_quiet() {
        return ProgressBar::hidden();
    }
    let bar = match ProgressStyle::with_template(template) {
        Ok(style) => bar.with_style(style.with_key("left", left)),
        Err(_) => bar,
    };
    if bar.is_hidden() {
        tell_now_and_then(&bar);
    } else {
        bar.enable_steady_tick(PICTURE);
    }
    bar
}

/// The remaining time of a bar, once there is an estimate.
fn left(state: &ProgressState, out: &mut dyn Write) {
    if let Some(length) = state.len().filter(|length| (1..*length).contains(&state.pos())) {
        // A failed write is ignored.
        let _ = write!(out, ", about {} left", time_left(state.elapsed(), state.pos(), length));
    }
}

/// The remaining time, in words, for `length` steps of which `done` took the time `passed`. Steps of a campaign take minutes: a moving mean would rise during a
/// step.
fn time_left(passed: Duration, done: u64, length: u64) -> String {
    in_words(passed.as_secs_f64() * (length - done.min(length)) as f64 / done.max(1) as f64)
}

/// `seconds` in units for people.
fn in_words(seconds: f64) -> String {
    match seconds.max(0.0) {
        short if short < 100.0 => format!("{short:.0} s"),
        long if long < 100.0 * 60.0 => format!("{:.0} min", long / 60.0),
        long => format!("{:.1} h", long / 3600.0),
    }
}

/// Prints the progress of `bar` in plain lines until it ends.
fn tell_now_and_then(bar: &ProgressBar) {
    let bar = bar.downgrade();
    let lines = move || {
        let mut said = String::new();
        loop {
            std::thread::sleep(LINE);
            let Some(bar) = bar.upgrade().filter(|bar| !bar.is_finished()) else { return };
            if let Some(line) = news(&mut said, plain(&bar)) {
                tell(line);
            }
        }
    };
    // Without the thread these lines are missing, but nothing else.
    let _ = std::thread::Builder::new().name("progress".to_owned()).spawn(lines);
}

/// The `line`, unless it equals the last one, `said`: a command may make no progress for minutes.
fn news(said: &mut String, line: String) -> Option<&str> {
    if *said == line {
        return None;
    }
    *said = line;
    Some(said)
}

/// The progress of `bar`, in a line.
fn plain(bar: &ProgressBar) -> String {
    let passed = in_words(bar.elapsed().as_secs_f64());
    let words =
        Some(bar.message()).filter(|words| !words.is_empty()).map_or_else(String::new, |words| words + ": ");
    match bar.length().filter(|_| bar.position() > 0) {
        Some(length) => format!(
            "{words}{} of {length} after {passed}, about {} left",
            bar.position(),
            time_left(bar.elapsed(), bar.position(), length)
        ),
        None => format!("{words}{passed} so far"),
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::{bar, in_words, news, plain, time_left};

    #[test]
    fn a_plain_line_says_how_far_it_is() {
        let bar = bar(40, "{msg} {wide_bar}").with_message("cells");
        assert!(plain(&bar).starts_with("cells: ") && plain(&bar).ends_with(" so far"));
        bar.set_position(10);
        let line = plain(&bar);
        assert!(line.starts_with("cells: 10 of 40 after ") && line.ends_with(" left"), "{line}");
    }

    #[test]
    fn the_same_line_is_said_once() {
        let mut said = String::new();
        let lines = ["90 s so far", "2 min so far", "2 min so far", "3 min so far"];
        let told: Vec<bool> = lines.map(|line| news(&mut said, line.to_owned()).is_some()).to_vec();
        assert_eq!(told, [true, true, false, true]);
    }

    #[test]
    fn times_are_said_as_people_count_them() {
        assert_eq!([3.4, 99.0, 600.0, 36e3].map(in_words), ["3 s", "99 s", "10 min", "10.0 h"]);
        assert_eq!(in_words(-1.0), "0 s");
        assert_eq!(time_left(Duration::from_secs(300), 2, 12), "25 min");
    }
}

//! How far a long command is: one line that is rewritten on a terminal, from the first moment on; where there is none, a plain line now and then.

use std::fmt::Write;
use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressState, ProgressStyle};

use crate::flags::is_quiet;
use crate::output::tell;
use crate::step_line;

/// Time between two pictures of a line that is rewritten.
const PICTURE: Duration = Duration::from_millis(200);
/// Time between two plain lines.
const LINE: Duration = Duration::from_secs(10);

/// A bar on standard error up to `length`, which looks as the `template` of `indicatif` says, with the time left behind it.
pub fn bar(length: u64, template: &str) -> ProgressBar {
    dressed(ProgressBar::new(length), &format!("{template}{{left}}"), left)
}

/// A line with `words` for what takes `seconds` by the clock.
pub fn clock(words: String, seconds: f64) -> ProgressBar {
    let told = move |state: &ProgressState, out: &mut dyn Write| {
        let passed = state.elapsed().as_secs_f64();
        // A line that can't be written is not shown.
        let _ = write!(out, "{passed:.0} s, {} left", in_words(seconds - passed));
    };
    dressed(ProgressBar::new_spinner(), "{spinner} {msg} {left}", told).with_message(words)
}

/// Says in the line that is rewritten that `words` is being done; whether there is a terminal for it.
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

/// The time left behind a bar, once there is something to tell it from.
fn left(state: &ProgressState, out: &mut dyn Write) {
    if let Some(length) = state.len().filter(|length| (1..*length).contains(&state.pos())) {
        // A line that can't be written is not shown.
        let _ = write!(out, ", about {} left", time_left(state.elapsed(), state.pos(), length));
    }
}

/// The time left of `length` steps of which `done` took the time `passed`, in words. Steps of a campaign take minutes: a mean that forgets would rise while one lasts.
fn time_left(passed: Duration, done: u64, length: u64) -> String {
    in_words(passed.as_secs_f64() * (length - done.min(length)) as f64 / done.max(1) as f64)
}

/// `seconds` as a person counts them.
fn in_words(seconds: f64) -> String {
    match seconds.max(0.0) {
        short if short < 100.0 => format!("{short:.0} s"),
        long if long < 100.0 * 60.0 => format!("{:.0} min", long / 60.0),
        long => format!("{:.1} h", long / 3600.0),
    }
}

/// Tells in plain lines how far `bar` is, for as long as it lasts.
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
    // Without a thread there are no such lines, and nothing else is lost.
    let _ = std::thread::Builder::new().name("progress".to_owned()).spawn(lines);
}

/// The `line`, unless it is the one that was `said` last: in minutes, a command gets no further for a while.
fn news(said: &mut String, line: String) -> Option<&str> {
    if *said == line {
        return None;
    }
    *said = line;
    Some(said)
}

/// How far `bar` is, in a line.
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

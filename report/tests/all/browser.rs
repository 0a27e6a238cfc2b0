//! The page in a real browser: every chart is drawn, there are no error messages, nothing exceeds the width of 360 pixels. Without a browser on the path, or
//! with one that does not answer in time, this test reports that it skips.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::every_block;

const BROWSERS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];
const PATIENCE: Duration = Duration::from_secs(30);
const VISITS: usize = 3;

/// Runs in the page under test: waits for its charts, plays the film, points at the first chart, drags across it, and writes down the results. The page's own
/// time runs ahead of the drawn frames, so that the probe checks each condition many times, each with a short wait in real time.
const PROBE: &str = r#"<script>(async () => {
  const note = document.documentElement.dataset;
  const look = () => new Promise(seen => setTimeout(() => {
    for (let k = 0, sum = 0; k < 3e7; k++) sum += k;
    seen();
  }, 50));
  const until = async (holds, looks = 60) => {
    for (; !holds() && looks > 0; looks--) await look();
    return holds();
  };
  try {
    const charts = () => document.querySelectorAll(".uplot canvas").length;
    await until(() => charts() >= 2);
    note.charts = charts();
    const page = document.documentElement, excess = () => page.scrollWidth - page.clientWidth;
    await until(() => excess() === 0);
    note.excess = excess();
    const film = document.querySelector("figure.film");
    const [button, speed, clock] = ["button", "select", "output"].map(tag => film.querySelector(tag)), before = clock.textContent;
    const chart = document.querySelector(".uplot"), over = chart.querySelector(".u-over");
    const point = (type, share) => {
      const box = over.getBoundingClientRect();
      over.dispatchEvent(new MouseEvent(type, {
        bubbles: true, button: 0, movementX: 1, clientX: box.left + share * box.width, clientY: box.top + box.height / 2,
      }));
    };
    const legend = chart.querySelector(".u-legend"), values = legend.textContent;
    const canvas = chart.querySelector("canvas"), picture = canvas.toDataURL();
    speed.value = "1";
    button.click();
    note.button = button.textContent;
    note.frames = 0;
    requestAnimationFrame(function count() { note.frames = +note.frames + 1; requestAnimationFrame(count); });
    ["mouseenter", "mousemove"].forEach(type => point(type, 0.5));
    note.played = await until(() => clock.textContent !== before);
    note.hovered = await until(() => legend.textContent !== values);
    button.click();
    note.stopped = button.textContent;
    point("mousedown", 0.3);
    point("mousemove", 0.6);
    point("mouseup", 0.6);
    note.zoomed = await until(() => canvas.toDataURL() !== picture);
  } catch (error) {
    note.error = error;
  }
  note.done = true;
})()</script>"#;

#[test]
fn charts_are_drawn_without_complaint() {
    let Some(browser) = browser() else {
        freeplay_skip::skip(
            freeplay_skip::Need::Browser,
            format_args!("no browser on the path ({})", BROWSERS.join(", ")),
        );
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.html");
    let page = every_block("a name </script> as long as names of controllers and joints tend to be");
    std::fs::write(&path, page.to_html() + PROBE).unwrap();
    // On a busy machine a browser may return the page before the probe has finished.
    let seen = (0..VISITS).find_map(|_| visit(&browser, &path, folder.path()));
    let Some((dom, log)) = seen else {
        freeplay_skip::skip(
            freeplay_skip::Need::Browser,
            format_args!("{} was not through with the page in {VISITS} x {PATIENCE:?}", browser.display()),
        );
        return;
    };
    let noted = |name: &str| noted(&dom, name);
    assert_eq!(noted("error"), None, "the probe met an error\n{log}");
    assert!(!log.contains("CONSOLE"), "{log}");
    let drawn = noted("charts");
    println!("{} charts drawn by {}", drawn.unwrap_or("no"), browser.display());
    assert_eq!(drawn, Some("2"), "the third is folded away until it is opened\n{log}");
    assert_eq!(noted("excess"), Some("0"), "so many pixels stick out to the side");
    let frames = noted("frames").and_then(|count| count.parse::<u32>().ok());
    if frames.is_none_or(|count| count < 3) {
        freeplay_skip::skip(
            freeplay_skip::Need::Browser,
            format_args!("{} drew no frames for the film to play in", browser.display()),
        );
        return;
    }
    let film = ["button", "played", "stopped"].map(|name| noted(name).unwrap_or_default());
    assert_eq!(film, ["Pause", "true", "Play"], "the film does not play");
    assert_eq!(noted("hovered"), Some("true"), "no values where the pointer is");
    assert_eq!(noted("zoomed"), Some("true"), "dragging does not zoom");
}

/// The result that the probe noted under `name` in `dom`.
fn noted<'a>(dom: &'a str, name: &str) -> Option<&'a str> {
    dom.split_once(&format!("data-{name}=\""))?.1.split('"').next()
}

fn browser() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    BROWSERS
        .iter()
        .find_map(|name| folders.iter().map(|folder| folder.join(name)).find(|file| file.is_file()))
}

/// The document in the browser after the probe, and its log; `None` if it does not answer or the probe has not finished.
fn visit(browser: &Path, page: &Path, folder: &Path) -> Option<(String, String)> {
    let (dom, log) = (folder.join("dom"), folder.join("log"));
    let mut child = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-quic",
            "--no-first-run",
            "--disable-sync",
        ])
        .args(["--disable-background-networking", "--disable-component-update", "--enable-logging=stderr"])
        .args(["--window-size=360,800", "--virtual-time-budget=30000", "--dump-dom"])
        .arg(format!("--user-data-dir={}", folder.join("profile").display()))
        .arg(format!("file://{}", page.display()))
        .stdout(File::create(&dom).unwrap())
        .stderr(File::create(&log).unwrap())
        .stdin(Stdio::null())
        .spawn()
        .ok()?;
    let start = Instant::now();
    while start.elapsed() < PATIENCE {
        if child.try_wait().unwrap().is_some() {
            let read = |file| String::from_utf8_lossy(&std::fs::read(file).unwrap()).into_owned();
            return Some((read(&dom), read(&log))).filter(|(dom, _)| noted(dom, "done").is_some());
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    None
}

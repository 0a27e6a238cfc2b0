//! The page in a real browser: every chart is drawn, nothing is complained of, nothing sticks out at 360 pixels.
//! Without a browser on the path, or with one that does not answer in time, this test says that it skips.

#![allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]

mod common;

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use common::every_block;

const BROWSERS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];
const PATIENCE: Duration = Duration::from_secs(15);

/// Runs in the page under test: plays the film, points at the first chart, drags across it, and writes down what came of it and how wide the content is beside
/// the window.
const PROBE: &str = r#"<script>setTimeout(() => {
  const note = document.documentElement.dataset, film = document.querySelector("figure.film");
  const [button, speed, clock] = ["button", "select", "output"].map(tag => film.querySelector(tag)), before = clock.textContent;
  const chart = document.querySelector(".uplot"), over = chart.querySelector(".u-over"), box = over.getBoundingClientRect();
  const point = (type, share) => over.dispatchEvent(new MouseEvent(type, {
    bubbles: true, button: 0, movementX: 1, clientX: box.left + share * box.width, clientY: box.top + box.height / 2,
  }));
  note.excess = document.documentElement.scrollWidth - document.documentElement.clientWidth;
  const legend = chart.querySelector(".u-legend"), values = legend.textContent;
  const canvas = chart.querySelector("canvas"), picture = canvas.toDataURL();
  speed.value = "1";
  button.click();
  note.button = button.textContent;
  note.frames = 0;
  requestAnimationFrame(function count() { note.frames = +note.frames + 1; requestAnimationFrame(count); });
  ["mouseenter", "mousemove"].forEach(type => point(type, 0.5));
  // The page's own time runs ahead of the frames that are drawn: the film gets a hundred looks, each with a while of real time.
  const watch = looks => setTimeout(() => {
    for (let k = 0, sum = 0; k < 3e7; k++) sum += k;
    note.played = clock.textContent !== before;
    if (note.played === "false" && looks > 0) return watch(looks - 1);
    note.hovered = legend.textContent !== values;
    button.click();
    note.stopped = button.textContent;
    point("mousedown", 0.3);
    point("mousemove", 0.6);
    point("mouseup", 0.6);
    setTimeout(() => { note.zoomed = canvas.toDataURL() !== picture; }, 300);
  }, 100);
  watch(100);
}, 500)</script>"#;

#[test]
fn charts_are_drawn_without_complaint() {
    let Some(browser) = browser() else {
        println!("skipped: no browser on the path ({})", BROWSERS.join(", "));
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.html");
    let page = every_block("a name </script> as long as names of controllers and joints tend to be");
    std::fs::write(&path, page.to_html() + PROBE).unwrap();
    let charts = |dom: &str| dom.matches("class=\"u-wrap\"").count();
    let mut seen = visit(&browser, &path, folder.path());
    // On a busy machine a browser may hand the page over before it has drawn a frame.
    for _ in 0..2 {
        if seen.as_ref().is_some_and(|(dom, _)| charts(dom) == 0) {
            seen = visit(&browser, &path, folder.path());
        }
    }
    let Some((dom, log)) = seen else {
        println!("skipped: {} did not answer in {PATIENCE:?}", browser.display());
        return;
    };
    let drawn = charts(&dom);
    println!("{drawn} charts drawn by {}", browser.display());
    assert_eq!(drawn, 2, "the third is folded away until it is opened\n{log}");
    assert!(dom.contains("data-excess=\"0\""), "the page scrolls sideways");
    assert!(!log.contains("CONSOLE"), "{log}");
    let noted = |name: &str| {
        let rest = dom.split(&format!("data-{name}=\"")).nth(1).unwrap_or_default();
        rest.split('"').next().unwrap_or_default().to_owned()
    };
    if noted("frames").parse::<u32>().unwrap_or(0) < 3 {
        println!("skipped: {} drew no frames for the film to play in", browser.display());
        return;
    }
    assert_eq!(
        ["button", "played", "stopped"].map(noted),
        ["Pause", "true", "Play"],
        "the film does not play"
    );
    assert_eq!(noted("hovered"), "true", "no values where the pointer is");
    assert_eq!(noted("zoomed"), "true", "dragging does not zoom");
}

fn browser() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    BROWSERS
        .iter()
        .find_map(|name| folders.iter().map(|folder| folder.join(name)).find(|file| file.is_file()))
}

/// The document as the browser has it after its scripts, and what it logged; none when it does not answer.
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
        .args(["--window-size=360,800", "--virtual-time-budget=12000", "--dump-dom"])
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
            return Some((read(&dom), read(&log))).filter(|(dom, _)| dom.contains("</html>"));
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    None
}

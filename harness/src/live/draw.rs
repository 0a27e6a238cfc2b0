//! Drawing of the live view.

use freeplay_plant::Applied;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::canvas::{Canvas, Circle, Points};
use ratatui::widgets::{
    Axis, Block, Chart, Dataset, Gauge, GraphType, List, ListItem, Paragraph, Row, Table,
};

use freeplay_terminal::layout::wrapped;

use super::dashboard::millimetres;
use super::keys::HELP;
use super::{ContactMode, ControllerState, Dashboard, LiveSnapshot};

/// Least width of a wrapped event, characters.
const LEAST_EVENT_WIDTH: usize = 24;
/// Length of the displayed trace, s.
const WINDOW: f64 = 6.0;

/// Draws `board`. `colours` is optional, because the text repeats everything that colours show.
pub fn draw(frame: &mut Frame, board: &Dashboard, colours: bool) {
    let ink = Ink { colours };
    let plays = board.title.plays.len().max(1) as u16;
    let [head, bar, trace, middle, foot, help] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Length(1),
        Constraint::Min(7),
        Constraint::Length(if frame.area().height < 30 { 8 } else { 11 }),
        Constraint::Length(8),
        Constraint::Length(1),
    ])
    .areas(frame.area());
    frame.render_widget(Line::from(board.title.words.as_str()).style(ink.bold()), head);
    progress(frame, board, bar, ink);
    deviation(frame, board, trace, ink);
    let [contact, controllers] =
        Layout::horizontal([Constraint::Length((24 * plays).max(30)), Constraint::Min(30)]).areas(middle);
    contacts(frame, board, contact, ink);
    line_up(frame, board, controllers, ink);
    let [latencies, events] = Layout::horizontal([Constraint::Length(56), Constraint::Min(24)]).areas(foot);
    stages(frame, board.now.as_ref(), latencies, ink);
    happenings(frame, board, events);
    let line = match board.waits() {
        Some(words) => Line::from(format!("{words} · q quit")).style(ink.of(Color::Yellow)),
        None => Line::from(HELP).style(ink.dim()),
    };
    frame.render_widget(line, help);
}

/// Switch for colours.
#[derive(Clone, Copy)]
struct Ink {
    colours: bool,
}

impl Ink {
    fn of(self, colour: Color) -> Style {
        if self.colours { Style::new().fg(colour) } else { Style::new() }
    }

    fn bold(self) -> Style {
        Style::new().add_modifier(Modifier::BOLD)
    }

    fn dim(self) -> Style {
        Style::new().add_modifier(Modifier::DIM)
    }

    fn mode(self, mode: ContactMode) -> Style {
        match mode {
            ContactMode::Free => self.of(Color::Yellow),
            ContactMode::Impact => self.of(Color::Red).add_modifier(Modifier::BOLD),
            ContactMode::Continuous => self.of(Color::Green),
        }
    }
}

fn progress(frame: &mut Frame, board: &Dashboard, area: Rect, ink: Ink) {
    let (time, seconds) = (board.time(), board.title.seconds);
    let gauge = Gauge::default()
        .ratio((time / seconds).clamp(0.0, 1.0))
        .label(format!("{time:.2} s of {seconds:.2} s"))
        .gauge_style(ink.of(Color::Blue));
    frame.render_widget(gauge, area);
}

fn deviation(frame: &mut Frame, board: &Dashboard, area: Rect, ink: Ink) {
    let points: Vec<(f64, f64)> = board.trace.iter().map(|&(time, size)| (time, size * 1e3)).collect();
    let end = board.time().max(WINDOW);
    let seen = points.iter().filter(|(time, _)| *time >= end - WINDOW);
    let top = seen.map(|&(_, size)| size).fold(1e-4, f64::max) * 1.1;
    let [size, rms, max] = board
        .now
        .as_ref()
        .map_or([f64::NAN; 3], |now| [now.size(), now.rms_max[0], now.rms_max[1]])
        .map(millimetres);
    let title = format!(" tool deviation [mm]   now {size}   rms {rms}   max {max}   (after 0.5 s) ");
    let dataset = Dataset::default()
        .marker(Marker::Braille)
        .graph_type(GraphType::Line)
        .style(ink.of(Color::Cyan))
        .data(&points);
    let labels = |low: f64, high: f64, digits: usize| {
        [low, f64::midpoint(low, high), high].map(|value| Line::from(format!("{value:.digits$}")))
    };
    let chart = Chart::new(vec![dataset])
        .block(Block::bordered().title(title))
        .x_axis(Axis::default().bounds([end - WINDOW, end]).labels(labels(end - WINDOW, end, 1)))
        .y_axis(Axis::default().bounds([0.0, top]).labels(labels(0.0, top, if top < 0.1 { 4 } else { 2 })));
    frame.render_widget(chart, area);
}

fn contacts(frame: &mut Frame, board: &Dashboard, area: Rect, ink: Ink) {
    if board.title.plays.is_empty() {
        frame.render_widget(
            Paragraph::new("no joint has play").block(Block::bordered().title(" contact ")),
            area,
        );
        return;
    }
    let parts = Layout::horizontal(vec![Constraint::Fill(1); board.title.plays.len()]).split(area);
    for (index, (part, (joint, clearance))) in parts.iter().zip(&board.title.plays).enumerate() {
        let play = board.now.as_ref().and_then(|now| now.plays.get(index));
        let mode = play.map_or(ContactMode::Free, |play| play.mode);
        let block = Block::bordered()
            .title(Line::from(vec![
                Span::raw(format!(" {joint} ")),
                Span::styled(format!("{} ", mode.name()), ink.mode(mode)),
            ]))
            .title_bottom(play.map_or_else(String::new, |play| {
                let all = play.ticks.iter().sum::<u64>().max(1) as f64;
                let [free, impact, lasting] = play.ticks.map(|ticks| ticks as f64 / all * 100.0);
                format!(" {free:.1} / {impact:.1} / {lasting:.1} % ")
            }));
        let scaled = |&[x, y]: &[f64; 2]| (x / clearance, y / clearance);
        let orbit: Vec<(f64, f64)> = board.orbits[index].iter().map(scaled).collect();
        let last = orbit.last().copied();
        let canvas = Canvas::default()
            .block(block)
            .marker(Marker::Braille)
            .x_bounds([-2.2, 2.2])
            .y_bounds([-1.15, 1.15])
            .paint(move |context| {
                context.draw(&Circle { x: 0.0, y: 0.0, radius: 1.0, color: Color::DarkGray });
                context.draw(&Points { coords: &orbit, color: Color::Reset });
                if let Some((x, y)) = last {
                    context.print(x, y, Span::styled("●", ink.mode(mode)));
                }
            });
        frame.render_widget(canvas, *part);
    }
}

fn line_up(frame: &mut Frame, board: &Dashboard, area: Rect, ink: Ink) {
    let in_charge = board.now.as_ref().map(|now| now.in_charge);
    let items = board.title.controllers.iter().enumerate().map(|(slot, name)| {
        let leads = in_charge == Some(slot);
        let text = format!(
            "{} {}  {name}{}",
            if leads { "▶" } else { " " },
            slot + 1,
            match (board.controller_state(slot), leads) {
                (ControllerState::Ended, _) => "  ended",
                (ControllerState::Hangs, _) => "  hangs: no answer",
                (_, true) => "  active",
                (_, false) => "  standby",
            }
        );
        ListItem::new(text).style(if leads { ink.of(Color::Green).patch(ink.bold()) } else { Style::new() })
    });
    let mut items: Vec<ListItem> = items.collect();
    if let Some(now) = &board.now {
        let (words, colour) = match now.applied {
            Applied::Guided => ("guided along the reference", Color::Blue),
            Applied::Command => ("commands applied", Color::Green),
            Applied::Hold => ("last command held", Color::Yellow),
            Applied::Brake => ("brakes closed", Color::Red),
        };
        items.push(ListItem::new(""));
        items.push(ListItem::new(words).style(ink.of(colour)));
        let rejected: Vec<String> = now
            .rejected
            .iter()
            .map(|(reason, count)| format!("{} {count}", reason.replace('_', " ")))
            .collect();
        let rejected = if rejected.is_empty() { "nothing".to_owned() } else { rejected.join(", ") };
        items.push(ListItem::new(format!("rejected by the gate: {rejected}")));
    }
    frame.render_widget(List::new(items).block(Block::bordered().title(" controllers ")), area);
}

fn stages(frame: &mut Frame, now: Option<&LiveSnapshot>, area: Rect, ink: Ink) {
    let rows = now.into_iter().flat_map(|now| &now.stages).map(|stage| {
        let figures = stage.percentiles.iter().map(|us| format!("{us:>8.1}"));
        Row::new(std::iter::once(stage.stage.clone()).chain(figures))
    });
    let widths = [
        Constraint::Length(16),
        Constraint::Length(8),
        Constraint::Length(8),
        Constraint::Length(8),
        Constraint::Length(8),
    ];
    let head = ["", "     p50", "     p99", "   p99.9", "     max"];
    let table = Table::new(rows, widths)
        .header(Row::new(head).style(ink.dim()))
        .block(Block::bordered().title(" latencies [µs] "));
    frame.render_widget(table, area);
}

fn happenings(frame: &mut Frame, board: &Dashboard, area: Rect) {
    let room = usize::from(area.height.saturating_sub(2));
    let width = usize::from(area.width.saturating_sub(2)).max(LEAST_EVENT_WIDTH);
    let events = board.events.iter().map(|(time, event)| wrapped(&format!("{time:7.3} s  {event}"), width));
    let lines: Vec<String> =
        events.flat_map(|event| event.lines().map(str::to_owned).collect::<Vec<_>>()).collect();
    let skipped = lines.len().saturating_sub(room);
    let items = lines.into_iter().skip(skipped).map(ListItem::new);
    frame.render_widget(List::new(items).block(Block::bordered().title(" events ")), area);
}

#[cfg(test)]
mod tests {
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    use super::draw;
    use crate::live::dashboard::tests::{board, snapshot};

    fn picture(width: u16, height: u16, looks: u64) -> String {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        let mut board = board();
        (1..=looks).for_each(|look| board.add_snapshot(snapshot(look * 200)));
        terminal.draw(|frame| draw(frame, &board, true)).unwrap();
        terminal.backend().to_string()
    }

    #[test]
    fn what_matters_is_on_the_picture_at_the_usual_sizes() {
        for (width, height) in [(80, 24), (110, 36), (200, 60)] {
            let picture = picture(width, height, 10);
            for part in
                ["now 0.5000", "joint_5 impact", "20.0 / 10.0 / 70.0 %", "▶ 1  first", "31.5", "q quit"]
            {
                assert!(picture.contains(part), "{width}×{height}: no {part:?} in\n{picture}");
            }
        }
    }

    #[test]
    fn nothing_seen_yet_and_no_room_are_no_fault() {
        assert!(picture(80, 24, 0).contains("waiting"));
        for (width, height) in [(1, 1), (10, 3), (30, 12)] {
            picture(width, height, 3);
        }
    }
}

//! A page with every kind of block, for several tests.

use freeplay_report::{
    Axis, Block, Cell, Chart, Column, Document, Drawing, Figure, Film, Mark, Moving, Scene, Section, Series,
    Table, Verdict,
};

/// Every kind of block, with `text` as each text, with three charts that are drawn and one that is empty.
pub fn every_block(text: &str) -> Document {
    let word = || text.to_owned();
    let x = [0.0, 1.0, 2.0];
    let axis = || Axis::new(text, text);
    let trace = Chart::trace(text, axis(), axis())
        .series(Series::line(text, &x, &[1.0, f64::NAN, f64::INFINITY]))
        .series(Series::bars("bars", &x, &x).like(text))
        .mark(Mark::Span { from: 0.5, to: 1.0, label: word() })
        .mark(Mark::Level { y: 0.5, label: word() })
        .group(text)
        .in_view(0.0)
        .note(text);
    let plane = Chart::xy(text, axis(), axis())
        .equal_axes()
        .series(Series::circle("rim", (0.0, 0.0), 2.0))
        .series(Series::points(text, &x, &x[..2]));
    let percentiles = Chart::trace(text, Axis::percentile(text), Axis::log(text, text)).series(Series::step(
        text,
        &[0.0, 0.9, 0.99, 1.0],
        &[1.0, 2.0, 30.0, 31.0],
    ));
    let drawing = Drawing::new(text)
        .caption(text)
        .panel(
            Chart::trace(text, axis(), axis())
                .series(Series::line(text, &x, &[1.0, f64::NAN, 3.0]))
                .note(text),
        )
        .panel(plane.clone().mark(Mark::At { x: 0.0, label: word() }))
        .panel(Chart::trace(text, axis(), axis()));
    let empty = Chart::trace(text, axis(), axis()).series(Series::line(text, &[], &[]));
    let table = Table::new(text)
        .column(Column::text(text))
        .column(Column::number(text, text).group(text).lowest().bars())
        .row([Cell::series(text), 1.0.into()])
        .row([text.into(), Cell::uncertain(2.0, 0.1).judged(Verdict::Warn), "surplus".into()])
        .row([word().into(), Cell::verdict_in_words(Verdict::Info, text)])
        .note(text);
    let part = |trail| Moving {
        name: word(),
        frames: vec![vec![[0.0, 1.0]], vec![[f64::NAN, f64::INFINITY]], vec![[1.0, 0.5]]],
        trail,
    };
    let scene = Scene {
        title: word(),
        x: [0.0, 1.0],
        y: [0.0, 1.0],
        still: vec![(vec![[0.0, 0.0], [1.0, 1.0]], false)],
        moving: vec![part(0), part(2)],
        states: vec![word(), "rest".to_owned()],
        state: vec![0, 1, 0],
    };
    let mut film = Film::new(text, x.to_vec()).scene(scene);
    (film.caption, film.first) = (word(), 1);
    let figure = Figure::new(text, text, text).note(text).verdict(Verdict::Ok);
    Document::new(text)
        .subtitle(text)
        .overview((Verdict::Fail, text))
        .overview(Block::Figures(vec![figure]))
        .section(Section::new(text).with(text).with(Block::List(vec![word()])).with(table).with(trace))
        .section(
            Section::new(text)
                .with(Block::Heading(word()))
                .with(Block::Columns(vec![plane.into(), Block::Code(word())]))
                .with(Block::Details { summary: word(), blocks: vec![percentiles.into(), empty.into()] }),
        )
        .section(Section::new(text).with(drawing).with(film).with(Block::Judged {
            verdict: Verdict::Warn,
            word: word(),
            text: word(),
        }))
        .footer(text)
}

//! The same colour for the same name in the whole document.

use crate::chart::Chart;
use crate::document::{Block, Document};

/// Number of colours in the style sheet (`--series-0`, `--series-1`, …). Further names start again, dashed.
pub(crate) const PALETTE: usize = 8;

/// The names that have a colour, in reading order.
#[derive(Debug, Default)]
pub(crate) struct Colours<'a> {
    names: Vec<&'a str>,
}

impl<'a> Colours<'a> {
    /// Gives a colour to each name of a series in the document.
    pub(crate) fn of(document: &'a Document) -> Self {
        let mut colours = Self::default();
        let sections = document.sections.iter().flat_map(|section| &section.blocks);
        for block in document.overview.iter().chain(sections) {
            colours.collect(block);
        }
        colours
    }

    /// The index of a name; `None` for a name without a series.
    pub(crate) fn index(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|known| *known == name)
    }

    fn collect(&mut self, block: &'a Block) {
        match block {
            Block::Chart(chart) => self.collect_series(chart),
            Block::Drawing(drawing) => drawing.panels.iter().for_each(|panel| self.collect_series(panel)),
            Block::Film(film) => {
                let parts = film.scenes.iter().flat_map(|scene| &scene.moving);
                parts.for_each(|moving| self.add(&moving.name));
            }
            Block::Columns(blocks) | Block::Details { blocks, .. } => {
                for block in blocks {
                    self.collect(block);
                }
            }
            _ => {}
        }
    }

    fn collect_series(&mut self, chart: &'a Chart) {
        chart.series.iter().for_each(|series| self.add(series.colour_name()));
    }

    fn add(&mut self, name: &'a str) {
        if !name.is_empty() && !self.names.contains(&name) {
            self.names.push(name);
        }
    }
}

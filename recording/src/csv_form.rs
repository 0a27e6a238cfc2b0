//! The form of a text file with columns, detected from its first lines: separator, decimal sign, and the beginnings of header and data.

use crate::cells::{Cell, cell, unquote};

/// Number of lines, at the end of the head, from which the separator is detected.
const JUDGED: usize = 12;
/// Separators and decimal signs, the more usual first.
const FORMS: [(u8, u8); 8] = [
    (b',', b'.'),
    (b';', b'.'),
    (b'\t', b'.'),
    (b'|', b'.'),
    (b';', b','),
    (b'\t', b','),
    (b' ', b'.'),
    (b' ', b','),
];
/// First characters of comments.
const MARKS: [char; 2] = ['#', '%'];

/// The form as stated in a mapping.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct StatedForm {
    pub separator: Option<u8>,
    pub decimal: Option<u8>,
    /// Lines before the header.
    pub skip: Option<usize>,
}

/// The form of a text file.
#[derive(Debug, Clone)]
pub(crate) struct Form {
    /// Separator of the cells; repeated blanks count as one.
    pub separator: u8,
    /// Decimal sign.
    pub decimal: u8,
    /// The column names as written, empty for a column without a name; `None` for a file without a header.
    pub header: Option<Vec<String>>,
    /// Line of the header, or its place if it is missing, counted from 1.
    pub header_line: u64,
    /// Beginning of the data: byte, and line counted from 1.
    pub data: (usize, u64),
    /// Cells of the first line of data.
    pub first: Vec<String>,
}

/// A line of the head.
#[derive(Clone)]
struct Line {
    text: String,
    start: usize,
    number: u64,
}

impl Line {
    fn is_comment(&self) -> bool {
        self.text.trim_start_matches('\u{feff}').trim_start().starts_with(MARKS)
    }

    fn cells(&self, separator: u8) -> Vec<String> {
        split(&self.text, separator)
    }

    /// Number of cells with numbers, times or lists, and number of non-empty cells.
    fn data_cells(&self, (separator, decimal): (u8, u8)) -> (usize, usize) {
        let cells = self.cells(separator);
        let held = cells.iter().filter(|text| !text.is_empty());
        let is_data = |text: &&String| !matches!(cell(text.as_bytes(), decimal), Cell::Text | Cell::Words(_));
        (held.clone().filter(is_data).count(), held.count())
    }
}

impl Form {
    /// The form of a file that begins with `head`, complete lines but for the last; `None` if there are only blank lines and comments.
    pub fn of(head: &[u8], stated: StatedForm) -> Option<Self> {
        let all = lines(head);
        let lines = all.as_slice();
        let skip = stated.skip.unwrap_or(0).min(lines.len().saturating_sub(1));
        let lines = lines.get(skip..)?;
        let plain: Vec<Line> = lines.iter().filter(|line| !line.is_comment()).cloned().collect();
        let judged = &plain[plain.len().saturating_sub(JUDGED)..];
        let form = chosen(judged, stated).or_else(|| chosen(lines, stated))?;
        let typical = judged.iter().map(|line| line.data_cells(form).0).max().unwrap_or(0);
        let is_data = |line: &Line| typical > 0 && 2 * line.data_cells(form).0 >= typical.max(2);
        let is_header_told =
            stated.skip.is_some() && lines.first().is_some_and(|line| !is_data(line) || lines.len() == 1);
        let data =
            plain.iter().find(|line| is_data(line) && !(is_header_told && line.number == lines[0].number));
        let first = data.map(|line| line.cells(form.0)).unwrap_or_default();
        let above: Vec<Line> =
            lines.iter().filter(|line| data.is_none_or(|data| line.number < data.number)).cloned().collect();
        let header = if is_header_told { lines.first() } else { above.last() };
        let names = header.and_then(|line| names_of(line, &above, form.0, first.len(), is_header_told));
        let end = lines.last().map_or((head.len(), 1), |line| (head.len(), line.number + 1));
        Some(Self {
            separator: form.0,
            decimal: form.1,
            header_line: header.map_or_else(|| data.map_or(1, |line| line.number), |line| line.number),
            data: data.map_or(end, |line| (line.start, line.number)),
            header: names,
            first,
        })
    }
}

/// The separator and decimal sign with which `lines` have most numbers; a mapping overrides the detection.
fn chosen(lines: &[Line], stated: StatedForm) -> Option<(u8, u8)> {
    lines.first()?;
    let mut forms: Vec<(u8, u8)> = FORMS.to_vec();
    if let Some(separator) = stated.separator {
        forms = [(separator, b'.'), (separator, b',')].into();
    }
    if let Some(decimal) = stated.decimal {
        forms.iter_mut().for_each(|form| form.1 = decimal);
        forms.retain(|form| form.0 != form.1);
    }
    let score = |form: (u8, u8)| {
        let counts = lines.iter().map(|line| line.data_cells(form)).filter(|(data, _)| *data > 0);
        let (data, held) = counts.fold((0, 0), |sum, (data, held)| (sum.0 + data, sum.1 + held));
        let cells: usize = lines.iter().map(|line| line.cells(form.0).len()).sum();
        // Prefers many cells, nearly all of them numbers; without numbers, many names.
        let share = data as f64 / held.max(1) as f64;
        (share * data as f64, cells)
    };
    let mut best: Option<((f64, usize), (u8, u8))> = None;
    for form in forms {
        let score = score(form);
        if best.is_none_or(|(best, _)| score > best) {
            best = Some((score, form));
        }
    }
    best.map(|(_, form)| form)
}

/// The names in the line `header` for data of `cells` cells; a line of units below the names is joined with them.
fn names_of(
    header: &Line,
    above: &[Line],
    separator: u8,
    cells: usize,
    is_told: bool,
) -> Option<Vec<String>> {
    let names = cells_of_header(header, separator, cells);
    let before = above.iter().rev().nth(1).map(|line| cells_of_header(line, separator, cells));
    if let Some(before) = before.filter(|before| !is_told && before.len() == names.len() && names.len() > 1)
        && names.iter().all(|name| name.is_empty() || is_unit(name))
        && before.iter().any(|name| !name.is_empty() && !is_unit(name))
    {
        let joined = before.iter().zip(&names).map(|(name, unit)| {
            let unit = unit.trim_matches(['[', ']', '(', ')']);
            if unit.is_empty() || unit == "-" { name.clone() } else { format!("{name} [{unit}]") }
        });
        return Some(joined.collect());
    }
    // A sentence above the data is no header: a header has a name for every column, or for all but an index.
    let is_near = names.len() + 1 >= cells && names.len() <= cells + 1;
    let is_fit = if header.is_comment() { names.len() == cells } else { is_near };
    (is_told || cells == 0 || is_fit).then_some(names)
}

/// The cells of a header; a header in a comment may have another separator than the data.
fn cells_of_header(header: &Line, separator: u8, cells: usize) -> Vec<String> {
    if !header.is_comment() {
        return split(&header.text, separator);
    }
    let text = header.text.trim_start_matches('\u{feff}').trim_start().trim_start_matches(MARKS).trim();
    let own = split(text, separator);
    if own.len() == cells || cells == 0 {
        return own;
    }
    let others = [b',', b';', b'\t'].map(|other| split(text, other));
    // Every sentence has blanks.
    let words = split(text, b' ');
    let is_time = |name: &String| name == "t" || name.to_lowercase().starts_with("time");
    let words = Some(words).filter(|words| words.iter().any(is_time));
    others.into_iter().chain(words).find(|names| names.len() == cells).unwrap_or(own)
}

fn is_unit(text: &str) -> bool {
    let text = text.trim_matches(['[', ']', '(', ')']);
    text == "-" || crate::units::Unit::of(text).is_some()
}

/// The cells of one line, without the spaces and quotes around them.
fn split(line: &str, separator: u8) -> Vec<String> {
    let separator = char::from(separator);
    if separator == ' ' {
        return line.split_whitespace().map(|text| unquote(text).to_owned()).collect();
    }
    let mut cells = vec![String::new()];
    let mut quoted = false;
    for c in line.chars() {
        if c == separator && !quoted {
            cells.push(String::new());
            continue;
        }
        if let Some(cell) = cells.last_mut() {
            quoted ^= c == '"' && (quoted || cell.trim_start_matches('\u{feff}').trim().is_empty());
            cell.push(c);
        }
    }
    let plain = |text: &String| {
        let plain = unquote(text);
        // A quote inside quotes is doubled.
        if text.contains("\"\"") { plain.replace("\"\"", "\"") } else { plain.to_owned() }
    };
    cells.iter().map(plain).collect()
}

/// The lines of `head` that are not blank.
fn lines(head: &[u8]) -> Vec<Line> {
    let mut lines = Vec::new();
    let (mut start, mut number) = (0, 1);
    while start < head.len() {
        let end =
            head[start..].iter().position(|c| matches!(c, b'\n' | b'\r')).map_or(head.len(), |k| start + k);
        let text = text(&head[start..end]);
        if !text.trim_matches(|c: char| c.is_whitespace() || c == '\u{feff}').is_empty() {
            lines.push(Line { text, start, number });
        }
        start = end + if head[end..].starts_with(b"\r\n") { 2 } else { 1 };
        number += 1;
    }
    lines
}

/// A text in UTF-8, or else in Latin 1, as a Windows program writes a `°`.
pub(crate) fn text(bytes: &[u8]) -> String {
    std::str::from_utf8(bytes)
        .map_or_else(|_| bytes.iter().map(|&byte| char::from(byte)).collect(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::{Form, StatedForm};

    /// Separator, decimal sign, names, first line of data.
    fn form(text: &str) -> (char, char, Option<String>, u64) {
        let form = Form::of(text.as_bytes(), StatedForm::default()).expect("a form");
        let names = form.header.map(|names| names.join("|"));
        (char::from(form.separator), char::from(form.decimal), names, form.data.1)
    }

    #[test]
    fn forms_are_told_by_the_numbers_that_they_give() {
        let names = |text: &str| Some(text.to_owned());
        let cases = [
            ("t,q1\n0,1\n1,2\n", (',', '.', names("t|q1"), 2)),
            ("t;q1\n0;1\n1;2\n", (';', '.', names("t|q1"), 2)),
            ("t;q1\n0,5;1,5\n", (';', ',', names("t|q1"), 2)),
            ("t\tq1\n0,5\t1\n", ('\t', ',', names("t|q1"), 2)),
            ("# t q1 q2\n 0.5   1 2\n", (' ', '.', names("t|q1|q2"), 2)),
            ("%time,field.q0\n1,2\n", (',', '.', names("time|field.q0"), 2)),
            ("# made by hand, on a Monday\n# cell 7\nt,q1\n\n0,1\n", (',', '.', names("t|q1"), 5)),
            ("Log of cell 7\nTime;J1\nms;deg\n0;1,5\n", (';', ',', names("Time [ms]|J1 [deg]"), 4)),
            ("0,1,2\n1,2,3\n", (',', '.', None, 1)),
            ("# no names here\n0,1,2\n1,2,3\n", (',', '.', None, 2)),
            (",t,q1\n0,0.0,1\n", (',', '.', names("|t|q1"), 2)),
            ("t,q1\n2024-11-20 10:00:00.5,1\n", (',', '.', names("t|q1"), 2)),
            ("t,q1\n", (',', '.', names("t|q1"), 2)),
        ];
        for (text, expected) in cases {
            assert_eq!(form(text), expected, "{text:?}");
        }
    }
}

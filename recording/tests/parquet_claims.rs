//! Parquet files that claim more than they contain: the reader refuses or reads them within memory bounded by their own length.
//!
//! In a process of its own, since the kernel counts the peak memory of a process. The test builds the files byte by byte: no writer produces them.

use freeplay_recording::read;

/// Memory limit for all these files together, KiB: twice the limit for a small file.
const MOST_KIB: u64 = 160 << 10;

/// Codecs, encodings and types of pages of `parquet.thrift`.
const UNCOMPRESSED: i64 = 0;
const SNAPPY: i64 = 1;
const GZIP: i64 = 2;
const ZSTD: i64 = 6;
const LZ4_RAW: i64 = 7;
const PLAIN: i64 = 0;
const RLE: i64 = 3;
const RLE_DICTIONARY: i64 = 8;
const DATA_PAGE: i64 = 0;
const DICTIONARY_PAGE: i64 = 2;

/// Two GiB, the largest size in a page header.
const TWO_GIB: i64 = i32::MAX as i64;

/// Peak memory of this process, KiB.
fn peak_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("a process");
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).expect("the peak");
    line.trim().trim_end_matches("kB").trim().parse().expect("a number")
}

fn varint(mut value: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
    bytes
}

fn zigzag(value: i64) -> Vec<u8> {
    varint(((value << 1) ^ (value >> 63)) as u64)
}

/// A structure of Thrift's compact protocol.
#[derive(Clone, Default)]
struct Thrift {
    bytes: Vec<u8>,
    last: u8,
}

impl Thrift {
    fn field(mut self, id: u8, kind: u8, value: &[u8]) -> Self {
        self.bytes.push((id - self.last) << 4 | kind);
        self.bytes.extend(value);
        self.last = id;
        self
    }

    fn i32(self, id: u8, value: i64) -> Self {
        self.field(id, 5, &zigzag(value))
    }

    fn i64(self, id: u8, value: i64) -> Self {
        self.field(id, 6, &zigzag(value))
    }

    fn text(self, id: u8, text: &str) -> Self {
        self.field(id, 8, &text_of(text))
    }

    fn structure(self, id: u8, inner: Thrift) -> Self {
        self.field(id, 12, &inner.end())
    }

    fn list(self, id: u8, kind: u8, items: &[Vec<u8>]) -> Self {
        let mut list = vec![0xf0 | kind];
        list.extend(varint(items.len() as u64));
        list.extend(items.concat());
        self.field(id, 9, &list)
    }

    fn end(mut self) -> Vec<u8> {
        self.bytes.push(0);
        self.bytes
    }
}

fn text_of(text: &str) -> Vec<u8> {
    [varint(text.len() as u64), text.as_bytes().to_vec()].concat()
}

/// Header and content of a page.
#[derive(Clone)]
struct Page {
    kind: i64,
    encoding: i64,
    uncompressed: i64,
    compressed: i64,
    values: i64,
    body: Vec<u8>,
    /// Further fields at the end of its header.
    behind: Thrift,
}

impl Page {
    /// A sound page of numbers.
    fn plain(numbers: &[f64]) -> Self {
        let body: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        Self::of(DATA_PAGE, PLAIN, numbers.len() as i64, body)
    }

    fn of(kind: i64, encoding: i64, values: i64, body: Vec<u8>) -> Self {
        let size = body.len() as i64;
        Self { kind, encoding, uncompressed: size, compressed: size, values, body, behind: Thrift::default() }
    }

    fn bytes(&self) -> Vec<u8> {
        let numbers = Thrift::default().i32(1, self.values).i32(2, self.encoding).i32(3, RLE).i32(4, RLE);
        let header = Thrift::default().i32(1, self.kind).i32(2, self.uncompressed).i32(3, self.compressed);
        let header = if self.kind == DATA_PAGE {
            header.structure(5, numbers)
        } else {
            header.structure(7, Thrift::default().i32(1, self.values).i32(2, PLAIN))
        };
        let mut header = Thrift { last: 14, ..header };
        header.bytes.extend(&self.behind.bytes);
        [header.end(), self.body.clone()].concat()
    }
}

/// A column, with its description in the footer.
#[derive(Clone)]
struct Column {
    name: &'static str,
    codec: i64,
    pages: Vec<Page>,
    is_list: bool,
    values: i64,
    /// The claimed offset, if it differs from the true one.
    offset: Option<i64>,
    /// The claimed number of bytes, if it differs from the true one.
    size: Option<i64>,
}

impl Column {
    fn of(name: &'static str, pages: Vec<Page>) -> Self {
        let values = pages.iter().filter(|page| page.kind == DATA_PAGE).map(|page| page.values).sum();
        Self { name, codec: UNCOMPRESSED, pages, is_list: false, values, offset: None, size: None }
    }

    fn plain(name: &'static str, numbers: &[f64]) -> Self {
        Self::of(name, vec![Page::plain(numbers)])
    }
}

/// Time and one joint, three samples.
fn sound() -> Vec<Column> {
    vec![Column::plain("t", &[0.0, 0.1, 0.2]), Column::plain("q1", &[0.0, 0.5, 0.1])]
}

fn element(kind: Option<i64>, repetition: i64, name: &str, children: Option<i64>) -> Vec<u8> {
    let element = kind.map_or_else(Thrift::default, |kind| Thrift::default().i32(1, kind));
    let element = element.i32(3, repetition).text(4, name);
    children.map_or(element.clone(), |children| element.i32(5, children)).end()
}

/// A file of `columns`; its footer claims `rows` of the whole and of each of `groups` row groups.
fn file(columns: &[Column], rows: [i64; 2], groups: usize) -> Vec<u8> {
    let mut bytes = b"PAR1".to_vec();
    let (mut chunks, mut schema) = (Vec::new(), vec![element(None, 0, "schema", Some(columns.len() as i64))]);
    for column in columns {
        let start = bytes.len() as i64;
        column.pages.iter().for_each(|page| bytes.extend(page.bytes()));
        let size = bytes.len() as i64 - start;
        let offset = column.offset.unwrap_or(start);
        let encodings = [PLAIN, RLE, RLE_DICTIONARY].map(zigzag);
        let described = Thrift::default()
            .i32(1, 5)
            .list(2, 5, &encodings)
            .list(3, 8, &[text_of(column.name)])
            .i32(4, column.codec)
            .i64(5, column.values)
            .i64(6, size)
            .i64(7, column.size.unwrap_or(size));
        let has_dictionary = column.pages[0].kind == DICTIONARY_PAGE;
        let first = if has_dictionary { column.pages[0].bytes().len() as i64 } else { 0 };
        let described = described.i64(9, offset + first);
        let described = if has_dictionary { described.i64(11, offset) } else { described };
        chunks.push(Thrift::default().i64(2, start).structure(3, described).end());
        schema.push(element(Some(5), if column.is_list { 2 } else { 0 }, column.name, None));
    }
    let group = Thrift::default().list(1, 12, &chunks).i64(2, 0).i64(3, rows[1]).end();
    let footer = Thrift::default().i32(1, 1).list(2, 12, &schema).i64(3, rows[0]);
    bytes.extend(with_length(footer.list(4, 12, &vec![group; groups]).end()));
    bytes
}

/// A footer followed by its length and the magic bytes.
fn with_length(footer: Vec<u8>) -> Vec<u8> {
    let length = footer.len() as u32;
    [footer, length.to_le_bytes().to_vec(), b"PAR1".to_vec()].concat()
}

/// Columns with a second page, changed by `change`.
fn with_page(codec: i64, change: impl Fn(&mut Page)) -> Vec<u8> {
    let mut columns = sound();
    columns[1].codec = codec;
    change(&mut columns[1].pages[0]);
    file(&columns, [3, 3], 1)
}

/// A run of `count` equal values in `bits` bits each, in the encoding of levels and dictionary indices.
fn run_of(count: u64, value: u8) -> Vec<u8> {
    [varint(count << 1), vec![value]].concat()
}

/// A column with a dictionary of one number, repeated `count` times.
fn repeated(name: &'static str, count: i64) -> Column {
    let numbers = Page::of(DICTIONARY_PAGE, PLAIN, 1, 0.25_f64.to_le_bytes().to_vec());
    let places = [vec![1], run_of(count as u64, 0)].concat();
    Column::of(name, vec![numbers, Page::of(DATA_PAGE, RLE_DICTIONARY, count, places)])
}

/// A list of numbers: one row, or as many as there are numbers.
fn list(name: &'static str, rows: u64, count: i64) -> Column {
    // Each of the rows begins with a level of zero; all others belong to the last.
    let repetition = [run_of(rows, 0), run_of(count as u64 - rows, 1)].concat();
    let definition = run_of(count as u64, 1);
    let levels = [repetition, definition]
        .map(|levels| [(levels.len() as u32).to_le_bytes().to_vec(), levels].concat());
    let places = [vec![1], run_of(count as u64, 0)].concat();
    let numbers = Page::of(DICTIONARY_PAGE, PLAIN, 1, 0.25_f64.to_le_bytes().to_vec());
    let page = Page::of(DATA_PAGE, RLE_DICTIONARY, count, [levels.concat(), places].concat());
    Column { is_list: true, ..Column::of(name, vec![numbers, page]) }
}

/// A footer whose schema nests groups `levels` deep.
fn nested(levels: usize) -> Vec<u8> {
    let mut schema = vec![element(None, 1, "a", Some(1)); levels];
    schema.push(element(Some(5), 0, "t", None));
    let footer = Thrift::default().i32(1, 1).list(2, 12, &schema).i64(3, 0).list(4, 12, &[]).end();
    [b"PAR1".to_vec(), with_length(footer)].concat()
}

/// The false claim, the file, and the expected message.
fn claims() -> Vec<(String, Vec<u8>, &'static str)> {
    let mut claims = Vec::new();
    for codec in [UNCOMPRESSED, SNAPPY, GZIP, ZSTD, LZ4_RAW] {
        let page = with_page(codec, |page| page.uncompressed = TWO_GIB);
        claims.push((format!("page of 2 GiB, codec {codec}"), page, "a page of 2147483647 bytes"));
        let page = with_page(codec, |page| page.compressed = TWO_GIB);
        claims.push((format!("compressed page of 2 GiB, codec {codec}"), page, "longer than"));
    }
    let values = with_page(UNCOMPRESSED, |page| page.values = TWO_GIB);
    claims.push(("numbers of a page".to_owned(), values, "numbers"));
    let behind = |kind: u8, value: &[u8]| {
        with_page(UNCOMPRESSED, |page| {
            page.behind = Thrift { bytes: [&[0x10 | kind], value].concat(), last: 15 };
        })
    };
    for length in [1 << 31, 1 << 40, u64::MAX] {
        let text = behind(8, &varint(length));
        claims.push((format!("text of {length} bytes in a header"), text, "header"));
        let long = behind(9, &[vec![0xf8], varint(length)].concat());
        claims.push((format!("list of {length} texts in a header"), long, "header"));
    }
    claims.push(("structures in structures".to_owned(), behind(12, &[0x1c; 4096]), "header"));
    for (name, change) in [
        ("offset", (|column, value| column.offset = Some(value)) as fn(&mut Column, i64)),
        ("size", |column, value| column.size = Some(value)),
    ] {
        for value in [-1, 1 << 31, 1 << 40, i64::MAX, i64::MIN] {
            let mut columns = sound();
            change(&mut columns[1], value);
            claims.push((format!("{name} of {value}"), file(&columns, [3, 3], 1), "column"));
        }
    }
    for rows in [[1 << 27, 3], [3, 1 << 27], [1 << 27, 1 << 27], [-1, -1], [i64::MAX, i64::MAX]] {
        claims.push((format!("{rows:?} rows"), file(&sound(), rows, 1), "rows"));
    }
    claims.push(("no row group".to_owned(), file(&sound(), [1 << 27, 0], 0), "rows"));
    let count = 1 << 27;
    let long = [repeated("t", count), repeated("q1", count)];
    claims.push(("one number often".to_owned(), file(&long, [count, count], 1), "numbers"));
    let mut inner = sound();
    inner.push(list("state", 3, count));
    claims.push(("a long list".to_owned(), file(&inner, [3, 3], 1), "numbers"));
    // As many columns as the longest list has places, as many numbers in each as there are rows.
    let rows = 1 << 15;
    let mut ragged = vec![repeated("t", rows), repeated("q1", rows)];
    ragged.push(list("state", rows as u64, 2 * rows));
    claims.push(("lists of unequal length".to_owned(), file(&ragged, [rows, rows], 1), "numbers"));
    let mut often = sound();
    often[1] = repeated("q1", 1 << 20);
    often[0] = repeated("t", 1 << 20);
    claims.push(("one page in many groups".to_owned(), file(&often, [1 << 30, 1 << 20], 1 << 10), "numbers"));
    let mut wide = sound();
    wide[1] = repeated("q1", 3);
    wide[1].pages[0].values = TWO_GIB;
    claims.push(("a long dictionary".to_owned(), file(&wide, [3, 3], 1), "numbers"));
    claims.push(("groups in groups".to_owned(), nested(200_000), "nested"));
    claims
}

#[test]
fn what_a_file_claims_is_compared_with_its_length() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.parquet");
    let write = |bytes: &[u8]| std::fs::write(&path, bytes).expect("written");
    // The reader would accept the files if they claimed their true sizes.
    write(&file(&sound(), [3, 3], 1));
    assert_eq!(read(&path, None).expect("a recording").len(), 3);
    let mut lists = vec![Column::plain("t", &[0.0, 0.1, 0.2]), repeated("q1", 3)];
    lists.push(list("state", 3, 6));
    write(&file(&lists, [3, 3], 1));
    let recording = read(&path, None).expect("a recording");
    assert_eq!((recording.len(), recording.q[0].as_slice()), (3, [0.25; 3].as_slice()));
    assert!(recording.others.iter().any(|(name, _)| name == "state[3]"), "the list has four places");
    let mut wrong = Vec::new();
    for (name, bytes, what) in claims() {
        write(&bytes);
        let said = match read(&path, None) {
            Ok(recording) => format!("read, {} samples", recording.len()),
            Err(error) => error.to_string(),
        };
        println!("{name}: {} bytes, the most memory so far {} KiB: {said}", bytes.len(), peak_kib());
        if !said.contains(what) || peak_kib() > MOST_KIB {
            wrong.push(format!("{name}: {said}; {what} is wanted; {} KiB", peak_kib()));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

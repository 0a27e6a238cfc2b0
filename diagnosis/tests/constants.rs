//! Every number that the crate has made up stands here in a count, has a name and a reason, and may only become fewer.
//!
//! A constant is an item `const` with a number in it, or a number written out in an expression, tests left out. Numbers that need no reason: 0, 1, 2, a half, what counts (a whole
//! number up to four), and the units per cent and thousandth. What is a definition of mathematics or of the command line is not counted where this test works it out anew.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use proc_macro2::{TokenStream, TokenTree};
use syn::visit::{self, Visit};

/// Made-up numbers that a part of the crate may have: as many as it has. The goal is 60 for all of it.
const BUDGET: [(&str, usize); 3] = [("servo", 47), ("conventions", 89), ("", 91)];

/// A number that the crate is written with.
#[derive(Debug)]
struct Found {
    /// The file below `src`.
    file: String,
    line: usize,
    /// Its name; nothing of one in an expression.
    name: Option<String>,
    /// Whether a comment of its own, or of the constant right before it, says why.
    has_reason: bool,
    values: Vec<f64>,
}

/// Looks for numbers in one file.
#[derive(Default)]
struct Reader {
    file: String,
    found: Vec<Found>,
    /// The line on which the last constant with a reason ends.
    reasoned: Option<usize>,
}

impl Reader {
    fn number(&mut self, literal: &proc_macro2::Literal) {
        let text = literal.to_string();
        let is_float =
            text.contains('.') || text.contains("f64") || (text.contains('e') && !text.starts_with("0x"));
        let Some(value) = value_of(&text) else { return };
        let is_plain = [0.0, 1.0, 2.0, 0.5].contains(&value)
            || is_float && [100.0, 1e3].contains(&value)
            || !is_float && value <= 4.0;
        if !is_plain {
            let line = literal.span().start().line;
            self.found.push(Found {
                file: self.file.clone(),
                line,
                name: None,
                has_reason: false,
                values: vec![value],
            });
        }
    }

    fn tokens(&mut self, tokens: TokenStream) {
        for token in tokens {
            match token {
                TokenTree::Literal(literal) => self.number(&literal),
                TokenTree::Group(group) => self.tokens(group.stream()),
                TokenTree::Ident(_) | TokenTree::Punct(_) => {}
            }
        }
    }

    fn constant(&mut self, name: &syn::Ident, attributes: &[syn::Attribute], value: &syn::Expr) {
        let mut inside = Self::default();
        inside.visit_expr(value);
        let mut values = Values(Vec::new());
        values.visit_expr(value);
        let line = name.span().start().line;
        let is_documented = attributes.iter().any(|attribute| attribute.path().is_ident("doc"));
        let has_reason = is_documented || self.reasoned == Some(line - 1);
        self.reasoned = has_reason.then(|| syn::spanned::Spanned::span(value).end().line);
        if !values.0.is_empty() {
            let (file, name) = (self.file.clone(), Some(name.to_string()));
            self.found.push(Found { file, line, name, has_reason, values: values.0 });
        }
    }
}

/// All numbers of an expression.
struct Values(Vec<f64>);

impl Visit<'_> for Values {
    fn visit_lit(&mut self, literal: &syn::Lit) {
        match literal {
            syn::Lit::Float(literal) => self.0.extend(value_of(&literal.to_string())),
            syn::Lit::Int(literal) => self.0.extend(value_of(&literal.to_string())),
            _ => {}
        }
    }
}

fn value_of(text: &str) -> Option<f64> {
    let text = text.replace('_', "");
    let end = ["f64", "f32", "usize", "u64", "u32", "u16", "u8", "i32", "i64", "i16", "i8"]
        .into_iter()
        .find_map(|suffix| text.strip_suffix(suffix))
        .unwrap_or(&text)
        .to_owned();
    end.parse().ok()
}

fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("test")
            || attribute.path().is_ident("cfg")
                && attribute.parse_args::<syn::Ident>().is_ok_and(|what| what == "test")
    })
}

impl<'a> Visit<'a> for Reader {
    fn visit_item_mod(&mut self, item: &'a syn::ItemMod) {
        if !is_test(&item.attrs) {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_fn(&mut self, item: &'a syn::ItemFn) {
        if !is_test(&item.attrs) {
            visit::visit_item_fn(self, item);
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'a syn::ImplItemFn) {
        if !is_test(&item.attrs) {
            visit::visit_impl_item_fn(self, item);
        }
    }

    fn visit_item_const(&mut self, item: &'a syn::ItemConst) {
        self.constant(&item.ident, &item.attrs, &item.expr);
    }

    fn visit_item_static(&mut self, item: &'a syn::ItemStatic) {
        self.constant(&item.ident, &item.attrs, &item.expr);
    }

    fn visit_impl_item_const(&mut self, item: &'a syn::ImplItemConst) {
        self.constant(&item.ident, &item.attrs, &item.expr);
    }

    fn visit_expr_lit(&mut self, literal: &'a syn::ExprLit) {
        match &literal.lit {
            syn::Lit::Float(float) => self.number(&float.token()),
            syn::Lit::Int(int) => self.number(&int.token()),
            _ => {}
        }
    }

    // The length of an array is no number that says anything.
    fn visit_type_array(&mut self, _: &'a syn::TypeArray) {}

    fn visit_expr_index(&mut self, index: &'a syn::ExprIndex) {
        self.visit_expr(&index.expr);
        if !matches!(&*index.index, syn::Expr::Lit(_)) {
            self.visit_expr(&index.index);
        }
    }

    fn visit_attribute(&mut self, _: &'a syn::Attribute) {}

    fn visit_macro(&mut self, call: &'a syn::Macro) {
        self.tokens(call.tokens.clone());
    }
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let mut all: Vec<PathBuf> =
        entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect();
    all.retain(|path| path.extension().is_some_and(|extension| extension == "rs"));
    all.sort();
    all
}

/// The numbers that `source` in the file called `file` has.
fn numbers(file: &str, source: &str) -> Vec<Found> {
    let mut reader = Reader { file: file.to_owned(), ..Reader::default() };
    reader.visit_file(&syn::parse_file(source).expect("Rust"));
    reader.found
}

fn of_the_crate() -> Vec<Found> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let of_file = |path: PathBuf| {
        let file = path.strip_prefix(&root).expect("below").display().to_string();
        numbers(&file, &std::fs::read_to_string(&path).expect("text"))
    };
    files(&root).into_iter().flat_map(of_file).collect()
}

fn binomial(n: u32, k: u32) -> f64 {
    (0..k).fold(1.0, |product, i| product * f64::from(n - i) / f64::from(i + 1))
}

/// x with Φ(x) = `share` of a normal, by bisection of the error function.
fn quantile(share: f64) -> f64 {
    let (mut low, mut high) = (-9.0, 9.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        let below = 0.5 * libm::erfc(-middle / std::f64::consts::SQRT_2);
        if below < share { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Definitions, by file and name: their closed forms. Numbers without a name are those of a formula.
fn definitions() -> BTreeMap<(&'static str, &'static str), Vec<f64>> {
    let butterworth = |k: f64| 0.5 / ((2.0 * k + 1.0) * std::f64::consts::PI / 8.0).sin();
    let tolerances = of_the_command_line();
    let [mass, friction, zero, length, delay] = tolerances;
    let derivatives = five_points();
    // S with S(0) = 0, S(1) = 1 and two derivatives that are zero there: the coefficients of Hermite's polynomial of fifth order and its derivatives.
    let [third, fourth, fifth] = [10.0, -15.0, 6.0];
    assert_eq!(
        [
            third + fourth + fifth,
            3.0 * third + 4.0 * fourth + 5.0 * fifth,
            6.0 * third + 12.0 * fourth + 20.0 * fifth
        ],
        [1.0, 0.0, 0.0]
    );
    let smooth = vec![third, -fourth, fifth, 3.0 * third, 6.0 * third];
    [
        (("filter.rs", "BUTTERWORTH_4"), vec![butterworth(0.0), butterworth(1.0)]),
        (("filter.rs", ""), derivatives),
        (("statistics.rs", "UNUSUAL"), vec![quantile(1.0 - 1.0 / 40.0)]),
        (("statistics.rs", "EVEN"), vec![1.0 / 3.0_f64.sqrt()]),
        (("statistics.rs", "MEDIAN"), vec![0.5, quantile(0.75)]),
        (("statistics.rs", "LOWER_QUARTILE"), vec![0.25, quantile(0.625)]),
        (("statistics.rs", "FOURTH_DIFFERENCE"), vec![(0..=4).map(|k| binomial(4, k).powi(2)).sum()]),
        (("statistics.rs", ""), vec![5.0, binomial(4, 1), binomial(4, 2), binomial(4, 3)]),
        (("numbers.rs", "ROUNDING"), vec![1.0, 1.0, -f64::EPSILON.log2() / 2.0]),
        (("diagnose/search.rs", "AS_GOOD"), vec![20.0_f64.ln()]),
        (("diagnose/tolerance.rs", ""), vec![mass, mass, friction, zero, length, delay, length]),
        (("diagnose/excite/family.rs", ""), smooth),
    ]
    .into()
}

/// The factors of the derivatives over five points and the numbers in their closed forms, once they are seen to be exact for every polynomial of fourth order.
fn five_points() -> Vec<f64> {
    let (first, second) = ([1.0, -8.0, 0.0, 8.0, -1.0], [-1.0, 16.0, -30.0, 16.0, -1.0]);
    for order in 0..=4 {
        let sum = |weights: [f64; 5]| -> f64 {
            weights.iter().zip(-2..=2).map(|(weight, x)| weight * f64::from(x).powi(order) / 12.0).sum()
        };
        assert!((sum(first) - if order == 1 { 1.0 } else { 0.0 }).abs() < 1e-12);
        assert!((sum(second) - if order == 2 { 2.0 } else { 0.0 }).abs() < 1e-12);
    }
    // The order of the filter, forwards and back; then each derivative.
    vec![2.0 * 4.0, 5.0, 8.0, 12.0, 5.0, 16.0, 30.0, 12.0]
}

/// Tolerances of masses, friction, zeros, lengths and delays by the command line's own defaults, in SI units.
fn of_the_command_line() -> [f64; 5] {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../cli/src/diagnose.rs");
    let text = std::fs::read_to_string(path).expect("the command line");
    ["mass_tolerance", "friction_tolerance", "zero_tolerance", "length_tolerance", "delay_tolerance"].map(
        |field| {
            let before = text.split(&format!("{field}: f64")).next().expect("its option");
            let value = before.rsplit("default_value_t = ").next().and_then(|rest| rest.split(')').next());
            let value: f64 = value.and_then(|value| value.parse().ok()).expect("its default");
            if field.starts_with("mass") || field.starts_with("friction") {
                value / 100.0
            } else {
                value / 1e3
            }
        },
    )
}

/// Whether the numbers of `one` are the closed forms of a definition, to the last digits.
fn is_definition(one: &[&Found], closed: &[f64]) -> bool {
    let values: Vec<f64> = one.iter().flat_map(|found| found.values.iter().copied()).collect();
    let is_near = |(value, closed): (&f64, &f64)| (value - closed).abs() <= 4.0 * f64::EPSILON * closed.abs();
    values.len() == closed.len() && values.iter().zip(closed).all(is_near)
}

#[test]
fn numbers_become_fewer_and_have_reasons() {
    let found = of_the_crate();
    let mut by_name: BTreeMap<(&str, &str), Vec<&Found>> = BTreeMap::new();
    for one in &found {
        by_name.entry((&one.file, one.name.as_deref().unwrap_or(""))).or_default().push(one);
    }
    let definitions = definitions();
    for (place, closed) in &definitions {
        let own = by_name.remove(place).unwrap_or_else(|| panic!("{place:?} is gone: strike it off"));
        let values: Vec<&Vec<f64>> = own.iter().map(|one| &one.values).collect();
        assert!(is_definition(&own, closed), "{place:?} is {values:?}, but its closed form {closed:?}");
    }
    let (mut counts, mut unexplained) = (BTreeMap::new(), Vec::new());
    for one in by_name.values().flatten() {
        let part = BUDGET.iter().find(|(part, _)| one.file.starts_with(part)).expect("a part").0;
        *counts.entry(part).or_insert(0) += 1;
        let name = one.name.as_deref().unwrap_or("(no name)");
        println!("{}:{} {name} {:?}", one.file, one.line, one.values);
        if one.name.is_some() && !one.has_reason {
            unexplained.push(format!("{}:{} {name}", one.file, one.line));
        }
    }
    println!("{counts:?}, of which the goal is 60 in all; {} are definitions", definitions.len());
    assert!(unexplained.is_empty(), "constants without a comment that says why: {}", unexplained.join(", "));
    for (part, budget) in BUDGET {
        let count = counts.get(part).copied().unwrap_or(0);
        assert!(
            count <= budget,
            "{count} made-up numbers in src/{part}, {budget} are allowed: find what makes the new one needless"
        );
    }
}

#[test]
fn a_number_is_found_wherever_it_stands() {
    let source = "/// Why.\nconst A: f64 = 0.3;\nconst B: f64 = 0.4;\n\nconst C: [f64; 2] = [0.7, 1e-3];\nconst NAME: &str = \"5\";\n\
        fn f(x: [f64; 7]) -> f64 { let y = 0.5 * x[5] + 1.5; g(vec![0.25; 9], matches!(y, 3.5)); if y < 1e-9 { 100.0 * y } else { y.powi(8) } }\n\
        #[cfg(test)]\nmod tests { const D: f64 = 0.9; fn t() -> f64 { 7.5 } }";
    let found = numbers("made", source);
    let named: Vec<(&str, bool)> =
        found.iter().filter_map(|one| Some((one.name.as_deref()?, one.has_reason))).collect();
    assert_eq!(named, [("A", true), ("B", true), ("C", false)]);
    let bare: Vec<f64> =
        found.iter().filter(|one| one.name.is_none()).flat_map(|one| one.values.clone()).collect();
    assert_eq!(bare, [1.5, 0.25, 9.0, 3.5, 1e-9, 8.0]);
}

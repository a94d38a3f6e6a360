//! Tests that the table *Measured* of `README.md`, the figures in `crates/testkit/src/figures.rs` and the tests that assert
//! them agree: they have the same figures, the bounds are close to the figures, and the tests exist and use the figures. Times have a separate table
//! and no tests.

use std::{fs, path::Path};

use steradian::{plan::settings::StarMethod, verify};

use crate::figures::{FIGURES, Figure};

/// The first line of the table.
const HEAD: &str = "| property | figure | test |";
/// Allowed ratio of a bound to its figure, without a note.
const RATIO: std::ops::RangeInclusive<f64> = 2.0..=6.0;

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Returns the cells of the rows of the table.
fn rows(document: &str) -> Vec<Vec<String>> {
    let table = document.lines().skip_while(|line| *line != HEAD).skip(2).take_while(|line| line.starts_with('|'));
    let cells = |line: &str| line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect();
    table.map(cells).collect()
}

/// Describes the problem of a bound, if any.
fn problem_of_bound(figure: &Figure) -> Option<String> {
    let Figure { property, measured, bound, note, .. } = *figure;
    if !(measured.is_finite() && measured >= 0.0 && bound.is_finite() && bound >= measured) {
        return Some(format!("{property}: the bound {bound:e} is invalid for the figure {measured:e}"));
    }
    // An exact figure has no tolerance.
    let close = if measured == 0.0 { bound == 0.0 } else { RATIO.contains(&(bound / measured)) };
    let ratio = bound / measured;
    match (close, note.is_empty()) {
        (false, true) => {
            Some(format!("{property}: the bound is {ratio:.1} times the figure, and no note gives the reason"))
        }
        (true, false) => {
            Some(format!("{property}: the bound is {ratio:.1} times the figure so the note is unnecessary"))
        }
        _ => None,
    }
}

/// Lists the problems between the table of a document, the figures, and the text of the tests, which `test` finds.
fn problems(document: &str, figures: &[Figure], test: &dyn Fn(&str) -> Result<String, String>) -> Vec<String> {
    let rows = rows(document);
    let mut problems = Vec::new();
    if rows.is_empty() {
        problems.push(format!("the table with the head `{HEAD}` is missing"));
    }
    for row in &rows {
        let [property, figure, test] = row.as_slice() else {
            problems.push(format!("{row:?}: three cells expected"));
            continue;
        };
        let Some(known) = figures.iter().find(|known| known.property == property) else {
            problems.push(format!("{property}: no figure asserts this row"));
            continue;
        };
        if figure.parse() != Ok(known.measured) {
            problems.push(format!("{property}: the table has {figure}, the figure is {:e}", known.measured));
        }
        if *test != format!("`{}`", known.test) {
            problems.push(format!("{property}: the table names the test {test}, the figure names `{}`", known.test));
        }
    }
    for figure in figures {
        let count = rows.iter().filter(|row| row.first().is_some_and(|cell| cell == figure.property)).count();
        if count != 1 {
            problems.push(format!("{}: {count} rows, one expected", figure.property));
        }
        if figures.iter().filter(|other| other.property == figure.property).count() != 1 {
            problems.push(format!("{}: more than one figure", figure.property));
        }
        problems.extend(problem_of_bound(figure));
        match test(figure.test) {
            Ok(text) if text.contains(&format!("figures::{}.", figure.name)) => {}
            Ok(_) => problems.push(format!("{} does not use figures::{}", figure.test, figure.name)),
            Err(problem) => problems.push(format!("{}: {problem}", figure.test)),
        }
    }
    problems
}

/// Returns the text of a function of a source file if it is a test: it has the attribute, or its name is quoted in
/// `table`, the list of tests of a binary with a custom harness.
fn test_in(source: &str, name: &str, table: &str) -> Result<String, String> {
    let lines: Vec<&str> = source.lines().collect();
    let declared = |line: &&str| line.trim_start_matches("pub ").starts_with(&format!("fn {name}("));
    let start = lines.iter().position(declared).ok_or_else(|| format!("the function {name} does not exist"))?;
    let end = lines[start..].iter().position(|line| *line == "}").ok_or_else(|| format!("{name} does not end"))?;
    let attributes: Vec<&str> = lines[..start].iter().rev().take_while(|line| line.starts_with('#')).copied().collect();
    if !attributes.contains(&"#[test]") && !table.contains(&format!("\"{name}\"")) {
        return Err(format!("{name} is not a test"));
    }
    Ok(lines[start..start + end].join("\n"))
}

/// Returns the text of the test with this path, such as `gpu::stars::light::name`.
fn test_by_path(path: &str) -> Result<String, String> {
    let segments: Vec<&str> = path.split("::").collect();
    let [binary, modules @ .., name] = segments.as_slice() else {
        return Err("a binary and a name expected".to_owned());
    };
    let folder = repository().join("tests").join(binary);
    let module = modules.iter().fold(folder, |folder, module| folder.join(module));
    let read = |path: &Path| fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()));
    // The list of tests of a harness is in the module above.
    let list = module.with_file_name("mod.rs");
    let table = if list.is_file() { read(&list)? } else { String::new() };
    test_in(&read(&module.with_extension("rs"))?, name, &table)
}

#[test]
fn measured_figures_are_asserted_by_tests_with_close_bounds() {
    let readme = fs::read_to_string(repository().join("README.md")).unwrap();
    let problems = problems(&readme, FIGURES, &test_by_path);
    assert!(problems.is_empty(), "{}", problems.join("\n"));
}

/// Returns the number between two texts of a document, which may have line breaks anywhere.
fn number_between(document: &str, before: &str, after: &str) -> Option<usize> {
    let text = document.split_whitespace().collect::<Vec<_>>().join(" ");
    let (_, rest) = text.split_once(before)?;
    rest.split_once(after)?.0.parse().ok()
}

#[test]
fn readme_counts_match_the_program() {
    let readme = fs::read_to_string(repository().join("README.md")).unwrap();
    assert_eq!(number_between(&readme, "`verify` runs ", " checks"), Some(verify::checks().len()));
    let ours = number_between(&readme, "(docs/catalogues.md)); ", " new methods").unwrap();
    let published = number_between(&readme, "new methods and ", " published ones").unwrap();
    assert_eq!(ours + published, StarMethod::ALL.len());
    assert_eq!(number_between("a 12\nb", "a ", " b"), Some(12));
    assert_eq!(number_between("a few b", "a ", " b"), None);
}

/// A correct figure.
const GOOD: Figure = Figure {
    name: "GOOD",
    property: "flux of a star, relative",
    measured: 1.8e-5,
    bound: 7e-5,
    test: "gpu::stars::light::good",
    note: "",
};
const ROW: &str = "| flux of a star, relative | 1.8e-5 | `gpu::stars::light::good` |\n";

fn found(document: &str, figures: &[Figure], text: Result<&str, &str>) -> Vec<String> {
    problems(document, figures, &|_| text.map(str::to_owned).map_err(str::to_owned))
}

fn table_of(rows: &str) -> String {
    format!("text\n\n{HEAD}\n|---|---|---|\n{rows}\n| frame | ms |\n|---|---|\n| a dome | 20.8 |\n")
}

#[test]
fn wrong_figures_wide_bounds_and_missing_rows_are_detected() {
    const USED: Result<&str, &str> = Ok("fn good() {\n    figures::GOOD.check(1.0);");
    let good = table_of(ROW);
    assert_eq!(found(&good, &[GOOD], USED), Vec::<String>::new());
    let exact = Figure { measured: 0.0, bound: 0.0, ..GOOD };
    assert_eq!(found(&good.replace("1.8e-5", "0"), &[exact], USED), Vec::<String>::new());
    let excused = Figure { bound: 1e-3, note: "adapters differ", ..GOOD };
    assert_eq!(found(&good, &[excused], USED), Vec::<String>::new());

    for document in [
        good.replace("1.8e-5", "1.7e-5"),
        good.replace("1.8e-5", "small"),
        good.replace("light::good", "light::other"),
        good.replace("| 1.8e-5 ", ""),
        good.replace("flux", "light"),
        table_of(""),
        table_of(&ROW.repeat(2)),
        table_of(&format!("{ROW}| width, pixels | 1e-5 | `gpu::stars::light::good` |\n")),
        "no table".to_owned(),
    ] {
        assert!(!found(&document, &[GOOD], USED).is_empty(), "passed:\n{document}");
    }
    for figure in [
        Figure { bound: 1e-3, ..GOOD },
        Figure { bound: 2e-5, ..GOOD },
        Figure { bound: 1e-5, ..GOOD },
        Figure { bound: 1e-5, note: "adapters differ", ..GOOD },
        Figure { bound: f64::NAN, ..GOOD },
        Figure { bound: f64::INFINITY, note: "adapters differ", ..GOOD },
        Figure { note: "adapters differ", ..GOOD },
        Figure { name: "OTHER", ..GOOD },
    ] {
        assert!(!found(&good, &[figure], USED).is_empty(), "passed: {figure:?}");
    }
    let room_for_the_exact = Figure { measured: 0.0, bound: 1e-9, ..GOOD };
    assert!(!found(&good.replace("1.8e-5", "0"), &[room_for_the_exact], USED).is_empty());
    assert!(!found(&good, &[GOOD, GOOD], USED).is_empty(), "two figures for a row pass");
    assert!(!found(&good, &[], USED).is_empty(), "a row without a figure passes");
    assert!(!found(&good, &[GOOD], Ok("fn good() {")).is_empty(), "a test that does not use its figure passes");
    assert!(!found(&good, &[GOOD], Err("the function good does not exist")).is_empty());
}

#[test]
fn figures_fail_above_their_bound_and_without_a_measurement() {
    for measured in [0.0, 1e-5, -7e-5] {
        GOOD.check(measured);
    }
    let fails = |run: fn()| assert!(std::panic::catch_unwind(run).is_err());
    fails(|| GOOD.check(7.1e-5));
    fails(|| GOOD.check(-7.1e-5));
    fails(|| GOOD.check(f64::NAN));
    fails(|| GOOD.worst().print());
    let none = Figure { measured: 0.0, bound: 0.0, ..GOOD };
    assert!(none.holds(0.0) && !none.holds(1e-12));
}

#[test]
fn tests_are_found_by_attribute_or_list() {
    let source = "/// Text.\n#[test]\nfn a() {\n    one();\n}\n\npub fn b(of: u8) {\n    two();\n}\n\nfn ab() {\n    three();\n}\n";
    assert_eq!(test_in(source, "a", "").unwrap(), "fn a() {\n    one();");
    assert_eq!(test_in(source, "b", "(\"b\", b)").unwrap(), "pub fn b(of: u8) {\n    two();");
    assert!(test_in(source, "b", "(\"ab\", ab)").is_err(), "`b` is not listed as a test");
    assert!(test_in(source, "c", "\"c\"").is_err(), "`c` does not exist");
    assert!(test_by_path("gpu::stars::light::no_such_test").is_err());
    assert!(test_by_path("gpu::no_such_file::every_magnitude_has_its_illuminance_in_every_projection").is_err());
    assert!(test_by_path("gpu").is_err());
}

//! Generates the picture at the head of `docs/architecture.md` from the table in `layering`: its columns are the crates, its rows the layers of their
//! modules. `STERADIAN_WRITE_REFERENCE=1` writes the file; otherwise the test fails if the file differs.

use std::path::Path;

use svg::{
    Document,
    node::element::{Rectangle, Text},
};

use crate::layering::{CRATES, LAYERS};

const FILE: &str = "docs/images/architecture.svg";
/// Columns: the folder of the sources, the title and the purpose of the crate.
const TITLES: [(&str, &str); CRATES.len()] = [
    ("steradian-lock", "frame lock of machines"),
    ("steradian-sky", "the sky without a GPU"),
    ("steradian-render", "views, plans, passes"),
    ("steradian", "program, daemon, outputs"),
];
const COLUMN: f64 = 250.0;
const ROW: f64 = 30.0;
const HEAD: f64 = 56.0;

fn text(x: f64, y: f64, size: f64, content: &str) -> Text {
    Text::new(content)
        .set("x", x)
        .set("y", y)
        .set("font-size", size)
        .set("font-family", "sans-serif")
        .set("text-anchor", "middle")
}

/// Returns the columns of the crates that have a module of this name.
fn crates_of(module: &str) -> Vec<usize> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let has = |folder: &str| {
        let folder = root.join(folder);
        folder.join(format!("{module}.rs")).is_file() || folder.join(module).join("mod.rs").is_file()
    };
    let found: Vec<usize> = (0..CRATES.len()).filter(|index| has(CRATES[*index])).collect();
    assert!(!found.is_empty(), "no crate has the module `{module}`");
    found
}

/// Returns the rows: one for each layer that has modules, from the data to the program.
fn picture(layers: &[&[&str]]) -> String {
    let mut rows: Vec<[Vec<&str>; CRATES.len()]> = Vec::new();
    for layer in layers {
        let mut row: [Vec<&str>; CRATES.len()] = Default::default();
        for module in *layer {
            for index in crates_of(module) {
                row[index].push(module);
            }
        }
        rows.push(row);
    }
    let height = HEAD + ROW * rows.len() as f64 + 12.0;
    let mut document = Document::new().set("viewBox", (0, 0, (COLUMN * CRATES.len() as f64) as i32, height as i32));
    for (column, (name, purpose)) in TITLES.iter().enumerate() {
        let left = COLUMN * column as f64;
        let frame = Rectangle::new()
            .set("x", left + 4.0)
            .set("y", 4)
            .set("width", COLUMN - 8.0)
            .set("height", height - 8.0)
            .set("rx", 6)
            .set("fill", "#f4f6fa")
            .set("stroke", "#405070");
        let middle = left + COLUMN / 2.0;
        document = document.add(frame).add(text(middle, 26.0, 15.0, name)).add(text(middle, 44.0, 11.0, purpose));
        for (index, row) in rows.iter().enumerate().filter(|(_, row)| !row[column].is_empty()) {
            let top = HEAD + ROW * index as f64;
            let layer = Rectangle::new()
                .set("x", left + 14.0)
                .set("y", top)
                .set("width", COLUMN - 28.0)
                .set("height", ROW - 6.0)
                .set("rx", 4)
                .set("fill", "#ffffff")
                .set("stroke", "#a0b0c8");
            // Long rows are set in smaller letters.
            let names = row[column].join("  ");
            let size = if names.len() > 44 { 8.0 } else { 11.0 };
            document = document.add(layer).add(text(middle, top + 16.0, size, &names));
        }
    }
    format!("{document}\n")
}

#[test]
fn the_picture_of_the_architecture_shows_the_layers() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(FILE);
    let expected = picture(LAYERS);
    if std::env::var_os("STERADIAN_WRITE_REFERENCE").is_some() {
        std::fs::write(&path, &expected).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(found == expected, "{FILE} differs: run the test with STERADIAN_WRITE_REFERENCE=1");
    // The comparison must detect a moved module.
    let mut moved = LAYERS.to_vec();
    moved.swap(1, 2);
    assert_ne!(picture(&moved), expected);
}

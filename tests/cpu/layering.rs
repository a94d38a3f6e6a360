//! Proves that the modules of all crates import each other in one direction only, that of the data flow of a frame. Between crates, the compiler
//! enforces this.
//!
//! Every file is split into tokens (without comments, strings and characters), and every path that starts at the
//! crate's root is followed: `crate::`, `steradian::`, `steradian_lock::`, `steradian_sky::`, `steradian_render::`, and as many `super::` as lead there, in groups as well as
//! separately. The module that such a path names must be before the importer in [`LAYERS`].

pub mod paths;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use paths::{Token, root_paths, tokens};

/// Folders of the crates whose modules form the layers.
pub const CRATES: [&str; 4] = ["crates/lock/src", "crates/sky/src", "crates/render/src", "src"];

/// Allowed imports: a module may import every module of the layers above its own, and within a layer only those
/// listed in [`SIBLINGS`]. A new module must be added here, as far up as its imports permit.
pub const LAYERS: &[&[&str]] = &[
    &["names", "platform"],
    &[
        "units",
        "calendar",
        "polynomial",
        "solar_system",
        "coordinates",
        "sky_pictures",
        "files",
        "cache",
        "fits",
        "ranges",
        "memory_size",
        "once",
        "clock",
        "messages",
    ],
    &["photometry", "picture_file", "rules"],
    &["ephemeris", "relativity", "director", "node"],
    &["catalogue"],
    &["observer"],
    &["scene", "view"],
    &["theatre"],
    &["plan"],
    &["config", "gpu"],
    &["reference", "metrics"],
    &["render"],
    &["verify", "chart", "audit"],
    &["output", "xr", "windows", "service"],
    &["cli"],
    &["main"],
];

/// Allowed imports between modules of one layer: (importer, imported). A scene contains the components of its views; the headset and the service
/// deliver data that `output` encodes.
const SIBLINGS: &[(&str, &str)] = &[
    ("cache", "files"),
    ("calendar", "units"),
    ("coordinates", "units"),
    ("scene", "view"),
    ("xr", "output"),
    ("service", "output"),
    ("service", "xr"),
    ("service", "windows"),
];

/// Imports that are forbidden although the layers would permit them: a CPU twin is useless as a check if it shares code with the code under test.
const REFUSED: &[(&str, &str)] = &[("reference", "gpu")];

/// Crates that some modules must not name: (modules, crates). A name that continues with an underscore is forbidden too (`tonic_web`).
const FOREIGN: &[(&[&str], &[&str])] =
    &[(&["photometry", "scene", "view", "theatre", "plan"], &["wgpu", "tokio", "tonic"])];

/// Crates that only `service` may name: protobuf types belong to the wire protocol, not to the program.
const ONLY_SERVICE: &[&str] = &["tonic", "prost", "include_proto"];

/// Modules of `service` with generated protobuf types.
const GENERATED: &[&str] = &["proto"];

/// Modules of `service`, in the order of the table in its head: each may import those before it.
const SERVICE: &[&str] = &[
    "threads",
    "time_source",
    "scene",
    "wire",
    "state_file",
    "network",
    "frames",
    "engine",
    "cluster",
    "displays",
    "handlers",
    "daemon",
];

/// Allowed imports between modules of `service` in addition to those of [`SERVICE`]: (importer, imported). The client shares plain types and
/// conversions with the daemon, and nothing else.
const SERVICE_PAIRS: &[(&str, &str)] = &[("client", "scene"), ("client", "wire")];

/// Names of `service` itself that all of its modules may import. Its re-exports are only for modules outside of `service`.
const SERVICE_ROOT: &[&str] = &["proto", "SPANS"];

/// Test modules of `service` that may import all of it.
const SERVICE_TESTS: &[&str] = &["fuzz_tests"];

/// Modules of `render` that may import techniques: the list of techniques, the module of errors, because it contains the errors of the techniques,
/// and two test modules.
const KNOW_TECHNIQUES: &[&str] = &["sequence", "error", "pass_tests", "presentation_tests"];

/// Returns the index of a module's layer.
fn layer_of(module: &str) -> Option<usize> {
    LAYERS.iter().position(|layer| layer.contains(&module))
}

/// Checks whether `importer` may import `imported`, both top-level modules; the error gives the reason.
fn may_import(importer: &str, imported: &str) -> Result<(), String> {
    let Some(from) = layer_of(importer) else { return Err(format!("`{importer}` is not in LAYERS")) };
    let Some(to) = layer_of(imported) else { return Err(format!("`{imported}` is not in LAYERS")) };
    let listed = |pairs: &[(&str, &str)]| pairs.contains(&(importer, imported));
    if importer == imported || (to < from && !listed(REFUSED)) || (to == from && listed(SIBLINGS)) {
        Ok(())
    } else {
        Err(format!("`{importer}` must not import `{imported}`"))
    }
}

/// Returns the modules of `render` that are techniques: those that the list of techniques imports. No technique may import another one; code that
/// several of them need is in the other modules of `render`.
fn techniques() -> &'static [String] {
    static TECHNIQUES: LazyLock<Vec<String>> = LazyLock::new(|| {
        let source =
            std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/render/src/render/sequence.rs"))
                .unwrap();
        let imports = source.split_once("use super::{").and_then(|(_, rest)| rest.split_once("};")).unwrap().0;
        let modules = imports.lines().filter_map(|line| line.trim().split_once("::")).map(|(module, _)| module);
        modules.filter(|module| *module != "technique").map(str::to_owned).collect()
    });
    &TECHNIQUES
}

/// Returns the reason why a module of `service` may not import a name of `service`, or `None` if it may.
fn service_breach(importer: &str, imported: &str) -> Option<String> {
    let position = |module: &str| SERVICE.iter().position(|known| *known == module);
    let is_known = position(importer).is_some() || SERVICE_PAIRS.iter().any(|(known, _)| *known == importer);
    if SERVICE_TESTS.contains(&importer) {
        return None;
    }
    if !is_known {
        return Some(format!("`service::{importer}` is neither in SERVICE nor in SERVICE_PAIRS"));
    }
    let is_before = matches!((position(importer), position(imported)), (Some(from), Some(to)) if to < from);
    let may = importer == imported
        || is_before
        || SERVICE_PAIRS.contains(&(importer, imported))
        || SERVICE_ROOT.contains(&imported);
    (!may).then(|| format!("`service::{importer}` must not import `service::{imported}`"))
}

fn is_technique(module: &str) -> bool {
    techniques().iter().any(|technique| technique == module)
}

/// Returns the violations of the order in one file. `module` is the path of its module.
fn breaches(module: &[&str], source: &str) -> Vec<String> {
    let importer = module[0];
    let tokens = tokens(source);
    let mut found = Vec::new();
    for path in root_paths(&tokens, module) {
        let Some(imported) = path.first() else { continue };
        if let Err(breach) = may_import(importer, imported) {
            found.push(breach);
        }
        let Some(part) = path.get(1) else { continue };
        if importer == "render" && imported == "render" && is_technique(part) {
            match module.get(1) {
                Some(own) if is_technique(own) && part != own => {
                    found.push(format!("technique `{own}` must not import technique `{part}`"));
                }
                Some(own) if !is_technique(own) && !KNOW_TECHNIQUES.contains(own) => {
                    found.push(format!("`render::{own}` must not know technique `{part}`"));
                }
                _ => {}
            }
        }
        if importer == "service" && imported == "service" {
            found.extend(module.get(1).and_then(|own| service_breach(own, part)));
        }
        if importer != "service" && imported == "service" && GENERATED.contains(&part.as_str()) {
            found.push(format!("`{importer}` must not name generated types of `service::{part}`"));
        }
    }
    let names = |word: &str, foreign: &str| {
        word.strip_prefix(foreign).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
    };
    for token in &tokens {
        let Token::Word(word) = token else { continue };
        for (modules, crates) in FOREIGN {
            if modules.contains(&importer) && crates.iter().any(|foreign| names(word, foreign)) {
                found.push(format!("`{importer}` must not name `{word}`"));
            }
        }
        if importer != "service" && ONLY_SERVICE.iter().any(|foreign| names(word, foreign)) {
            found.push(format!("only `service` may name `{word}`, not `{importer}`"));
        }
    }
    found
}

/// Returns the path of the module that a file below `src` contains: `render/mod.rs` contains `render`.
fn module_of(file: &Path) -> Vec<String> {
    let mut parts: Vec<String> =
        file.with_extension("").iter().map(|part| part.to_str().expect("names in src are UTF-8").to_owned()).collect();
    if parts.len() > 1 && parts.last().is_some_and(|last| last == "mod") {
        parts.pop();
    }
    parts
}

/// Collects all `.rs` files below `folder`, as paths relative to `root`.
pub fn rust_files(root: &Path, folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("src can be read") {
        let path = entry.expect("src can be read").path();
        if path.is_dir() {
            rust_files(root, &path, files);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path.strip_prefix(root).expect("below src").to_owned());
        }
    }
}

#[test]
fn modules_import_in_one_direction_only() {
    let mut report = Vec::new();
    let mut seen = BTreeSet::new();
    for folder in CRATES {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
        let mut files = Vec::new();
        rust_files(&root, &root, &mut files);
        files.sort();
        for file in &files {
            let module = module_of(file);
            seen.insert(module[0].clone());
            // Skip the root of a library, which only declares modules.
            if module == ["lib"] {
                continue;
            }
            if layer_of(&module[0]).is_none() {
                report.push(format!("{folder}/{}: module `{}` is not in LAYERS", file.display(), module[0]));
                continue;
            }
            let source = std::fs::read_to_string(root.join(file)).expect("source can be read");
            let module: Vec<&str> = module.iter().map(String::as_str).collect();
            let found = breaches(&module, &source);
            report.extend(found.into_iter().map(|breach| format!("{folder}/{}: {breach}", file.display())));
        }
    }
    let missing: Vec<&&str> =
        LAYERS.iter().flat_map(|layer| layer.iter()).filter(|name| !seen.contains(**name)).collect();
    assert!(missing.is_empty(), "modules of LAYERS that do not exist: {missing:?}");
    assert!(report.is_empty(), "imports violate the order of LAYERS:\n{}", report.join("\n"));
}

/// Returns the stems of the techniques' files: their paths below `crates/render/src/render/` without extension. The stem of a `mod.rs` is that of its
/// folder. Layouts and tests are left out.
fn stems(files: &[PathBuf]) -> Vec<String> {
    let mut stems: Vec<String> = files
        .iter()
        .filter_map(|file| file.strip_prefix("render").ok())
        .filter(|file| file.iter().next().is_some_and(|first| techniques().iter().any(|name| first == name.as_str())))
        .map(|file| file.with_extension("").to_str().expect("names in src are UTF-8").to_owned())
        .map(|stem| stem.strip_suffix("/mod").unwrap_or(&stem).to_owned())
        .filter(|stem| !stem.contains("/tests") && !stem.ends_with("/layout"))
        .collect();
    stems.sort();
    stems
}

/// Returns the excuses in the module comments of the techniques' files: stem and reason. An excuse follows the given label, for example in
/// `//! No twin: holds buffers.`
fn excuses(sources: &Path, stems: &[String], label: &str) -> Vec<(String, String)> {
    let line = format!("//! {label}: ");
    let of_stem = |stem: &String| {
        let files = [format!("render/{stem}.rs"), format!("render/{stem}/mod.rs")];
        let text = files.iter().find_map(|file| std::fs::read_to_string(sources.join(file)).ok());
        let text = text.expect("every stem has a file");
        text.lines().find_map(|text| text.strip_prefix(&line)).map(|reason| (stem.clone(), reason.to_owned()))
    };
    stems.iter().filter_map(of_stem).collect()
}

/// Reports stems that have neither a counterpart among `others` nor an excuse, and excuses that are unnecessary. A counterpart has the same path, is
/// below it, or continues the name of the file (`map_level` for `map`).
fn without_counterpart(stems: &[String], others: &[String], excuses: &[(String, String)], kind: &str) -> Vec<String> {
    let has = |stem: &str| {
        others.iter().any(|other| {
            other
                .strip_prefix(stem)
                .is_some_and(|rest| rest.is_empty() || rest.starts_with('/') || rest.starts_with('_'))
        })
    };
    let excused = |stem: &str| excuses.iter().any(|(name, reason)| name == stem && reason.len() > 1);
    let missing = stems.iter().filter(|stem| !has(stem) && !excused(stem));
    let missing =
        missing.map(|stem| format!("crates/render/src/render/{stem} has no counterpart in {kind} and no excuse"));
    let unneeded = excuses.iter().filter(|(name, _)| !stems.iter().any(|stem| stem == name) || has(name));
    missing.chain(unneeded.map(|(name, _)| format!("{name} needs no excuse for {kind}"))).collect()
}

/// Returns the paths, without extension, of all files below a folder that have this extension.
fn stems_below(folder: &Path, extension: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(directory) = open.pop() {
        for entry in std::fs::read_dir(&directory).expect("the folder can be read") {
            let path = entry.expect("the folder can be read").path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|of_path| of_path == extension) {
                let stem = path.strip_prefix(folder).expect("below the folder").with_extension("");
                found.push(stem.to_str().expect("names are UTF-8").to_owned());
            }
        }
    }
    found
}

#[test]
fn every_stem_of_render_has_a_shader_and_a_twin_or_an_excuse() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    let sources = root.join("crates/render/src");
    rust_files(&sources, &sources, &mut files);
    let stems = stems(&files);
    assert!(stems.iter().any(|stem| stem == "stars/splat"), "{stems:?}");
    let no_shader = excuses(&sources, &stems, "No shader");
    let mut report = without_counterpart(&stems, &stems_below(&root.join("shaders"), "wgsl"), &no_shader, "shaders/");
    let twins = stems_below(&sources.join("reference"), "rs");
    report.extend(without_counterpart(
        &stems,
        &twins,
        &excuses(&sources, &stems, "No twin"),
        "crates/render/src/reference/",
    ));
    assert!(report.is_empty(), "{}", report.join("\n"));
}

#[test]
fn the_sequence_stays_short() {
    let text =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/render/src/render/sequence.rs"));
    let lines = text.expect("the sequence can be read").lines().count();
    assert!(lines < 100, "crates/render/src/render/sequence.rs has {lines} lines");
}

mod the_check_itself {
    use super::*;

    fn check(module: &[&str], source: &str) -> Vec<String> {
        breaches(module, source)
    }

    #[test]
    fn violations_are_found_in_every_form() {
        let cases: &[(&[&str], &str)] = &[
            (&["photometry"], "use crate::catalogue::StarRecord;"),
            (&["catalogue"], "use crate::config::Config;"),
            (&["view"], "use crate::{units::PARSEC_M, scene::{self, Body}};"),
            (&["scene", "body"], "fn f(x: &crate::plan::Plan) {}"),
            (&["plan", "budget"], "use super::super::gpu::Device;"),
            (&["plan"], "use super::gpu;"),
            (&["plan"], "use {crate::units, super::render::display::resolve};"),
            (&["plan"], "mod tests { use super::super::render::Frame; }"),
            (&["plan"], "use self::super::render::Frame;"),
            (&["reference", "resolve"], "use crate::render::display::resolve::KERNEL;"),
            (&["reference"], "use crate::gpu::Device;"),
            (&["metrics"], "use crate::reference::resolve;"),
            (&["verify"], "use crate::chart::Workload;"),
            (&["render"], "let a = 'x'; let s: &'static str = \"\\\"\"; crate::output::write()"),
            (&["cli"], "use crate::main::run;"),
            (&["gpu"], "use crate::*;"),
            (&["gpu"], "use crate::nowhere::Thing;"),
            (&["nowhere"], "use crate::units;"),
            (&["plan"], "use ::steradian::gpu;"),
            (&["scene"], "fn f(d: &wgpu::Device) {}"),
            (&["view"], "use tokio::sync::mpsc;"),
            (&["photometry", "rec709"], "use tonic_web as w;"),
            (&["service", "wire", "views"], "use crate::service::frames::video::Rate;"),
            (&["service", "scene", "views"], "use super::super::wire::refusals;"),
            (&["service", "frames"], "use crate::service::CameraUpdate;"),
            (&["service", "client", "scene"], "use crate::service::engine::interface::Engine;"),
            (&["service", "handlers", "find"], "use crate::service::{scene, client::connection::Client};"),
            (&["service", "unknown"], "use crate::service::scene;"),
            (&["render"], "use prost::Message;"),
            (&["render"], "tonic::include_proto!(\"steradian.v1\");"),
            (&["cli", "serve"], "use crate::service::proto::Frame;"),
            (&["render", "glare"], "use crate::render::stars::splat::Splat;"),
            (&["render", "glare", "pyramid"], "use super::super::{glare, display};"),
            (&["render", "glare"], "use super::stars::Splat;"),
            (&["render", "targets"], "use super::stars::Stars;"),
            (&["render", "technique"], "use crate::render::{layout, glare::Glare};"),
        ];
        for (module, source) in cases {
            assert!(!check(module, source).is_empty(), "not found in {module:?}: {source}");
        }
    }

    #[test]
    fn allowed_imports_are_not_reported() {
        let cases: &[(&[&str], &str)] = &[
            (&["photometry", "blackbody"], "use super::rec709::luminance; pub use super::uv_prime; use crate::units;"),
            (&["units"], "mod tests { use super::*; }"),
            (&["config"], "use crate::catalogue::Synth;"),
            (&["scene"], "use crate::view::Pose; pub(crate) fn f() {}"),
            (
                &["plan"],
                "//! [`crate::gpu`] reads this.\n/* crate::render /* nested */ crate::cli */ // wgpu\nuse crate::view;",
            ),
            (&["plan"], "const A: &str = \"crate::gpu and \\\" wgpu\"; const B: &str = r#\"use \"crate::gpu;\"#;"),
            (&["reference", "resolve"], "use crate::{plan::StarMethod as Method, units::{self, PARSEC_M}};"),
            (
                &["render", "glare", "pyramid"],
                "use super::composite; use crate::render::glare::layout; use crate::render::targets::Targets;",
            ),
            (&["render", "sequence"], "use super::{glare::Glare, stars::Stars}; use wgpu::Device;"),
            (&["render", "glare"], "use crate::render::RenderError; use super::RenderError as E;"),
            (&["service", "scene"], "use super::proto; use crate::output::png; use tonic::Status;"),
            (
                &["service", "handlers", "find"],
                "use super::service::Service; use crate::service::{SPANS, wire, network};",
            ),
            (&["service", "client", "scene"], "use crate::service::{proto, scene::state::SceneUpdate, wire};"),
            (&["service", "frames", "video"], "mod tests { use super::*; }"),
            (&["main"], "use steradian::cli; fn main() { steradian::units::lux(); }"),
            (&["gpu"], "fn f<'a>(x: &'a str) -> std::result::Result<(), E> { other::crate_name::g() }"),
        ];
        for (module, source) in cases {
            assert_eq!(check(module, source), Vec::<String>::new(), "wrongly reported in {module:?}: {source}");
        }
    }

    #[test]
    fn the_table_names_every_module_once_and_all_modules_of_the_exceptions() {
        let all: Vec<&str> = LAYERS.iter().flat_map(|layer| layer.iter().copied()).collect();
        assert_eq!(all.iter().collect::<BTreeSet<_>>().len(), all.len());
        for (importer, imported) in SIBLINGS {
            assert!(layer_of(importer).is_some() && layer_of(importer) == layer_of(imported), "{importer}, {imported}");
        }
        for (importer, imported) in REFUSED {
            assert!(layer_of(importer).is_some() && layer_of(imported).is_some(), "{importer}, {imported}");
        }
        for module in FOREIGN.iter().flat_map(|(modules, _)| modules.iter()) {
            assert!(layer_of(module).is_some(), "{module}");
        }
    }

    #[test]
    fn the_head_of_the_service_lists_its_modules_in_order() {
        let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/service/mod.rs"))
            .expect("the module's head can be read");
        let rows = text.lines().filter_map(|line| line.strip_prefix("//! | `")?.split('`').next());
        let listed: Vec<&str> = rows.filter(|module| *module != "client").collect();
        assert_eq!(listed, SERVICE);
        for (importer, imported) in SERVICE_PAIRS {
            assert!(SERVICE.contains(imported) && !SERVICE.contains(importer), "{importer}, {imported}");
        }
    }

    /// The machine's clock may be set at any time, so running code uses the daemon's time instead.
    #[test]
    fn only_the_time_source_of_the_service_reads_the_machines_clock() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/service");
        let mut files = Vec::new();
        rust_files(&root, &root, &mut files);
        let reads = |file: &&PathBuf| {
            let text = std::fs::read_to_string(root.join(file)).expect("the file can be read");
            let code = text.split("#[cfg(test)]").next().unwrap_or_default();
            code.contains("SystemTime::now") && !file.ends_with("tests.rs") && !file.ends_with("fuzz_tests.rs")
        };
        let found: Vec<&PathBuf> = files.iter().filter(reads).collect();
        assert_eq!(found, [Path::new("time_source.rs")]);
    }

    #[test]
    fn a_stem_without_counterpart_and_an_unnecessary_excuse_are_found() {
        let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        let stems = names(&["stars/splat", "glare/map", "overlay"]);
        let others = names(&["stars/splat", "glare/map_gather", "overlay/draw", "starship"]);
        assert!(without_counterpart(&stems, &others, &[], "x").is_empty());
        assert_eq!(without_counterpart(&stems, &others[1..], &[], "x").len(), 1);
        let excuse = |stem: &str, reason: &str| vec![(stem.to_owned(), reason.to_owned())];
        assert_eq!(without_counterpart(&stems, &others[1..], &excuse("stars/splat", "."), "x").len(), 1);
        assert!(without_counterpart(&stems, &others[1..], &excuse("stars/splat", "why."), "x").is_empty());
        assert_eq!(without_counterpart(&stems, &others, &excuse("stars/splat", "why."), "x").len(), 1);
    }

    #[test]
    fn module_paths_follow_from_file_paths() {
        for (file, module) in
            [("units.rs", "units"), ("render/mod.rs", "render"), ("render/stars/mod.rs", "render/stars")]
        {
            assert_eq!(module_of(Path::new(file)).join("/"), module);
        }
        assert_eq!(module_of(Path::new("plan/budget.rs")), ["plan", "budget"]);
    }
}

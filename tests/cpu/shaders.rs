//! Every shader is valid in every combination of its choices. Structures that Rust and WGSL share have the same layout in both. They are declared
//! only in Rust, like shared constants.
#![allow(clippy::unwrap_used, reason = "a failed expectation of a test's own helpers is a failed test")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use naga::valid::{Capabilities, ValidationFlags, Validator};
use steradian::{
    gpu::{ShaderSource, StructField, StructLayout},
    render::{Shader, constant_tables, shaders, struct_layouts},
};

fn parse(name: &str, text: &str) -> naga::Module {
    naga::front::wgsl::parse_str(text).unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(text)))
}

/// Returns every shader with its source.
fn sources() -> Vec<(Shader, ShaderSource)> {
    let shaders = shaders().unwrap_or_else(|error| panic!("{error}"));
    shaders
        .into_iter()
        .map(|shader| {
            let source = shader.resolve().unwrap_or_else(|error| panic!("{shader}: {error}"));
            (shader, source)
        })
        .collect()
}

#[test]
fn every_shader_is_valid() {
    // Allow packing two half floats into a word: it needs no optional feature of the adapter.
    let narrow = Capabilities::SHADER_FLOAT16_IN_FLOAT32;
    let wide = narrow | Capabilities::SHADER_INT64 | Capabilities::SHADER_INT64_ATOMIC_ALL_OPS;
    let mut with_u64 = 0;
    for (shader, source) in sources() {
        let module = parse(&shader.to_string(), &source.text);
        let check =
            |capabilities| Validator::new(ValidationFlags::all(), capabilities).validate(&module).map_err(Box::new);
        check(wide).unwrap_or_else(|error| panic!("{shader}: {error:?}"));
        assert_eq!(check(narrow).is_err(), source.needs_u64, "{shader}: `#requires u64` is missing or unnecessary");
        let entry_points: Vec<_> = module.entry_points.iter().map(|entry| entry.name.as_str()).collect();
        assert_eq!(entry_points, [source.entry_point], "{shader}");
        // Check the form for software drivers too.
        let text = source.for_software().text;
        assert!(
            !text.contains("for (var") && !text.contains("while "),
            "{shader}: a loop tests its condition at its start"
        );
        let module = parse(&shader.to_string(), &text);
        let valid = Validator::new(ValidationFlags::all(), wide).validate(&module);
        valid.unwrap_or_else(|error| panic!("{shader}, for software drivers: {error:?}"));
        with_u64 += usize::from(source.needs_u64);
    }
    assert!(with_u64 > 0);
}

#[test]
fn an_invalid_shader_is_detected() {
    let module = parse("wrong", "@compute @workgroup_size(1) fn main() { let x: u64 = 1lu; }");
    assert!(Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module).is_err());
}

/// Layout of a WGSL struct: its size, and the name and offset of every field.
type WgslLayout = (usize, Vec<(String, usize)>);

/// Returns the layouts that naga computes for the structures in buffers.
fn wgsl_layouts(module: &naga::Module) -> BTreeMap<String, WgslLayout> {
    // Collect only structs in buffers, at any depth. All other structs, including those in workgroup memory, exist only inside a shader and have no
    // counterpart in Rust.
    let of_buffers =
        module.global_variables.iter().filter(|(_, variable)| variable.space != naga::AddressSpace::WorkGroup);
    let mut held: Vec<_> = of_buffers.map(|(_, variable)| variable.ty).collect();
    let mut next = 0;
    while next < held.len() {
        match &module.types[held[next]].inner {
            naga::TypeInner::Array { base, .. } => held.push(*base),
            naga::TypeInner::Struct { members, .. } => held.extend(members.iter().map(|member| member.ty)),
            _ => {}
        }
        next += 1;
    }
    module
        .types
        .iter()
        .filter(|(handle, _)| held.contains(handle))
        .filter_map(|(_, kind)| match (&kind.name, &kind.inner) {
            (Some(name), naga::TypeInner::Struct { members, span }) => {
                let fields = members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset as usize)).collect();
                Some((name.clone(), (*span as usize, fields)))
            }
            _ => None,
        })
        .collect()
}

/// Describes the difference between the layouts of a Rust and a WGSL struct, if there is one.
fn difference(rust: &StructLayout, wgsl: &WgslLayout) -> Option<String> {
    let rust_fields: Vec<(String, usize)> =
        rust.fields.iter().map(|field| (field.name.to_owned(), field.offset)).collect();
    if rust_fields != wgsl.1 {
        return Some(format!("{}: {rust_fields:?} in Rust, {:?} in WGSL", rust.name, wgsl.1));
    }
    (rust.size != wgsl.0).then(|| format!("{}: {} bytes in Rust, {} in WGSL", rust.name, rust.size, wgsl.0))
}

#[test]
fn structures_have_the_same_fields_offsets_and_sizes() {
    let mut used = BTreeSet::new();
    for (shader, source) in sources() {
        for (name, wgsl) in wgsl_layouts(&parse(source.name, &source.text)) {
            if name == "Star" {
                // Compare only the size of the star: it is the catalogue's type, and its offsets are an array in WGSL.
                assert_eq!(wgsl.0, size_of::<steradian::catalogue::packed::PackedStar>());
                continue;
            }
            let rust = struct_layouts().into_iter().find(|rust| rust.name == name);
            let rust = rust.unwrap_or_else(|| panic!("{shader}: the structure {name} is not declared in Rust"));
            assert_eq!(difference(&rust, &wgsl), None, "{shader}");
            used.insert(name);
        }
    }
    for rust in struct_layouts() {
        assert!(used.contains(rust.name), "no shader uses the structure {}", rust.name);
    }
}

/// Returns the layout that naga computes for the generated WGSL of a structure that contains no other structure.
fn generated_layout(rust: &StructLayout) -> WgslLayout {
    let text = format!("{}@group(0) @binding(0) var<storage> variable: {};", rust.wgsl(), rust.name);
    wgsl_layouts(&parse(rust.name, &text)).remove(rust.name).unwrap()
}

#[test]
fn missing_padding_is_found() {
    let layout = |fields: &[(&'static str, usize, &str)], size| {
        let field = |&(name, offset, wgsl): &(&'static str, usize, &str)| StructField {
            name,
            offset,
            wgsl: wgsl.to_owned(),
            contained: None,
        };
        StructLayout { name: "Sample", size, fields: fields.iter().map(field).collect() }
    };
    let padded =
        layout(&[("a", 0, "vec3<f32>"), ("unused_0", 12, "u32"), ("b", 16, "vec3<f32>"), ("c", 28, "f32")], 32);
    assert_eq!(difference(&padded, &generated_layout(&padded)), None);
    // In Rust the second vector directly follows the first one; in WGSL it is at a multiple of 16 bytes.
    let inside = layout(&[("a", 0, "vec3<f32>"), ("b", 12, "vec3<f32>")], 24);
    assert_eq!(
        difference(&inside, &generated_layout(&inside)).unwrap(),
        "Sample: [(\"a\", 0), (\"b\", 12)] in Rust, [(\"a\", 0), (\"b\", 16)] in WGSL"
    );
    // In WGSL the size is a multiple of 16 bytes.
    let at_the_end = layout(&[("a", 0, "vec3<f32>"), ("b", 12, "f32"), ("c", 16, "f32")], 20);
    assert_eq!(
        difference(&at_the_end, &generated_layout(&at_the_end)).unwrap(),
        "Sample: 20 bytes in Rust, 32 in WGSL"
    );
}

/// Returns the names of the structures that a file declares.
fn declared_structs(wgsl: &str) -> impl Iterator<Item = &str> {
    wgsl.lines().filter_map(|line| line.strip_prefix("struct ")?.split_whitespace().next())
}

#[test]
fn shared_structures_are_declared_in_rust_alone() {
    assert_eq!(declared_structs("// struct A {\nstruct B {\n}\nfn structs() {}").collect::<Vec<_>>(), ["B"]);
    for (path, text) in files("shaders", "wgsl") {
        for name in declared_structs(&text) {
            let in_rust = struct_layouts().iter().any(|rust| rust.name == name);
            assert!(!in_rust, "{}: `#import structs/{name}` instead of the declaration", path.display());
        }
    }
}

/// Returns the files in a folder and its subfolders, with their paths from the crate's root.
fn files(folder: &str, extension: &str) -> BTreeMap<PathBuf, String> {
    fn walk(folder: &Path, extension: &str, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(&path, extension, found);
            } else if path.extension().is_some_and(|of_path| of_path == extension) {
                found.push(path);
            }
        }
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = Vec::new();
    walk(&root.join(folder), extension, &mut found);
    found
        .into_iter()
        .map(|path| (path.strip_prefix(root).unwrap().into(), fs::read_to_string(&path).unwrap()))
        .collect()
}

/// Returns all Rust files of the crates.
fn rust_files() -> BTreeMap<PathBuf, String> {
    files("src", "rs").into_iter().chain(files("crates", "rs")).collect()
}

/// Returns the names of the constants that a source in Rust or WGSL declares. Comments are ignored.
fn constants(source: &str) -> BTreeSet<String> {
    let code = source.lines().filter_map(|line| line.split("//").next());
    let declared =
        code.flat_map(|line| line.match_indices("const ").map(move |(start, word)| &line[start + word.len()..]));
    declared
        .filter_map(|after| {
            let end = after.find(|c: char| !c.is_ascii_alphanumeric() && c != '_')?;
            let (name, rest) = after.split_at(end);
            let is_constant =
                name.starts_with(|c: char| c.is_ascii_uppercase()) && rest.trim_start().starts_with([':', '=']);
            is_constant.then(|| name.to_owned())
        })
        .collect()
}

/// WGSL constants with the name of a Rust constant that has a different meaning.
const OTHER_MEANING: &[(&str, &str)] = &[];

/// Reports constants that both WGSL and Rust declare.
fn declared_twice(wgsl: &BTreeSet<String>, rust: &BTreeSet<String>, excused: &[(&str, &str)]) -> Vec<String> {
    wgsl.intersection(rust).filter(|name| excused.iter().all(|(excused, _)| excused != name)).cloned().collect()
}

/// Returns the names of all Rust constants, including those of the shared tables.
fn rust_constants() -> BTreeSet<String> {
    let tables = constant_tables();
    let shared = tables.iter().flat_map(|table| table.constants.iter().map(|(name, ..)| (*name).to_owned()));
    rust_files().values().flat_map(|source| constants(source)).chain(shared).collect()
}

#[test]
fn no_constant_is_declared_in_both_wgsl_and_rust() {
    let rust = rust_constants();
    for (path, text) in files("shaders", "wgsl") {
        let twice = declared_twice(&constants(&text), &rust, OTHER_MEANING);
        assert!(
            twice.is_empty(),
            "{}: {} exist in Rust too; share them in a table in crates/render/src/gpu/constants.rs, or rename them",
            path.display(),
            twice.join(", ")
        );
    }
}

#[test]
fn a_constant_that_is_declared_twice_is_detected() {
    let wgsl =
        constants("// const COMMENT: u32 = 1u;\nconst COLUMNS: u32 = 64u;\n    const INNER = 2.0;\nlet x = constant;");
    assert_eq!(wgsl, ["COLUMNS", "INNER"].map(str::to_owned).into());
    let rust = constants("/// Const generics: const N: usize\npub(crate) const COLUMNS: u32 = 64;\nconst fn side() {}");
    assert_eq!(rust, ["COLUMNS".to_owned()].into());
    assert_eq!(declared_twice(&wgsl, &rust, &[]), ["COLUMNS"]);
    assert!(declared_twice(&wgsl, &rust, &[("COLUMNS", "for this test")]).is_empty());
    let rust = rust_constants();
    assert!(["COLUMNS", "KIND_CUBE_FACE", "PARSEC_M", "MAX_VIEWPORTS"].iter().all(|name| rust.contains(*name)));
}

/// Returns the files that no shader contains.
fn unused(stems: impl IntoIterator<Item = String>, sources: &[(Shader, ShaderSource)]) -> Vec<String> {
    let used =
        |stem: &String| sources.iter().any(|(_, source)| source.text.contains(&format!("// shaders/{stem}.wgsl\n")));
    stems.into_iter().filter(|stem| !used(stem)).collect()
}

#[test]
fn every_file_table_and_structure_is_part_of_a_shader() {
    let sources = sources();
    let stem =
        |path: &PathBuf| path.with_extension("").strip_prefix("shaders").unwrap().to_str().unwrap().replace('\\', "/");
    let stems: Vec<String> = files("shaders", "wgsl").keys().map(stem).collect();
    assert!(stems.len() > 50);
    let tables = constant_tables().into_iter().map(|table| format!("constants/{}", table.name));
    let structs = struct_layouts().into_iter().map(|layout| format!("structs/{}", layout.name));
    assert_eq!(unused(stems.into_iter().chain(tables).chain(structs), &sources), [""; 0]);
    assert_eq!(unused(["constants/none".to_owned()], &sources), ["constants/none"]);
}

/// Whether a shader's text contains code for tabulated projections.
fn knows_tables(text: &str) -> bool {
    ["mapping_tables", "KIND_TABULATED", "@group(3)"].iter().any(|name| text.contains(name))
}

#[test]
fn shaders_of_rigs_without_tables_do_not_contain_table_code() {
    let mut with_tables = 0;
    for (shader, source) in sources() {
        let name = shader.to_string();
        let wanted = name.contains("tabulated = shared/tabulated") && !name.contains("tabulated_off");
        if knows_tables(&source.text) {
            assert!(wanted, "{shader}: reads tables, although it is made for rigs without them");
            with_tables += 1;
        }
    }
    assert!(with_tables > 20, "{with_tables}");
    // A shader for which no choice about tables was made is compiled without table code.
    let resolve = || {
        Shader::new("display/resolve")
            .with("decode", "display/decode_u32")
            .with("faint", "display/faint_map")
            .with("shown", "display/shown")
    };
    let text = |shader: Shader| shader.text().unwrap();
    assert_eq!(text(resolve()), text(resolve().with("tabulated", "shared/tabulated_off")));
    assert!(knows_tables(&text(
        resolve().with("tabulated", "shared/tabulated").with("tables", "shared/tables_buffer")
    )));
}

#[test]
fn a_table_has_the_same_values_in_wgsl_and_rust() {
    for table in constant_tables() {
        let module = parse(table.name, &table.wgsl());
        assert_eq!(module.constants.len(), table.constants.len(), "{}", table.name);
    }
}

/// Returns the names of shaders in a Rust source: the literal arguments of `Shader::new`.
fn named_shaders(source: &str) -> BTreeSet<String> {
    let after = source.split("Shader::new(\"").skip(1);
    after.filter_map(|text| text.split('"').next()).map(str::to_owned).collect()
}

#[test]
fn shaders_named_in_rust_exist_and_all_are_used() {
    let entries: BTreeSet<&str> = sources().iter().map(|(_, source)| source.name).collect();
    let code = rust_files();
    for (path, source) in &code {
        for name in named_shaders(source) {
            assert!(entries.contains(name.as_str()), "{}: the shader `{name}` does not exist", path.display());
        }
    }
    for entry in entries {
        assert!(
            code.values().any(|source| source.contains(&format!("\"{entry}\""))),
            "no code uses the shader `{entry}`"
        );
    }
    assert_eq!(named_shaders("a(&Shader::new(\"stars/none\").source())"), ["stars/none".to_owned()].into());
}

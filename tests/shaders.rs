//! Every shader module is valid, and the structs that Rust and WGSL share have the same layout.

use std::collections::BTreeMap;

use naga::valid::{Capabilities, ValidationFlags, Validator};
use steradian::{gpu::sources, render::layout};

fn parse(name: &str, text: &str) -> naga::Module {
    naga::front::wgsl::parse_str(text).unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(text)))
}

#[test]
fn every_entry_point_is_valid() {
    for source in sources() {
        let module = parse(source.name, &source.text);
        // Packing two halves in a word needs no optional feature of the adapter.
        let mut capabilities = Capabilities::SHADER_FLOAT16_IN_FLOAT32;
        if source.needs_u64 {
            capabilities |= Capabilities::SHADER_INT64 | Capabilities::SHADER_INT64_ATOMIC_ALL_OPS;
        }
        Validator::new(ValidationFlags::all(), capabilities)
            .validate(&module)
            .unwrap_or_else(|error| panic!("{}: {error:?}", source.name));
        let entry_points: Vec<_> = module.entry_points.iter().map(|entry| entry.name.as_str()).collect();
        assert_eq!(entry_points, [source.entry_point], "{}", source.name);
    }
}

#[test]
fn an_invalid_shader_is_found() {
    let module = parse("wrong", "@compute @workgroup_size(1) fn main() { let x: u64 = 1lu; }");
    assert!(Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module).is_err());
}

/// What WGSL says of a struct: its size, and name and offset of every field.
type WgslLayout = (usize, Vec<(String, usize)>);

fn wgsl_layouts(module: &naga::Module) -> BTreeMap<String, WgslLayout> {
    // What buffers hold, at any depth; other structs stay inside of a shader and have no counterpart.
    let mut held: Vec<_> = module.global_variables.iter().map(|(_, variable)| variable.ty).collect();
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

/// Where a struct of Rust and one of WGSL differ.
fn difference(rust: &layout::StructLayout, wgsl: &WgslLayout) -> Option<String> {
    let rust_fields: Vec<(String, usize)> =
        rust.fields.iter().map(|(name, offset)| ((*name).to_owned(), *offset)).collect();
    if rust.size != wgsl.0 {
        return Some(format!("{}: {} bytes in Rust, {} in WGSL", rust.name, rust.size, wgsl.0));
    }
    (rust_fields != wgsl.1).then(|| format!("{}: {rust_fields:?} in Rust, {:?} in WGSL", rust.name, wgsl.1))
}

#[test]
fn structs_have_the_same_fields_offsets_and_sizes() {
    let mut seen = BTreeMap::new();
    for source in sources() {
        for (name, wgsl) in wgsl_layouts(&parse(source.name, &source.text)) {
            if name == "Star" {
                // The star is the catalogue's own type, with its offsets as an array.
                assert_eq!(wgsl.0, size_of::<steradian::catalogue::packed::PackedStar>());
                continue;
            }
            let rust = layout::struct_layouts().into_iter().find(|rust| rust.name == name);
            let rust = rust.unwrap_or_else(|| panic!("{}: struct {name} has no counterpart in Rust", source.name));
            assert_eq!(difference(&rust, &wgsl), None, "{}", source.name);
            seen.insert(name, ());
        }
    }
    for rust in layout::struct_layouts() {
        assert!(seen.contains_key(rust.name), "no shader has the struct {}", rust.name);
    }
}

#[test]
fn a_moved_field_and_a_wrong_size_are_found() {
    let rust = layout::struct_layouts().into_iter().find(|rust| rust.name == "Tile").unwrap();
    let right: Vec<(String, usize)> = rust.fields.iter().map(|(name, offset)| ((*name).to_owned(), *offset)).collect();
    assert_eq!(difference(&rust, &(rust.size, right.clone())), None);
    let mut swapped = right.clone();
    swapped.swap(1, 2);
    assert!(difference(&rust, &(rust.size, swapped)).is_some());
    assert!(difference(&rust, &(rust.size + 16, right)).is_some());
}

//! Every shader can be translated for Metal and Direct3D, except those with 64-bit atomics, for which there is another variant.
#![allow(clippy::unwrap_used, reason = "a failed expectation of a test's own helpers is a failed test")]

use naga::{
    back::{PipelineConstants, hlsl, msl, pipeline_constants::process_overrides},
    valid::{Capabilities, ModuleInfo, ValidationFlags, Validator},
};
use steradian::render::{Shader, shaders};

/// Value of a constant without default: the number of a workgroup's invocations, a method, a law or a switch.
const ANY_VALUE: f64 = 1.0;

fn parsed(text: &str) -> (naga::Module, ModuleInfo) {
    let module = naga::front::wgsl::parse_str(text).unwrap();
    let info = Validator::new(ValidationFlags::all(), Capabilities::all()).validate(&module).unwrap();
    let unset = module.overrides.iter().filter(|(_, constant)| constant.init.is_none());
    let mut constants = PipelineConstants::default();
    constants.extend(unset.filter_map(|(_, constant)| Some((constant.name.clone()?, ANY_VALUE))));
    let (module, info) = process_overrides(&module, &info, None, &constants).unwrap();
    (module.into_owned(), info.into_owned())
}

/// The Metal shading language of a shader, or why it has none.
fn metal(text: &str) -> Result<String, String> {
    let (module, info) = parsed(text);
    let options = msl::Options { lang_version: (2, 4), fake_missing_bindings: true, ..msl::Options::default() };
    let translated = msl::write_string(&module, &info, &options, &msl::PipelineOptions::default());
    let (text, about) = translated.map_err(|error| error.to_string())?;
    match about.entry_point_names.into_iter().next() {
        Some(Ok(_)) => Ok(text),
        Some(Err(error)) => Err(error.to_string()),
        None => Err("no entry point".to_owned()),
    }
}

/// The shading language of Direct3D of a shader, or why it has none.
fn direct3d(text: &str) -> Result<String, String> {
    let (module, info) = parsed(text);
    let options = hlsl::Options {
        shader_model: hlsl::ShaderModel::V6_0,
        fake_missing_bindings: true,
        ..hlsl::Options::default()
    };
    let mut text = String::new();
    let pipeline = hlsl::PipelineOptions::default();
    hlsl::Writer::new(&mut text, &options, &pipeline).write(&module, &info, None).map_err(|error| error.to_string())?;
    Ok(text)
}

/// The same shader with sums and samples in words of 32 bits.
fn without_64_bits(shader: &Shader) -> String {
    shader.to_string().replace("_u64", "_u32")
}

#[test]
fn every_shader_without_64_bit_atomics_is_translated_for_metal_and_direct3d() {
    let all = shaders().unwrap();
    let names: Vec<String> = all.iter().map(Shader::to_string).collect();
    let (mut translated, mut replaced) = (0, 0);
    for shader in &all {
        let source = shader.resolve().unwrap();
        if source.needs_u64 {
            assert!(names.contains(&without_64_bits(shader)), "{shader}: no variant without 64-bit atomics");
            replaced += 1;
            continue;
        }
        for (language, text) in [("Metal", metal(&source.text)), ("Direct3D", direct3d(&source.text))] {
            let text = text.unwrap_or_else(|error| panic!("{shader}, {language}: {error}"));
            assert!(text.contains(source.entry_point), "{shader}, {language}: no entry point");
        }
        translated += 1;
    }
    println!("{translated} variants translated; {replaced} with 64-bit atomics have a variant without");
    assert!(translated > 100 && replaced > 10);
}

#[test]
fn a_shader_that_cannot_be_translated_is_found() {
    let wide = "@group(0) @binding(0) var<storage, read_write> sum: atomic<u64>;
        @compute @workgroup_size(1) fn main() { atomicAdd(&sum, 1lu); }";
    assert!(metal(wide).is_err());
    let narrow = wide.replace("u64", "u32").replace("1lu", "1u");
    assert!(metal(&narrow).unwrap().contains("main") && direct3d(&narrow).unwrap().contains("main"));
}

//! Every shader can be translated for Direct3D and Metal. Metal has no 64-bit atomic additions, so the variants without them are used there.
#![allow(clippy::unwrap_used, reason = "a failed expectation of a test's own helpers is a failed test")]

use naga::{
    back::{PipelineConstants, hlsl, msl, pipeline_constants::process_overrides},
    valid::{Capabilities, ModuleInfo, ValidationFlags, Validator},
};
use steradian::render::{Shader, shaders};

/// Value for constants that have no default: the number of a workgroup's invocations, a method, a law or a switch.
const ANY_VALUE: f64 = 1.0;

/// Parses a module, checks that it needs only the capabilities of a language, and sets its constants.
fn parsed(text: &str, able: Capabilities) -> Result<(naga::Module, ModuleInfo), String> {
    let module = naga::front::wgsl::parse_str(text).map_err(|error| error.to_string())?;
    let info = Validator::new(ValidationFlags::all(), able).validate(&module).map_err(|error| format!("{error:?}"))?;
    let unset = module.overrides.iter().filter(|(_, constant)| constant.init.is_none());
    let mut constants = PipelineConstants::default();
    constants.extend(unset.filter_map(|(_, constant)| Some((constant.name.clone()?, ANY_VALUE))));
    let (module, info) = process_overrides(&module, &info, None, &constants).map_err(|error| error.to_string())?;
    Ok((module.into_owned(), info.into_owned()))
}

/// Translates a shader to the Metal shading language. The error gives the reason if this is impossible.
fn metal(text: &str) -> Result<String, String> {
    let (module, info) = parsed(text, msl::supported_capabilities())?;
    let options = msl::Options { lang_version: (2, 4), fake_missing_bindings: true, ..msl::Options::default() };
    let translated = msl::write_string(&module, &info, &options, &msl::PipelineOptions::default());
    let (text, about) = translated.map_err(|error| error.to_string())?;
    match about.entry_point_names.into_iter().next() {
        Some(Ok(_)) => Ok(text),
        Some(Err(error)) => Err(error.to_string()),
        None => Err("no entry point".to_owned()),
    }
}

/// Translates a shader to the shading language of Direct3D. The error gives the reason if this is impossible. Version 6.6 has 64-bit atomics.
fn direct3d(text: &str, wide: bool) -> Result<String, String> {
    let able = hlsl::supported_capabilities();
    let (module, info) = parsed(text, if wide { able } else { able - Capabilities::SHADER_INT64_ATOMIC_ALL_OPS })?;
    let shader_model = if wide { hlsl::ShaderModel::V6_6 } else { hlsl::ShaderModel::V6_0 };
    let options = hlsl::Options { shader_model, fake_missing_bindings: true, ..hlsl::Options::default() };
    let mut text = String::new();
    let pipeline = hlsl::PipelineOptions::default();
    hlsl::Writer::new(&mut text, &options, &pipeline).write(&module, &info, None).map_err(|error| error.to_string())?;
    Ok(text)
}

/// Returns the same shader with sums and samples in 32-bit words.
fn without_64_bits(shader: &Shader) -> String {
    shader.to_string().replace("_u64", "_u32")
}

#[test]
fn every_shader_is_translated_for_metal_and_direct3d() {
    let all = shaders().unwrap();
    let names: Vec<String> = all.iter().map(Shader::to_string).collect();
    let (mut for_both, mut wide) = (0, 0);
    for shader in &all {
        let source = shader.resolve().unwrap();
        let text = direct3d(&source.text, source.needs_u64).unwrap_or_else(|error| panic!("{shader}: {error}"));
        assert!(text.contains(source.entry_point), "{shader}: no entry point");
        if source.needs_u64 {
            assert!(metal(&source.text).is_err(), "{shader}: Metal now supports 64-bit additions");
            assert!(names.contains(&without_64_bits(shader)), "{shader}: there is no variant without 64-bit atomics");
            wide += 1;
            continue;
        }
        let text = metal(&source.text).unwrap_or_else(|error| panic!("{shader}: {error}"));
        assert!(text.contains(source.entry_point), "{shader}: no entry point");
        for_both += 1;
    }
    println!(
        "{for_both} variants for both; {wide} variants with 64-bit atomics only for Direct3D, each of which has a variant for both"
    );
    assert!(for_both > 100 && wide > 10);
}

#[test]
fn a_shader_that_cannot_be_translated_is_found() {
    let wide = "@group(0) @binding(0) var<storage, read_write> sum: atomic<u64>;
        @compute @workgroup_size(1) fn main() { atomicAdd(&sum, 1lu); }";
    assert!(metal(wide).is_err() && direct3d(wide, false).is_err());
    assert!(direct3d(wide, true).unwrap().contains("main"));
    let narrow = wide.replace("u64", "u32").replace("1lu", "1u");
    assert!(metal(&narrow).unwrap().contains("main") && direct3d(&narrow, false).unwrap().contains("main"));
}

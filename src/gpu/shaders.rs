//! Shader sources. WGSL has no import: each entry point's module is the concatenation of the files it names.

/// A complete shader module.
#[derive(Clone, Debug)]
pub struct ShaderSource {
    /// Name, for labels and messages.
    pub name: &'static str,
    /// Entry point.
    pub entry_point: &'static str,
    /// WGSL.
    pub text: String,
    /// Whether it needs 64-bit integers and atomics.
    pub needs_u64: bool,
}

const VIEWPORT: &str = include_str!("../../shaders/shared/viewport.wgsl");
const MATH: &str = include_str!("../../shaders/shared/math.wgsl");
const PROJECTION: &str = include_str!("../../shaders/shared/projection.wgsl");
const RELATIVITY: &str = include_str!("../../shaders/shared/relativity.wgsl");
const DISPLAY: &str = include_str!("../../shaders/shared/display.wgsl");
const EXPOSURE: &str = include_str!("../../shaders/shared/exposure.wgsl");
const PIXEL_GRID: &str = include_str!("../../shaders/shared/pixel_grid.wgsl");

/// The star pass.
pub fn stars(wide: bool) -> ShaderSource {
    let accumulate = if wide {
        include_str!("../../shaders/shared/accumulate_u64.wgsl")
    } else {
        include_str!("../../shaders/shared/accumulate_u32.wgsl")
    };
    let text = [VIEWPORT, MATH, PROJECTION, RELATIVITY, accumulate, include_str!("../../shaders/stars.wgsl")].concat();
    ShaderSource {
        name: if wide { "stars u64" } else { "stars u32" },
        entry_point: "splat_stars",
        text,
        needs_u64: wide,
    }
}

/// The resolve pass.
pub fn resolve(wide: bool) -> ShaderSource {
    let decode = if wide {
        include_str!("../../shaders/shared/decode_u64.wgsl")
    } else {
        include_str!("../../shaders/shared/decode_u32.wgsl")
    };
    let text =
        [VIEWPORT, MATH, PROJECTION, DISPLAY, PIXEL_GRID, decode, include_str!("../../shaders/resolve.wgsl")].concat();
    ShaderSource {
        name: if wide { "resolve u64" } else { "resolve u32" },
        entry_point: "resolve",
        text,
        needs_u64: false,
    }
}

/// The exposure pass.
pub fn exposure() -> ShaderSource {
    let text = [EXPOSURE, include_str!("../../shaders/exposure.wgsl")].concat();
    ShaderSource { name: "exposure", entry_point: "choose_exposure", text, needs_u64: false }
}

/// The tone-mapping pass.
pub fn tone_map() -> ShaderSource {
    let text = [VIEWPORT, MATH, DISPLAY, EXPOSURE, PIXEL_GRID, include_str!("../../shaders/tone_map.wgsl")].concat();
    ShaderSource { name: "tone map", entry_point: "tone_map", text, needs_u64: false }
}

/// Evaluates the projections at given points, for tests and diagnostics.
pub fn projection_probe() -> ShaderSource {
    let text = [VIEWPORT, MATH, PROJECTION, include_str!("../../shaders/projection_probe.wgsl")].concat();
    ShaderSource { name: "projection probe", entry_point: "probe", text, needs_u64: false }
}

/// Every shader module of the crate.
pub fn sources() -> Vec<ShaderSource> {
    vec![stars(true), stars(false), resolve(true), resolve(false), exposure(), tone_map(), projection_probe()]
}

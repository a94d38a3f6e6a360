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
const GAUSSIAN: &str = include_str!("../../shaders/shared/gaussian.wgsl");
const STAR: &str = include_str!("../../shaders/shared/star.wgsl");
const TRIANGLES: &str = include_str!("../../shaders/shared/triangle_solid_angle.wgsl");
const PACKED_SPLAT: &str = include_str!("../../shaders/shared/packed_splat.wgsl");
const CATALOGUE_STAR: &str = include_str!("../../shaders/shared/catalogue_star.wgsl");
const PIXEL_GRID: &str = include_str!("../../shaders/shared/pixel_grid.wgsl");

/// The star pass.
pub fn stars(wide: bool) -> ShaderSource {
    let accumulate = if wide {
        include_str!("../../shaders/shared/accumulate_u64.wgsl")
    } else {
        include_str!("../../shaders/shared/accumulate_u32.wgsl")
    };
    let text = [
        VIEWPORT,
        MATH,
        PROJECTION,
        GAUSSIAN,
        STAR,
        RELATIVITY,
        PIXEL_GRID,
        accumulate,
        include_str!("../../shaders/stars.wgsl"),
    ]
    .concat();
    ShaderSource {
        name: if wide { "stars u64" } else { "stars u32" },
        entry_point: "splat_stars",
        text,
        needs_u64: wide,
    }
}

/// The published rasteriser on every star of the catalogue.
pub fn packed_cas() -> ShaderSource {
    let text = [
        VIEWPORT,
        MATH,
        PROJECTION,
        TRIANGLES,
        PACKED_SPLAT,
        CATALOGUE_STAR,
        include_str!("../../shaders/packed_cas.wgsl"),
    ]
    .concat();
    ShaderSource { name: "packed CAS", entry_point: "splat_catalogue", text, needs_u64: false }
}

/// The published rasteriser on culled and sorted stars.
pub fn packed_cas_sorted() -> ShaderSource {
    let text = [
        VIEWPORT,
        MATH,
        PROJECTION,
        TRIANGLES,
        PACKED_SPLAT,
        STAR,
        include_str!("../../shaders/packed_cas_sorted.wgsl"),
    ]
    .concat();
    ShaderSource { name: "packed CAS sorted", entry_point: "splat_sorted", text, needs_u64: false }
}

/// Where a method that leaves luminance instead of illuminance has left it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LuminanceSource {
    /// Halves of a word: the published rasteriser.
    Packed,
}

/// The resolve pass of methods that leave luminance.
pub fn resolve_luminance(source: LuminanceSource) -> ShaderSource {
    let (name, of_pixel) = match source {
        LuminanceSource::Packed => ("resolve packed", include_str!("../../shaders/shared/luminance_packed.wgsl")),
    };
    let text = [VIEWPORT, MATH, PROJECTION, PIXEL_GRID, of_pixel, include_str!("../../shaders/resolve_luminance.wgsl")]
        .concat();
    ShaderSource { name, entry_point: "resolve_luminance", text, needs_u64: false }
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
    vec![
        stars(true),
        stars(false),
        packed_cas(),
        packed_cas_sorted(),
        resolve_luminance(LuminanceSource::Packed),
        resolve(true),
        resolve(false),
        exposure(),
        tone_map(),
        projection_probe(),
    ]
}

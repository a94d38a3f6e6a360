//! Shader sources. WGSL has no import: each entry point's module is the concatenation of the files it names.

use crate::plan::glare::pyramid::PyramidAxes;

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

pub(super) const VIEWPORT: &str = include_str!("../../shaders/shared/viewport.wgsl");
pub(super) const MATH: &str = include_str!("../../shaders/shared/math.wgsl");
pub(super) const PROJECTION: &str = include_str!("../../shaders/shared/projection.wgsl");
const RELATIVITY: &str = include_str!("../../shaders/shared/relativity.wgsl");
const DISPLAY: &str = include_str!("../../shaders/shared/display.wgsl");
const EXPOSURE: &str = include_str!("../../shaders/shared/exposure.wgsl");
const GAUSSIAN: &str = include_str!("../../shaders/shared/gaussian.wgsl");
const PLANE_GAUSSIAN: &str = include_str!("../../shaders/shared/plane_gaussian.wgsl");
const STAR: &str = include_str!("../../shaders/shared/star.wgsl");
const TRIANGLES: &str = include_str!("../../shaders/shared/triangle_solid_angle.wgsl");
const PACKED_SPLAT: &str = include_str!("../../shaders/shared/packed_splat.wgsl");
const CATALOGUE_STAR: &str = include_str!("../../shaders/shared/catalogue_star.wgsl");
const BILLBOARD: &str = include_str!("../../shaders/shared/billboard.wgsl");
const SKY_CUBE: &str = include_str!("../../shaders/shared/sky_cube.wgsl");
const GLARE_SPRITES: &str = include_str!("../../shaders/shared/glare_sprites.wgsl");
const GLARE_SCALE: &str = include_str!("../../shaders/shared/glare_scale.wgsl");
const GLARE_CONE: &str = include_str!("../../shaders/shared/glare_cone.wgsl");
pub(super) const ASTEROID_INSTANCE: &str = include_str!("../../shaders/shared/asteroid_instance.wgsl");
const ASTEROID_CLASS: &str = include_str!("../../shaders/shared/asteroid_class.wgsl");
pub(super) const ASTEROID_LISTS: &str = include_str!("../../shaders/shared/asteroid_lists.wgsl");
pub(super) const ASTEROID: &str = include_str!("../../shaders/shared/asteroid.wgsl");
const PIXEL_GRID: &str = include_str!("../../shaders/shared/pixel_grid.wgsl");
const SPLAT: &str = include_str!("../../shaders/shared/splat.wgsl");
const ELLIPSOID: &str = include_str!("../../shaders/shared/ellipsoid.wgsl");
const GEOMETRY: &str = include_str!("../../shaders/shared/geometry.wgsl");
const OCCLUSION: &str = include_str!("../../shaders/shared/occlusion.wgsl");
pub(super) const REFLECTION: &str = include_str!("../../shaders/shared/reflection.wgsl");

/// What every pass needs that splats in fixed point, with 64-bit words or without.
fn splatting(wide: bool) -> String {
    let accumulate = if wide {
        include_str!("../../shaders/shared/accumulate_u64.wgsl")
    } else {
        include_str!("../../shaders/shared/accumulate_u32.wgsl")
    };
    [
        VIEWPORT,
        MATH,
        PROJECTION,
        GAUSSIAN,
        PLANE_GAUSSIAN,
        PIXEL_GRID,
        accumulate,
        SPLAT,
        ELLIPSOID,
        GEOMETRY,
        OCCLUSION,
    ]
    .concat()
}

/// The geometry pass: bodies, and layers of asteroids.
pub fn geometry() -> ShaderSource {
    let geometry = include_str!("../../shaders/geometry.wgsl");
    let text = [VIEWPORT, MATH, PROJECTION, ELLIPSOID, GEOMETRY, REFLECTION, geometry].concat();
    ShaderSource { name: "geometry", entry_point: "draw_geometry", text, needs_u64: false }
}

/// The point pass: points of light that are no stars.
pub fn points(wide: bool) -> ShaderSource {
    let text = [&splatting(wide), include_str!("../../shaders/points.wgsl")].concat();
    ShaderSource {
        name: if wide { "points u64" } else { "points u32" },
        entry_point: "splat_points",
        text,
        needs_u64: wide,
    }
}

/// The star pass.
pub fn stars(wide: bool) -> ShaderSource {
    let text = [&splatting(wide), STAR, RELATIVITY, include_str!("../../shaders/stars.wgsl")].concat();
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
    /// A texture of the picture itself.
    Texture,
    /// Six textures: the faces of a cube around the view's axes.
    Cube,
    /// Nowhere: the procedural sky is computed here.
    CellSky,
}

/// The resolve pass of methods that leave luminance.
pub fn resolve_luminance(source: LuminanceSource) -> ShaderSource {
    let (name, of_pixel) = match source {
        LuminanceSource::Packed => ("resolve packed", include_str!("../../shaders/shared/luminance_packed.wgsl")),
        LuminanceSource::Texture => ("resolve texture", include_str!("../../shaders/shared/luminance_texture.wgsl")),
        LuminanceSource::Cube => ("resolve cube", include_str!("../../shaders/shared/luminance_cube.wgsl")),
        LuminanceSource::CellSky => ("resolve cell sky", include_str!("../../shaders/shared/luminance_cell_sky.wgsl")),
    };
    let of_sky = if source == LuminanceSource::CellSky { include_str!("../../shaders/cell_sky.wgsl") } else { "" };
    let resolve = include_str!("../../shaders/resolve_luminance.wgsl");
    let text = [VIEWPORT, MATH, PROJECTION, PIXEL_GRID, of_sky, of_pixel, resolve].concat();
    ShaderSource { name, entry_point: "resolve_luminance", text, needs_u64: false }
}

/// How the light of a star is spread over its billboard: one fragment shader each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Profile {
    /// A whole pixel.
    Point,
    /// The share of a pixel that a small disc covers.
    SmoothPoint,
    /// Constant luminance.
    Disc,
    /// A cone.
    Cone,
    /// A cone and a glare.
    Glare,
    /// Two Gaussians at the pixel's centre.
    Gaussian,
    /// Two Gaussians averaged over the pixel.
    GaussianIntegrated,
    /// A round spot on the screen.
    Screen,
    /// An image.
    Sprite,
    /// An image of a point-spread function.
    Psf,
}

impl Profile {
    const ALL: [Self; 10] = [
        Self::Point,
        Self::SmoothPoint,
        Self::Disc,
        Self::Cone,
        Self::Glare,
        Self::Gaussian,
        Self::GaussianIntegrated,
        Self::Screen,
        Self::Sprite,
        Self::Psf,
    ];

    /// Whether it reads an image of a star.
    pub fn has_image(self) -> bool {
        matches!(self, Self::Sprite | Self::Psf)
    }
}

/// The vertex shader of the methods that blend.
pub fn billboard_vertex() -> ShaderSource {
    let text = [
        VIEWPORT,
        MATH,
        PROJECTION,
        TRIANGLES,
        CATALOGUE_STAR,
        BILLBOARD,
        include_str!("../../shaders/shared/billboard_vertex.wgsl"),
    ]
    .concat();
    ShaderSource { name: "billboards", entry_point: "place_star", text, needs_u64: false }
}

/// The fragment shader of the methods that blend with that profile.
pub fn billboard_fragment(profile: Profile) -> ShaderSource {
    let (name, of_profile) = match profile {
        Profile::Point => ("point", include_str!("../../shaders/shared/profile_point.wgsl")),
        Profile::SmoothPoint => ("smooth point", include_str!("../../shaders/shared/profile_smooth_point.wgsl")),
        Profile::Disc => ("disc", include_str!("../../shaders/shared/profile_disc.wgsl")),
        Profile::Cone => ("cone", include_str!("../../shaders/shared/profile_cone.wgsl")),
        Profile::Glare => ("glare", include_str!("../../shaders/shared/profile_glare.wgsl")),
        Profile::Gaussian => ("Gaussian", include_str!("../../shaders/shared/profile_gaussian.wgsl")),
        Profile::GaussianIntegrated => {
            ("Gaussian integrated", include_str!("../../shaders/shared/profile_gaussian_integrated.wgsl"))
        }
        Profile::Screen => ("screen billboard", include_str!("../../shaders/shared/profile_screen.wgsl")),
        Profile::Sprite => ("sprite", include_str!("../../shaders/shared/profile_sprite.wgsl")),
        Profile::Psf => ("PSF", include_str!("../../shaders/shared/profile_psf.wgsl")),
    };
    let image = if profile.has_image() { include_str!("../../shaders/shared/star_image.wgsl") } else { "" };
    let fragment = include_str!("../../shaders/shared/billboard_fragment.wgsl");
    let text = [VIEWPORT, BILLBOARD, image, of_profile, fragment].concat();
    ShaderSource { name, entry_point: "shade_star", text, needs_u64: false }
}

/// Counts the stars of the catalogue that lie in a picture.
pub fn count_stars() -> ShaderSource {
    let text = [VIEWPORT, MATH, PROJECTION, CATALOGUE_STAR, include_str!("../../shaders/count_stars.wgsl")].concat();
    ShaderSource { name: "count stars", entry_point: "count_stars", text, needs_u64: false }
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

/// Where the glare pass over pixels finds what is scattered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GlareSource {
    /// On the sky: a map of the whole sky, and the brightest sources one by one.
    Sky,
    /// On the picture: a pyramid of blurred images.
    Pyramid,
}

/// The glare pass over pixels.
pub fn glare_composite(source: GlareSource) -> ShaderSource {
    let (name, of_source) = match source {
        GlareSource::Sky => {
            ("glare sky", [SKY_CUBE, GLARE_SPRITES, include_str!("../../shaders/shared/glare_sky.wgsl")])
        }
        GlareSource::Pyramid => {
            ("glare pyramid", [GLARE_SCALE, include_str!("../../shaders/shared/glare_pyramid.wgsl"), ""])
        }
    };
    let composite = include_str!("../../shaders/glare_composite.wgsl");
    let text = [VIEWPORT, MATH, PROJECTION, PIXEL_GRID, &of_source.concat(), composite].concat();
    ShaderSource { name, entry_point: "composite_glare", text, needs_u64: false }
}

/// A level of the map of glare.
pub fn glare_gather() -> ShaderSource {
    let text = [VIEWPORT, MATH, PROJECTION, SKY_CUBE, include_str!("../../shaders/glare_gather.wgsl")].concat();
    ShaderSource { name: "glare gather", entry_point: "gather", text, needs_u64: false }
}

/// Sharpens a level of the map of glare.
pub fn glare_sharpen() -> ShaderSource {
    let text = include_str!("../../shaders/glare_sharpen.wgsl").to_owned();
    ShaderSource { name: "glare sharpen", entry_point: "sharpen", text, needs_u64: false }
}

/// Finds the sprites of every square of blocks of pixels.
pub fn glare_find() -> ShaderSource {
    let find = include_str!("../../shaders/glare_find.wgsl");
    let text = [VIEWPORT, MATH, PROJECTION, PIXEL_GRID, GLARE_SPRITES, GLARE_CONE, find].concat();
    ShaderSource { name: "glare find", entry_point: "find_sprites", text, needs_u64: false }
}

/// Gives every block of pixels its sprites.
pub fn glare_assign() -> ShaderSource {
    let assign = include_str!("../../shaders/glare_assign.wgsl");
    let text = [VIEWPORT, MATH, PROJECTION, PIXEL_GRID, GLARE_SPRITES, GLARE_CONE, assign].concat();
    ShaderSource { name: "glare assign", entry_point: "assign_sprites", text, needs_u64: false }
}

/// The brightest channel of a frame, for glare.
pub fn glare_maximum() -> ShaderSource {
    let text = [VIEWPORT, PIXEL_GRID, include_str!("../../shaders/glare_maximum.wgsl")].concat();
    ShaderSource { name: "glare maximum", entry_point: "find_maximum", text, needs_u64: false }
}

/// The base of a glare pyramid.
pub fn glare_base() -> ShaderSource {
    let text = [VIEWPORT, GLARE_SCALE, include_str!("../../shaders/glare_base.wgsl")].concat();
    ShaderSource { name: "glare base", entry_point: "fill_base", text, needs_u64: false }
}

/// A blur of a glare pyramid along one of these axes.
pub fn glare_blur(axes: PyramidAxes) -> ShaderSource {
    let (name, taps) = match axes {
        PyramidAxes::Screen => ("glare blur screen", include_str!("../../shaders/shared/glare_taps_screen.wgsl")),
        PyramidAxes::View => ("glare blur view", include_str!("../../shaders/shared/glare_taps_view.wgsl")),
    };
    let blur = include_str!("../../shaders/glare_blur.wgsl");
    let text = [VIEWPORT, MATH, PROJECTION, GLARE_SCALE, taps, blur].concat();
    ShaderSource { name, entry_point: "blur_level", text, needs_u64: false }
}

/// The sum over the levels of a glare pyramid.
pub fn glare_combine() -> ShaderSource {
    let text = [GLARE_SCALE, include_str!("../../shaders/glare_combine.wgsl")].concat();
    ShaderSource { name: "glare combine", entry_point: "combine_levels", text, needs_u64: false }
}

/// Culling and detail of asteroids: counts and lists.
pub fn asteroid_cull() -> ShaderSource {
    let cull = include_str!("../../shaders/asteroid_cull.wgsl");
    let text = [VIEWPORT, MATH, PROJECTION, ASTEROID_INSTANCE, ASTEROID_CLASS, ASTEROID_LISTS, cull].concat();
    ShaderSource { name: "asteroid cull", entry_point: "cull", text, needs_u64: false }
}

/// Turns counts of asteroids into places in their lists.
pub fn asteroid_scan() -> ShaderSource {
    let text = [ASTEROID_LISTS, include_str!("../../shaders/asteroid_scan.wgsl")].concat();
    ShaderSource { name: "asteroid scan", entry_point: "scan", text, needs_u64: false }
}

/// Places the lists of asteroids and writes the arguments of their draws.
pub fn asteroid_offsets() -> ShaderSource {
    let text = [ASTEROID_LISTS, include_str!("../../shaders/asteroid_offsets.wgsl")].concat();
    ShaderSource { name: "asteroid offsets", entry_point: "place_lists", text, needs_u64: false }
}

/// Asteroids that are points.
pub fn asteroid_points(wide: bool) -> ShaderSource {
    let phase = include_str!("../../shaders/shared/asteroid_phase.wgsl");
    let points = include_str!("../../shaders/asteroid_points.wgsl");
    ShaderSource {
        name: if wide { "asteroid points u64" } else { "asteroid points u32" },
        entry_point: "splat_asteroids",
        text: [&splatting(wide), REFLECTION, ASTEROID_INSTANCE, ASTEROID_CLASS, phase, points].concat(),
        needs_u64: wide,
    }
}

/// What every shader that draws asteroids begins with.
fn asteroid_drawing(name: &'static str, entry_point: &'static str, own: &str) -> ShaderSource {
    let text = [VIEWPORT, MATH, PROJECTION, REFLECTION, ASTEROID_INSTANCE, ASTEROID_LISTS, ASTEROID, own].concat();
    ShaderSource { name, entry_point, text, needs_u64: false }
}

/// Places the corners of asteroids' meshes.
pub fn asteroid_mesh() -> ShaderSource {
    let corner = include_str!("../../shaders/shared/asteroid_corner.wgsl");
    let own = [corner, include_str!("../../shaders/asteroid_mesh.wgsl")].concat();
    asteroid_drawing("asteroid mesh", "place_corner", &own)
}

/// Lights asteroids' meshes.
pub fn asteroid_shade() -> ShaderSource {
    let corner = include_str!("../../shaders/shared/asteroid_corner.wgsl");
    let own = [corner, include_str!("../../shaders/asteroid_shade.wgsl")].concat();
    asteroid_drawing("asteroid shade", "shade", &own)
}

/// The overlay pass.
pub fn overlay() -> ShaderSource {
    let text =
        [VIEWPORT, MATH, PROJECTION, DISPLAY, GEOMETRY, include_str!("../../shaders/overlay/draw.wgsl")].concat();
    ShaderSource { name: "overlay", entry_point: "draw_overlay", text, needs_u64: false }
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

/// What the present pass writes into a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PresentSource {
    /// The codes of the display image.
    Codes,
    /// Light of the HDR image.
    Light,
}

/// Places the corners of the present pass.
pub fn present_corner() -> ShaderSource {
    let text = include_str!("../../shaders/shared/present_corner.wgsl").to_owned();
    ShaderSource { name: "present corner", entry_point: "place_corner", text, needs_u64: false }
}

/// The present pass.
pub fn present(source: PresentSource) -> ShaderSource {
    let (name, of_source) = match source {
        PresentSource::Codes => ("present codes", include_str!("../../shaders/shared/present_codes.wgsl")),
        PresentSource::Light => ("present light", include_str!("../../shaders/shared/present_light.wgsl")),
    };
    let text = [MATH, DISPLAY, EXPOSURE, of_source, include_str!("../../shaders/present.wgsl")].concat();
    ShaderSource { name, entry_point: "present", text, needs_u64: false }
}

/// Evaluates the projections at given points, for tests and diagnostics.
pub fn projection_probe() -> ShaderSource {
    let text = [VIEWPORT, MATH, PROJECTION, include_str!("../../shaders/projection_probe.wgsl")].concat();
    ShaderSource { name: "projection probe", entry_point: "probe", text, needs_u64: false }
}

/// Every shader module of the crate.
pub fn sources() -> Vec<ShaderSource> {
    let mut sources = vec![
        stars(true),
        stars(false),
        geometry(),
        overlay(),
        points(true),
        points(false),
        packed_cas(),
        packed_cas_sorted(),
        resolve_luminance(LuminanceSource::Packed),
        resolve_luminance(LuminanceSource::Texture),
        resolve_luminance(LuminanceSource::Cube),
        resolve_luminance(LuminanceSource::CellSky),
        billboard_vertex(),
        count_stars(),
        resolve(true),
        resolve(false),
        glare_composite(GlareSource::Sky),
        glare_gather(),
        glare_sharpen(),
        glare_find(),
        glare_assign(),
        glare_composite(GlareSource::Pyramid),
        glare_maximum(),
        glare_base(),
        glare_blur(PyramidAxes::Screen),
        glare_blur(PyramidAxes::View),
        glare_combine(),
        asteroid_cull(),
        asteroid_scan(),
        asteroid_offsets(),
        asteroid_points(true),
        asteroid_points(false),
        asteroid_mesh(),
        asteroid_shade(),
        exposure(),
        tone_map(),
        present_corner(),
        present(PresentSource::Codes),
        present(PresentSource::Light),
        projection_probe(),
    ];
    sources.extend(Profile::ALL.map(billboard_fragment));
    sources.extend(super::impostor_shaders::sources());
    sources
}

// Stars as the published methods read them: five numbers each, in the order of the catalogue.

struct CatalogueStar {
    // ICRS, from the barycentre, pc.
    x: f32,
    y: f32,
    z: f32,
    absolute_magnitude: f32,
    // K
    temperature: f32,
}

// Parameters of the compute passes over all of them.
struct CatalogueParameters {
    // ICRS, pc.
    camera: vec3<f32>,
    star_count: u32,
    // Fainter stars are not drawn, lx.
    faintest_lx: f32,
    // The tile drawn into; where there are no tiles, the viewport.
    tile: u32,
    // Threads per row of the dispatch.
    row_threads: u32,
    unused_0: u32,
}

// Illuminance of a star of apparent magnitude 0, lx: eqs. 1 and 2 of "Smaller than Pixels".
const MAGNITUDE_0_LX: f32 = 2.53848e-6;

// Illuminance of a star at `relative` (pc from the eye), lx.
fn catalogue_illuminance(star: CatalogueStar, relative: vec3<f32>) -> f32 {
    let apparent = star.absolute_magnitude + 5.0 * log2(0.1 * length(relative)) * 0.301029996;
    return MAGNITUDE_0_LX * exp2(-0.4 * 3.321928095 * apparent);
}

// Stars as the published methods read them: five numbers each, in the order of the catalogue.

#import structs/CatalogueParameters
#import structs/CatalogueStar

// Illuminance of a star of apparent magnitude 0, lx: eqs. 1 and 2 of "Smaller than Pixels".
const MAGNITUDE_0_LX: f32 = 2.53848e-6;

// Returns the illuminance of a star at `relative` (pc from the eye), lx.
fn catalogue_illuminance(star: CatalogueStar, relative: vec3<f32>) -> f32 {
    let apparent = star.absolute_magnitude + 5.0 * log2(0.1 * length(relative)) * 0.301029996;
    return MAGNITUDE_0_LX * exp2(-0.4 * 3.321928095 * apparent);
}

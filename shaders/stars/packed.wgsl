// The star pass as published with "Smaller than Pixels". It has one thread per star of the catalogue, and runs once per view.

#import constants/workgroups
#import shared/projection
#import stars/catalogue_star
#import stars/packed_splat

@group(0) @binding(0) var<uniform> parameters: CatalogueParameters;
@group(1) @binding(0) var<storage, read> stars: array<CatalogueStar>;

@compute @workgroup_size(CATALOGUE_THREADS)
fn splat_catalogue(@builtin(global_invocation_id) thread: vec3<u32>) {
    let index = thread.y * parameters.row_threads + thread.x;
    if index >= parameters.star_count {
        return;
    }
    let star = stars[index];
    let tile = tiles[parameters.tile];
    let viewport = viewports[tile.viewport];
    let eye = vec3(viewport.view_from_world_x.w, viewport.view_from_world_y.w, viewport.view_from_world_z.w);
    let relative = vec3(star.x, star.y, star.z) - (parameters.camera + eye);
    let direction = view_direction(viewport, relative);
    let projected = pixel_from_direction(viewport, direction);
    if projected.z == 0.0 || any(projected.xy < vec2(0.0)) || any(projected.xy >= vec2<f32>(viewport.size)) {
        return;
    }
    let illuminance = catalogue_illuminance(star, relative);
    if !(illuminance >= parameters.faintest_lx) || dot(relative, relative) == 0.0 {
        return;
    }
    splat_packed(tile, viewport, direction, illuminance, star.temperature);
}

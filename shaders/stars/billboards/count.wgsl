// Counts the stars of the catalogue whose images are in a picture. It is for methods that draw with the graphics pipeline, which cannot count.

#import constants/counters
#import constants/frame_lists
#import constants/workgroups
#import shared/projection
#import shared/viewport
#import stars/catalogue_star

@group(0) @binding(0) var<uniform> parameters: CatalogueParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<storage, read_write> counters: array<atomic<u32>>;
@group(1) @binding(0) var<storage, read> stars: array<CatalogueStar>;

var<workgroup> found: atomic<u32>;

@compute @workgroup_size(CATALOGUE_THREADS)
fn count_stars(
    @builtin(global_invocation_id) thread: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let viewport = viewports[parameters.tile];
    let index = thread.y * parameters.row_threads + thread.x;
    if local == 0u {
        atomicStore(&found, 0u);
    }
    workgroupBarrier();
    if index < parameters.star_count {
        let star = stars[index];
        let eye = vec3(viewport.view_from_world_x.w, viewport.view_from_world_y.w, viewport.view_from_world_z.w);
        let relative = vec3(star.x, star.y, star.z) - (parameters.camera + eye);
        if catalogue_illuminance(star, relative) >= parameters.faintest_lx && dot(relative, relative) > 0.0 {
            let projected = pixel_from_direction(viewport, vec3(
                dot(relative, viewport.view_from_world_x.xyz),
                dot(relative, viewport.view_from_world_y.xyz),
                dot(relative, viewport.view_from_world_z.xyz)));
            if projected.z > 0.0 && contains(viewport, vec2<i32>(floor(projected.xy))) {
                atomicAdd(&found, 1u);
            }
        }
    }
    workgroupBarrier();
    if local == 0u {
        atomicAdd(&counters[FIRST_VIEW_COUNTER + viewport.view], atomicLoad(&found));
    }
}

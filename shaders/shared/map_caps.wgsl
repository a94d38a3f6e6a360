// Caps of whole-sky maps, whose pixels do not read the map of faint light: crates/render/src/plan/smooth_light/caps.rs.

#import constants/projections
#import shared/viewport

// Returns the share of the map in the faint light of a direction in view space (any length but 0): 0 in a cap. `caps`: cosines of the latitude at
// the inner and the outer edge of a cap; 0 without caps.
fn share_of_map(viewport: Viewport, caps: vec2<f32>, direction: vec3<f32>) -> f32 {
    if caps.y == 0.0 || viewport.kind != KIND_EQUIRECTANGULAR {
        return 1.0;
    }
    return smoothstep(caps.x, caps.y, length(direction.xz) / length(direction));
}

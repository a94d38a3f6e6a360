// Lights asteroid meshes with the strongest sun. Colour: luminance in units of the target, alpha 1.

#import asteroids/listed
#import asteroids/mesh_corner
#import shared/reflection

@fragment
fn shade(corner: Corner) -> @location(0) vec4<f32> {
    if faded(corner.fade_and_law.x, vec2<u32>(corner.clip.xy)) {
        discard;
    }
    let normal = normalize(corner.normal);
    let cos_i = dot(normal, corner.sun);
    let cos_e = dot(normal, -normalize(corner.place));
    return vec4(corner.luminance * reflected(u32(corner.fade_and_law.y), cos_i, cos_e), 1.0);
}

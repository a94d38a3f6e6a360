// Vertex shader of asteroid meshes.

#import asteroids/listed
#import asteroids/mesh_corner

@vertex
fn place_corner(
    @builtin(instance_index) instance: u32,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) albedo: f32) -> Corner {
    let asteroid = load_asteroid(slot_of(instance));
    let place = asteroid.centre + asteroid.view_from_shape * (position * asteroid.radius);
    var corner: Corner;
    corner.clip = clip_from_view(place);
    corner.place = place / asteroid.radius;
    corner.normal = asteroid.view_from_shape * normal;
    corner.sun = asteroid.sun;
    corner.luminance = asteroid.luminance * albedo;
    corner.fade_and_law = vec2(asteroid.fade, f32(asteroid.law));
    return corner;
}

// Places the squares of asteroid impostors, each a triangle strip of four vertices.
//
// The published square is parallel to the image plane and rotated by the roll, and its tile follows from the camera's orientation. The other squares
// face the eye and are as large as the outline in perspective. Their tiles follow from the eye's position.

#import asteroids/impostors/atlas
#import asteroids/impostors/square
#import asteroids/impostors/tiles
#import constants/impostors
#import shared/math
#import source = asteroids/listed | asteroids/impostors/given

@vertex
fn place_impostor(@builtin(vertex_index) index: u32, @builtin(instance_index) instance: u32) -> ImpostorCorner {
    let asteroid = load_asteroid(slot_of(instance));
    let view_from_shape = asteroid.view_from_shape;
    let radius = asteroid.radius * bounds[asteroid.shape];
    let centre = asteroid.centre / radius;
    let place = vec2(f32(index & 1u), f32(index >> 1u)) * 2.0 - 1.0;
    var corner: ImpostorCorner;
    corner.place = place;
    corner.tiles.w = asteroid.shape;
    corner.weights = vec3(1.0, 0.0, 0.0);
    if METHOD == METHOD_EULER {
        let angles = euler_angles(view_from_shape);
        corner.tiles.x = euler_tile(angles);
        let turn = vec2(precise_cos(angles.z), precise_sin(angles.z));
        corner.offset = vec3(turn.x * place.x - turn.y * place.y, turn.y * place.x + turn.x * place.y, 0.0);
    } else {
        let square = facing_square(centre, view_from_shape, METHOD == METHOD_BLEND);
        corner.tiles = vec4(square.tiles, asteroid.shape);
        corner.weights = square.weights;
        corner.offset = place.x * square.right + place.y * square.up;
    }
    corner.centre = vec4(centre, radius);
    corner.view_from_shape_x = view_from_shape[0];
    corner.view_from_shape_y = view_from_shape[1];
    corner.view_from_shape_z = view_from_shape[2];
    corner.sun = vec4(asteroid.sun, asteroid.fade);
    corner.luminance = vec4(asteroid.luminance, f32(asteroid.law));
    corner.clip = clip_from_view(asteroid.centre + corner.offset * radius);
    return corner;
}

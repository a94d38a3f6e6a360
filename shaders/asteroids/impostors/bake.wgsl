// Draws a mesh onto the tiles of a block of an atlas. Each instance is one tile: a parallel projection along the tile's
// direction.

#import asteroids/impostors/bake_block

@group(0) @binding(0) var<uniform> parameters: ImpostorBakeParameters;
@group(0) @binding(1) var<storage, read> tiles: array<ImpostorBakeTile>;

@vertex
fn place_on_tile(
    @builtin(instance_index) instance: u32,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) albedo: f32) -> BakedCorner {
    let tile = tiles[instance];
    let p = position / parameters.bound;
    let place = tile.middle + parameters.scale * vec2(dot(p, tile.right), -dot(p, tile.up));
    let ndc = 2.0 * place / parameters.side - 1.0;
    let depth = 0.5 + 0.5 * dot(p, tile.direction);
    var corner: BakedCorner;
    corner.clip = vec4(ndc.x, -ndc.y, depth, 1.0);
    corner.normal = normal;
    corner.surface = vec2(albedo / parameters.albedo_scale, depth);
    return corner;
}

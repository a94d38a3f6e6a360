// Tiles of an atlas that show an asteroid. It does the same in f32 as crates/render/src/plan/asteroids/tiles.

#import asteroids/impostors/atlas
#import shared/math

struct TileAxes {
    right: vec3<f32>,
    up: vec3<f32>,
    direction: vec3<f32>,
}

fn signs(p: vec2<f32>) -> vec2<f32> {
    return select(vec2(-1.0), vec2(1.0), p >= vec2(0.0));
}

// Returns the position of a direction (any length but 0) on the octahedral map, -1 to 1.
fn octahedral_place(direction: vec3<f32>) -> vec2<f32> {
    let sizes = abs(direction);
    let p = direction.xy / (sizes.x + sizes.y + sizes.z);
    return select((1.0 - abs(p.yx)) * signs(p), p, direction.z >= 0.0);
}

// Returns the axes of a tile of the octahedral map (frame by Duff et al. 2017). The frame flips with the sign of z, which is computed in integers
// because many tiles have z = 0.
fn octahedral_axes(tile: vec2<u32>) -> TileAxes {
    let count = i32(atlas.tiles);
    let place = 2 * vec2<i32>(tile) + vec2(1 - count);
    let z = count - abs(place.x) - abs(place.y);
    let p = vec2<f32>(place);
    let folded = vec2<f32>(vec2(count) - abs(place.yx)) * signs(p);
    let n = normalize(vec3(select(folded, p, z >= 0), f32(z)));
    let side = select(-1.0, 1.0, z >= 0);
    let a = -1.0 / (side + n.z);
    let b = n.x * n.y * a;
    return TileAxes(
        vec3(1.0 + side * n.x * n.x * a, side * b, -side * n.x), vec3(b, side + n.y * n.y * a, -n.y), n);
}

fn octahedral_nearest(direction: vec3<f32>) -> vec2<u32> {
    let place = floor((octahedral_place(direction) + 1.0) * (0.5 * f32(atlas.tiles)));
    return vec2<u32>(clamp(place, vec2(0.0), vec2(f32(atlas.tiles) - 1.0)));
}

// Packs a tile of the grid into one word. Positions one step beyond a border wrap around.
fn wrapped(place: vec2<i32>) -> u32 {
    let last = i32(atlas.tiles) - 1;
    var tile = place;
    if tile.x < 0 || tile.x > last {
        tile = vec2(clamp(tile.x, 0, last), last - tile.y);
    }
    if tile.y < 0 || tile.y > last {
        tile = vec2(last - tile.x, clamp(tile.y, 0, last));
    }
    return u32(tile.x) | (u32(tile.y) << 16u);
}

struct Blend {
    tiles: vec3<u32>,
    weights: vec3<f32>,
}

// Returns the three tiles around a direction.
fn octahedral_blend(direction: vec3<f32>) -> Blend {
    let n = i32(atlas.tiles);
    let grid = (octahedral_place(direction) + 1.0) * (0.5 * f32(n)) - 0.5;
    let cell = clamp(vec2<i32>(floor(grid)), vec2(-1), vec2(n - 1));
    let f = clamp(grid - vec2<f32>(cell), vec2(0.0), vec2(1.0));
    let over_border = any(cell < vec2(0)) || any(cell >= vec2(n - 1));
    let from_middle = 2 * cell + vec2(2 - n);
    var blend: Blend;
    if !over_border && from_middle.x * from_middle.y > 0 {
        let beyond = f.x + f.y > 1.0;
        let first = select(vec2(0), vec2(1), beyond);
        blend.tiles = vec3(wrapped(cell + first), wrapped(cell + vec2(1, 0)), wrapped(cell + vec2(0, 1)));
        blend.weights = select(vec3(1.0 - f.x - f.y, f.x, f.y), vec3(f.x + f.y - 1.0, 1.0 - f.y, 1.0 - f.x), beyond);
    } else {
        let right = f.x >= f.y;
        let second = select(vec2(0, 1), vec2(1, 0), right);
        blend.tiles = vec3(wrapped(cell), wrapped(cell + second), wrapped(cell + vec2(1, 1)));
        blend.weights = vec3(1.0 - max(f.x, f.y), abs(f.x - f.y), min(f.x, f.y));
    }
    return blend;
}

// Returns pitch, yaw and roll of view_from_shape = Rz(roll) Ry(yaw) Rx(pitch), which select the tile as published.
fn euler_angles(view_from_shape: mat3x3<f32>) -> vec3<f32> {
    let towards = vec3(view_from_shape[0].z, view_from_shape[1].z, view_from_shape[2].z);
    return vec3(
        precise_atan2(towards.y, towards.z),
        precise_atan2(-towards.x, length(towards.yz)),
        precise_atan2(view_from_shape[0].y, view_from_shape[0].x));
}

// Returns the tile of these angles in one word. The angles are rounded up, as published.
fn euler_tile(angles: vec3<f32>) -> u32 {
    let n = i32(atlas.tiles);
    let index = vec2<i32>(ceil(angles.xy * (f32(n) / (2.0 * PI))));
    let tile = vec2<u32>((index % n + n) % n);
    return tile.x | (tile.y << 16u);
}

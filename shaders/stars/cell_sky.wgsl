// The procedural sky of "Rendering a Billion Stars?": one star per cell of a distorted cube grid, in several layers.
// crates/render/src/reference/stars/cell_sky.rs does the same in f64 and explains the method.

#import constants/cell_sky
#import shared/math

// North galactic pole, ICRS.
const CELL_SKY_POLE: vec3<f32> = vec3<f32>(-0.8676661, -0.1980764, 0.4559838);
// Black bodies of 3500, 6504 and 12000 K, linear Rec. 709 with Y = 1.
const CELL_SKY_WARM: vec3<f32> = vec3<f32>(1.564327, 0.892258, 0.405556);
const CELL_SKY_WHITE: vec3<f32> = vec3<f32>(1.043055, 0.983607, 1.035608);
const CELL_SKY_BLUE: vec3<f32> = vec3<f32>(0.826550, 0.994360, 1.566606);

// Faces 0 to 5: -z, +x, -x, +z, +y, -y. u and v on the face are in [-1, 1].
struct CellSkyPlace {
    face: u32,
    uv: vec2<f32>,
}

fn cell_sky_place(d: vec3<f32>) -> CellSkyPlace {
    let a = abs(d);
    if a.z >= a.x && a.z >= a.y {
        if d.z < 0.0 {
            return CellSkyPlace(0u, vec2<f32>(d.x, d.y) / a.z);
        }
        return CellSkyPlace(3u, vec2<f32>(-d.x, d.y) / a.z);
    }
    if a.x >= a.y {
        if d.x > 0.0 {
            return CellSkyPlace(1u, vec2<f32>(d.z, d.y) / a.x);
        }
        return CellSkyPlace(2u, vec2<f32>(-d.z, d.y) / a.x);
    }
    if d.y > 0.0 {
        return CellSkyPlace(4u, vec2<f32>(d.x, d.z) / a.y);
    }
    return CellSkyPlace(5u, vec2<f32>(d.x, -d.z) / a.y);
}

// Returns the unit direction of a position on a face.
fn cell_sky_direction(face: u32, uv: vec2<f32>) -> vec3<f32> {
    var d = vec3<f32>(uv.x, uv.y, -1.0);
    if face == 1u {
        d = vec3<f32>(1.0, uv.y, uv.x);
    } else if face == 2u {
        d = vec3<f32>(-1.0, uv.y, -uv.x);
    } else if face == 3u {
        d = vec3<f32>(-uv.x, uv.y, 1.0);
    } else if face == 4u {
        d = vec3<f32>(uv.x, 1.0, uv.y);
    } else if face == 5u {
        d = vec3<f32>(uv.x, -1.0, -uv.y);
    }
    return normalize(d);
}

// Returns the published distortion.
fn cell_sky_distort(uv: vec2<f32>) -> vec2<f32> {
    return uv * sqrt(2.0 - max(abs(uv.x), abs(uv.y)));
}

// Returns the inverse of the distortion: solves m sqrt(2 - m) = target by Newton's method.
fn cell_sky_straighten(uv: vec2<f32>) -> vec2<f32> {
    let wanted = max(abs(uv.x), abs(uv.y));
    var m = wanted * 0.85;
    for (var i = 0; i < 5; i += 1) {
        let root = sqrt(2.0 - m);
        m = clamp(m - (m * root - wanted) * root / (2.0 - 1.5 * m), 0.0, 1.0);
    }
    return uv / sqrt(2.0 - m);
}

// Returns a number in [0, 1), exact in f32.
fn cell_sky_unit(bits: u32) -> f32 {
    return f32(bits >> 8u) * 5.9604644775390625e-8;
}

// Returns the relative brightness (display white = 1) in an ICRS direction, for pixels of pixel_rad at the centre of the view.
fn cell_sky_brightness(
    direction: vec3<f32>,
    pixel_rad: f32,
    cells: u32,
    layers: u32,
    radius_px: f32,
    seed: u32,
) -> vec3<f32> {
    let place = cell_sky_place(direction);
    let grid = (cell_sky_distort(place.uv) * 0.5 + 0.5) * f32(cells);
    let cell = min(vec2<u32>(max(grid, vec2<f32>(0.0))), vec2<u32>(cells - 1u));
    let inner = (grid - vec2<f32>(cell) - 0.5) * 2.0;
    let radius = 1.41421356 * radius_px * pixel_rad * f32(cells);
    var sum = vec3<f32>(0.0);
    for (var layer = 0u; layer < layers; layer += 1u) {
        let key = hash((cell.y * cells + cell.x) ^ hash((layer * 6u + place.face) ^ hash(seed)));
        let offset = (vec2<f32>(cell_sky_unit(hash(key)), cell_sky_unit(hash(key + 1u))) * 2.0 - 1.0) * CELL_SKY_JITTER;
        let profile = 1.0 - length(inner - offset) / radius;
        if profile <= 0.0 {
            continue;
        }
        let star_uv = (vec2<f32>(cell) + 0.5 + 0.5 * offset) / f32(cells) * 2.0 - 1.0;
        let star = cell_sky_direction(place.face, cell_sky_straighten(star_uv));
        let sine = dot(star, CELL_SKY_POLE) / CELL_SKY_BAND_SINE;
        let density = CELL_SKY_EVEN_DENSITY + (1.0 - CELL_SKY_EVEN_DENSITY) * exp(-sine * sine);
        if cell_sky_unit(hash(key + 2u)) >= density {
            continue;
        }
        // The number of stars per interval of brightness is proportional to brightness^-2.5, from the faintest brightness to 1.
        let range = 1.0 - pow(CELL_SKY_FAINTEST, 1.5);
        let brightness = CELL_SKY_FAINTEST * pow(1.0 - cell_sky_unit(hash(key + 3u)) * range, -2.0 / 3.0);
        let warmth = 2.0 * cell_sky_unit(hash(key + 4u));
        let colour = select(
            mix(CELL_SKY_WHITE, CELL_SKY_BLUE, warmth - 1.0),
            mix(CELL_SKY_WARM, CELL_SKY_WHITE, warmth),
            warmth < 1.0,
        );
        sum += colour * (brightness * profile);
    }
    return sum;
}

// The ground and the air around an observer, over what bodies and asteroids show in each pixel of a tile: the air takes a part of their light and adds what it scatters, and the ground
// stands before everything below the horizon. The model is that of src/photometry/sky_light.rs and src/scene/surroundings.rs; the f64 twin is src/reference/air/light.rs.

#import constants/air
#import constants/workgroups
#import shared/air_mass
#import shared/cover
#import shared/math
#import shared/projection
#import shared/viewport

// A source whose light the air scatters.
struct AirSource {
    // Unit vector towards it, world axes.
    direction: vec3<f32>,
    unused_0: u32,
    // What it gives outside of the air, lx.
    light: vec3<f32>,
    unused_1: u32,
    // Unit vector of its azimuth: north, east.
    heading: vec2<f32>,
    unused_2: u32,
    unused_3: u32,
}

struct AirParameters {
    // Number of the tile.
    tile: u32,
    // 1: there is air.
    has_air: u32,
    // 1: there is ground.
    has_ground: u32,
    source_count: u32,
    // Axes of the horizon, world axes.
    east: vec3<f32>,
    // Factor on the light of sky and ground: where glare is drawn after this, a part of it is taken away that would come back from all around.
    light_share: f32,
    zenith: vec3<f32>,
    // 1: the ground ends at altitude 0 all around.
    is_flat: u32,
    south: vec3<f32>,
    unused_0: u32,
    // Power of two by which light becomes less for each air mass.
    extinction: vec3<f32>,
    unused_1: u32,
    // Luminance of the air's own glow in the zenith, without what the air takes of it.
    glow: vec3<f32>,
    unused_2: u32,
    // Luminance of the ground.
    ground: vec3<f32>,
    // Azimuth of the middle of the picture of the ground, rad.
    landscape_azimuth: f32,
    // Luminance of a white surface.
    white: vec3<f32>,
    unused_3: u32,
    // Size of the picture of the ground, texels; 0: there is none.
    landscape_size: vec2<u32>,
    unused_4: u32,
    unused_5: u32,
    sources: array<AirSource, 2>,
}

@group(0) @binding(0) var<uniform> parameters: AirParameters;
@group(0) @binding(1) var<storage, read> viewports: array<Viewport>;
@group(0) @binding(2) var<storage, read> tiles: array<Tile>;
@group(0) @binding(3) var<storage, read_write> geometry: array<vec4<u32>>;
// Sines of the horizon's altitude, evenly around it from the north on through east.
@group(0) @binding(4) var<storage, read> horizon: array<f32>;
// What the sky shows of 1 lx of each source: nodes of what is smooth, then of what aerosol scatters; src/photometry/sky_light.rs.
@group(0) @binding(5) var<storage, read> sky: array<vec4<f32>>;
// The picture of the ground, level by level from the finest: src/scene/landscape.rs.
@group(0) @binding(6) var<storage, read> landscape: array<u32>;

// The pixel's share of ground is found where the horizon is nearer than this, in sines: pixels are no larger.
const NEAR_HORIZON: f32 = 0.1;

// Phase function of aerosol, per sr.
fn aerosol_per_sr(cosine: f32) -> f32 {
    let g = AEROSOL_ASYMMETRY;
    let wide = 1.0 + g * g - 2.0 * g * cosine;
    return 3.0 / (8.0 * PI) * (1.0 - g * g) * (1.0 + cosine * cosine) / ((2.0 + g * g) * wide * sqrt(wide));
}

// Between four nodes of a table that begins at `first`.
fn table_at(first: u32, place: vec2<f32>) -> vec3<f32> {
    let low = min(vec2<u32>(place), vec2(SKY_ALTITUDES, SKY_AZIMUTHS) - 2u);
    let part = place - vec2<f32>(low);
    let at = first + low.x * SKY_AZIMUTHS + low.y;
    let near = mix(sky[at].xyz, sky[at + 1u].xyz, part.y);
    return mix(near, mix(sky[at + SKY_AZIMUTHS].xyz, sky[at + SKY_AZIMUTHS + 1u].xyz, part.y), part.x);
}

// What the air scatters of a source towards a direction of a sine of altitude and a heading (north, east).
fn scattered(number: u32, towards: vec3<f32>, sine: f32, heading: vec2<f32>) -> vec3<f32> {
    let source = parameters.sources[number];
    let altitude = precise_atan2(max(sine, 0.0), length(heading)) * (2.0 / PI);
    let across = heading.x * source.heading.y - heading.y * source.heading.x;
    let azimuth = precise_atan2(abs(across), dot(heading, source.heading)) * (1.0 / PI);
    let place = sqrt(clamp(vec2(altitude, azimuth), vec2(0.0), vec2(1.0))) * vec2(f32(SKY_ALTITUDES - 1u), f32(SKY_AZIMUTHS - 1u));
    let nodes = SKY_ALTITUDES * SKY_AZIMUTHS;
    let first = 2u * nodes * number;
    let cosine = dot(towards, source.direction);
    return source.light * (table_at(first, place) + table_at(first + nodes, place) * aerosol_per_sr(cosine));
}

fn horizon_sine(heading: vec2<f32>) -> f32 {
    if parameters.is_flat != 0u {
        return 0.0;
    }
    let azimuth = precise_atan2(heading.y, heading.x);
    let at = (azimuth / (2.0 * PI) + 1.0) * f32(HORIZON_STEPS);
    let first = u32(at);
    return mix(horizon[first % HORIZON_STEPS], horizon[(first + 1u) % HORIZON_STEPS], at - f32(first));
}

fn landscape_texel(index: u32) -> vec4<f32> {
    let word = unpack4x8unorm(landscape[index]);
    return vec4(word.xyz * word.xyz, word.w);
}

// One level of the picture of the ground, between its four nearest texels.
fn landscape_level(first: u32, size: vec2<u32>, place: vec2<f32>) -> vec4<f32> {
    let at = place * vec2<f32>(size) - 0.5;
    let low = floor(at);
    let part = at - low;
    let width = i32(size.x);
    let x = vec2((i32(low.x) % width + width) % width, (i32(low.x) + 1 + width) % width);
    let y = clamp(vec2(i32(low.y), i32(low.y) + 1), vec2(0), vec2(i32(size.y) - 1)) * width;
    let upper = mix(landscape_texel(first + u32(y.x + x.x)), landscape_texel(first + u32(y.x + x.y)), part.x);
    let lower = mix(landscape_texel(first + u32(y.y + x.x)), landscape_texel(first + u32(y.y + x.y)), part.x);
    return mix(upper, lower, part.y);
}

// Reflectance times the hidden share, and that share, of a pixel of an angular size.
fn landscape_at(sine: f32, heading: vec2<f32>, pixel_rad: f32) -> vec4<f32> {
    let azimuth = precise_atan2(heading.y, heading.x);
    let altitude = precise_atan2(sine, length(heading));
    let place = vec2(fract((azimuth - parameters.landscape_azimuth) / (2.0 * PI) + 0.5), 0.5 - altitude / PI);
    var size = parameters.landscape_size;
    var first = 0u;
    var level = clamp(log2(max(pixel_rad * f32(size.y) / PI, 1.0)), 0.0, 31.0);
    while level >= 1.0 && min(size.x, size.y) > 1u {
        first += size.x * size.y;
        size = max(size / 2u, vec2(1u));
        level -= 1.0;
    }
    let fine = landscape_level(first, size, place);
    if level <= 0.0 || min(size.x, size.y) == 1u {
        return fine;
    }
    return mix(fine, landscape_level(first + size.x * size.y, max(size / 2u, vec2(1u)), place), min(level, 1.0));
}

@compute @workgroup_size(RAY_SIDE, RAY_SIDE)
fn add_air(@builtin(global_invocation_id) id: vec3<u32>) {
    let tile = tiles[parameters.tile];
    let viewport = viewports[tile.viewport];
    if id.x >= viewport.size.x || id.y >= tile.rows {
        return;
    }
    let pixel = vec2(id.x, tile.first_row + id.y);
    if !contains(viewport, vec2<i32>(pixel)) {
        return;
    }
    let index = tile.first_pixel + id.y * viewport.size.x + id.x;
    let before = geometry[index];
    var light = bitcast<vec3<f32>>(before.xyz);
    var word = before.w;
    let centre = vec2<f32>(pixel) + 0.5;
    let towards = normalize(world_direction(viewport, direction_of_point(viewport, centre)));
    let sine = dot(towards, parameters.zenith);
    let heading = vec2(-dot(towards, parameters.south), dot(towards, parameters.east));
    if parameters.has_air != 0u {
        let masses = air_mass(sine);
        let passed = exp2(parameters.extinction * masses);
        let longer = 0.4 + 0.6 * inverseSqrt(0.04 + 0.96 * max(sine, 0.0) * max(sine, 0.0));
        var added = parameters.glow * passed * longer;
        for (var i = 0u; i < parameters.source_count; i++) {
            added += scattered(i, towards, sine, heading);
        }
        light = light * passed + parameters.light_share * added;
    }
    if parameters.has_ground != 0u {
        var share = 0.0;
        var ground = parameters.ground;
        if parameters.landscape_size.x > 0u {
            let right = direction_of_point(viewport, centre + vec2(1.0, 0.0));
            let own = direction_of_point(viewport, centre);
            let seen = landscape_at(sine, heading, length(cross(own, right)) / max(dot(own, own), 1e-12));
            share = seen.w;
            ground = parameters.white * seen.xyz / max(seen.w, 1e-6);
        } else {
            let above = sine - horizon_sine(heading);
            share = select(0.0, 1.0, above < 0.0);
            if abs(above) < NEAR_HORIZON {
                // Pixels across the horizon show both.
                let right = direction_of_point(viewport, centre + vec2(1.0, 0.0));
                let down = direction_of_point(viewport, centre + vec2(0.0, 1.0));
                let own = direction_of_point(viewport, centre);
                let slopes = vec2(
                    dot(world_direction(viewport, right - own), parameters.zenith),
                    dot(world_direction(viewport, down - own), parameters.zenith));
                share = clamp(0.5 - above / max(abs(slopes.x) + abs(slopes.y), 1e-7), 0.0, 1.0);
            }
        }
        if share > 0.0 {
            light = mix(light, parameters.light_share * ground, share);
            let flags = word & (COVER_LIMB | COVER_MESH);
            word = cover_word(1.0 - (1.0 - share) * (1.0 - coverage_of(word)), select(flags, 0u, share >= 1.0), 0.0);
        }
    }
    geometry[index] = vec4(bitcast<vec3<u32>>(light), word);
}

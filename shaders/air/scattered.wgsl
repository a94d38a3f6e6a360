// Light added by the air: scattered light of its sources, and airglow. The importer binds `parameters` and `sky`. `sky`
// holds sky luminance per lx of each source: nodes of the smooth part, then nodes of aerosol scattering
// (src/photometry/sky_light.rs).

#import constants/air
#import shared/air_mass
#import shared/math

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
    // Sine of the altitude above which there is no ground.
    above_ground: f32,
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
    // Size of the picture of the ground, texels.
    landscape_size: vec2<u32>,
    unused_4: u32,
    unused_5: u32,
    sources: array<AirSource, 2>,
}

// Phase function of aerosol, per sr.
fn aerosol_per_sr(cosine: f32) -> f32 {
    let g = AEROSOL_ASYMMETRY;
    let wide = 1.0 + g * g - 2.0 * g * cosine;
    return 3.0 / (8.0 * PI) * (1.0 - g * g) * (1.0 + cosine * cosine) / ((2.0 + g * g) * wide * sqrt(wide));
}

// Interpolates between four nodes of a table that begins at `first`.
fn table_at(first: u32, place: vec2<f32>) -> vec3<f32> {
    let low = min(vec2<u32>(place), vec2(SKY_ALTITUDES, SKY_AZIMUTHS) - 2u);
    let part = place - vec2<f32>(low);
    let node = first + low.x * SKY_AZIMUTHS + low.y;
    let near = mix(sky[node].xyz, sky[node + 1u].xyz, part.y);
    return mix(near, mix(sky[node + SKY_AZIMUTHS].xyz, sky[node + SKY_AZIMUTHS + 1u].xyz, part.y), part.x);
}

// Light of a source scattered towards a direction, given its altitude (in right angles) and heading (north, east).
fn scattered(number: u32, towards: vec3<f32>, altitude: f32, heading: vec2<f32>) -> vec3<f32> {
    let source = parameters.sources[number];
    let across = heading.x * source.heading.y - heading.y * source.heading.x;
    let azimuth = precise_atan2(abs(across), dot(heading, source.heading)) * (1.0 / PI);
    let place = sqrt(clamp(vec2(altitude, azimuth), vec2(0.0), vec2(1.0))) * vec2(f32(SKY_ALTITUDES - 1u), f32(SKY_AZIMUTHS - 1u));
    let nodes = SKY_ALTITUDES * SKY_AZIMUTHS;
    let first = 2u * nodes * number;
    let cosine = dot(towards, source.direction);
    return source.light * (table_at(first, place) + table_at(first + nodes, place) * aerosol_per_sr(cosine));
}

// Light that the air adds in a unit direction, world axes, cd/m^2.
fn added_light(towards: vec3<f32>) -> vec3<f32> {
    let sine = dot(towards, parameters.zenith);
    let heading = vec2(-dot(towards, parameters.south), dot(towards, parameters.east));
    let altitude = precise_atan2(max(sine, 0.0), length(heading)) * (2.0 / PI);
    let passed = exp2(parameters.extinction * air_mass(sine));
    let longer = 0.4 + 0.6 * inverseSqrt(0.04 + 0.96 * max(sine, 0.0) * max(sine, 0.0));
    var added = parameters.glow * passed * longer;
    for (var i = 0u; i < parameters.source_count; i++) {
        added += scattered(i, towards, altitude, heading);
    }
    return added;
}

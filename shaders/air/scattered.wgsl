// Light added by the air: scattered light of its sources, and the light of the night sky. The importer binds `parameters` and `sky`. `sky` holds the
// luminance of the night sky relative to the zenith, as a function of altitude. The luminance per lx of each source follows: nodes of the smooth
// part, then nodes of aerosol scattering (crates/sky/src/photometry/sky_light.rs).

#import constants/air
#import shared/math
#import structs/AirParameters
#import structs/AirSource

// Returns the phase function of aerosol, per sr.
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

// Returns the light of a source scattered towards a direction. The direction is given by its position among the altitudes (0 to 1) and its heading
// (north, east).
fn scattered(number: u32, towards: vec3<f32>, altitude: f32, heading: vec2<f32>) -> vec3<f32> {
    let source = parameters.sources[number];
    let across = heading.x * source.heading.y - heading.y * source.heading.x;
    let azimuth = precise_atan2(abs(across), dot(heading, source.heading)) * (1.0 / PI);
    let place = sqrt(clamp(vec2(altitude, azimuth), vec2(0.0), vec2(1.0))) * vec2(f32(SKY_ALTITUDES - 1u), f32(SKY_AZIMUTHS - 1u));
    let nodes = SKY_ALTITUDES * SKY_AZIMUTHS;
    let first = SKY_ALTITUDES + 2u * nodes * number;
    let cosine = dot(towards, source.direction);
    return source.light * (table_at(first, place) + table_at(first + nodes, place) * aerosol_per_sr(cosine));
}

// Returns the light of the night sky at a position among the altitudes.
fn night_sky(altitude: f32) -> vec3<f32> {
    let place = sqrt(clamp(altitude, 0.0, 1.0)) * f32(SKY_ALTITUDES - 1u);
    let low = min(u32(place), SKY_ALTITUDES - 2u);
    return parameters.glow * mix(sky[low].xyz, sky[low + 1u].xyz, place - f32(low));
}

// Returns the light that the air adds in a unit direction, world axes, cd/m^2.
fn added_light(towards: vec3<f32>) -> vec3<f32> {
    let sine = dot(towards, parameters.zenith);
    let heading = vec2(-dot(towards, parameters.south), dot(towards, parameters.east));
    let altitude = (precise_atan2(sine, length(heading)) - parameters.lowest) * parameters.per_rad;
    var added = night_sky(altitude);
    for (var i = 0u; i < parameters.source_count; i++) {
        added += scattered(i, towards, altitude, heading);
    }
    return added;
}

// Vertex shader of all blending star methods. There is one instance per star, in the order of the catalogue, with the four vertices of a square (or
// one point for hardware points). Squares of stars outside the picture get no area, because the published geometry shader drops these stars.

#import constants/billboards
#import shared/math
#import shared/projection
#import stars/billboards/billboard
#import stars/catalogue_star
#import stars/triangle_solid_angle

override LAW: u32;

@group(0) @binding(2) var<storage, read> colours: array<vec4<f32>>;
@group(1) @binding(0) var<storage, read> stars: array<CatalogueStar>;

// Outside every picture.
const NOWHERE = vec4<f32>(2.0, 2.0, 2.0, 1.0);
// Points behind the eye's plane are clipped; this avoids a division by 0.
const LEAST_W: f32 = 1e-6;

// Returns the magnitude of an illuminance in lx.
fn magnitude_of(illuminance: f32) -> f32 {
    return -2.5 * 0.301029996 * log2(illuminance / MAGNITUDE_0_LX);
}

// Maps `value` linearly from the range `low` .. `high` to `of_low` .. `of_high`, clamped at the ends.
fn map_range(value: f32, low: f32, high: f32, to_low: f32, to_high: f32) -> f32 {
    return to_low + (clamp(value, low, high) - low) / (high - low) * (to_high - to_low);
}

// Returns the clip coordinates of a position in the plane's axes.
fn clip_from_plane(place: vec3<f32>) -> vec4<f32> {
    let size = vec2<f32>(plane.size);
    let w = -place.z;
    let pixel_w = plane.plane_offset * w + plane.plane_scale * place.xy;
    return vec4(2.0 * pixel_w.x / size.x - w, w - 2.0 * pixel_w.y / size.y, w - LEAST_W, w);
}

// Returns the clip coordinates of a point of the picture.
fn clip_from_pixel(pixel: vec2<f32>) -> vec4<f32> {
    let ndc = 2.0 * pixel / vec2<f32>(plane.size) - 1.0;
    return vec4(ndc.x, -ndc.y, 0.5, 1.0);
}

// Whether a cone around `direction` is completely outside one of the four planes through the eye and the picture's
// edges.
fn outside(direction: vec3<f32>, sine_of_radius: f32) -> bool {
    let low = -plane.plane_offset / plane.plane_scale;
    let high = (vec2<f32>(plane.size) - plane.plane_offset) / plane.plane_scale;
    let from_low = (direction.xy + low * direction.z) * inverseSqrt(1.0 + low * low) * sign(plane.plane_scale);
    let from_high = (direction.xy + high * direction.z) * inverseSqrt(1.0 + high * high) * -sign(plane.plane_scale);
    return any(from_low < vec2(-sine_of_radius)) || any(from_high < vec2(-sine_of_radius));
}

// Returns the right direction of the billboard: the view's right, rotated with the view axis to the star by the shortest arc. It is the same on every
// face of a cube, and undefined only directly behind the view.
fn right_of(direction: vec3<f32>) -> vec3<f32> {
    let d = vec3(
        dot(parameters.view_from_plane_x.xyz, direction),
        dot(parameters.view_from_plane_y.xyz, direction),
        dot(parameters.view_from_plane_z.xyz, direction));
    let between = d + vec3(0.0, 0.0, -1.0);
    let right = vec3(1.0, 0.0, 0.0) - between * (d.x / max(1.0 - d.z, 1e-6));
    let in_plane = right.x * parameters.view_from_plane_x.xyz + right.y * parameters.view_from_plane_y.xyz
        + right.z * parameters.view_from_plane_z.xyz;
    return normalize(in_plane - direction * dot(in_plane, direction));
}

@vertex
fn place_star(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32) -> Splat {
    var splat: Splat;
    splat.position = NOWHERE;
    let star = stars[instance];
    let eye = vec3(plane.view_from_world_x.w, plane.view_from_world_y.w, plane.view_from_world_z.w);
    let relative = vec3(star.x, star.y, star.z) - (parameters.camera + eye);
    let illuminance = catalogue_illuminance(star, relative);
    if !(illuminance >= parameters.faintest_lx) || dot(relative, relative) == 0.0 {
        return splat;
    }
    let direction = normalize(vec3(
        dot(relative, plane.view_from_world_x.xyz),
        dot(relative, plane.view_from_world_y.xyz),
        dot(relative, plane.view_from_world_z.xyz)));
    let step = step_of_temperature(star.temperature);
    let colour = colours[u32(step + 0.5)].xyz;
    let corner = vec2(f32(vertex & 1u), f32(vertex >> 1u)) * 2.0 - 1.0;

    var luminance = 0.0;
    var tangent = 0.0;
    var half_px = 0.0;
    switch LAW {
        case LAW_POINT, LAW_SMOOTH_POINT: {
            half_px = 1.5;
        }
        case LAW_CONSTANT: {
            luminance = illuminance / parameters.solid_angle_sr;
            tangent = parameters.radius_rad;
        }
        case LAW_SCALED: {
            let scale = map_range(
                magnitude_of(illuminance), parameters.brightest_magnitude, parameters.faintest_magnitude, 3.0, 0.3);
            luminance = illuminance / (parameters.solid_angle_sr * scale * scale);
            tangent = parameters.radius_rad * scale;
        }
        case LAW_GLARE: {
            luminance = illuminance / parameters.solid_angle_sr;
            splat.size.y = map_range(sqrt(luminance), 0.0, 5.0, 1.0, 100.0);
            tangent = parameters.radius_rad * splat.size.y;
        }
        case LAW_GAUSSIAN: {
            let magnitude_range = parameters.limiting_magnitude - parameters.saturation_magnitude;
            // The published exponent exceeds the range of f32 a few magnitudes below zero; it is limited to keep the sums finite.
            let brightness = min(
                1e20, pow(2.512, magnitude_range * (parameters.saturation_magnitude - magnitude_of(illuminance))));
            luminance = brightness * parameters.white_cd_m2;
            // Radius at which both Gaussians have dropped to a threshold of 1/512: the published point size.
            let core = log(512.0 * brightness) * 2.0 * parameters.sigma2_px2;
            let glare =
                log(max(512.0 * brightness * parameters.glare_brightness, 1e-30)) * 2.0 * parameters.glare_sigma2_px2;
            half_px = sqrt(max(max(core, glare), 0.0));
        }
        case LAW_SCREEN: {
            luminance = illuminance / MAGNITUDE_0_LX * exp2(0.4 * 3.321928095 * parameters.saturation_magnitude)
                * parameters.white_cd_m2;
            half_px = parameters.half_side_px;
        }
        default: {
            luminance = illuminance;
            let half = clamp(
                parameters.crop_rad * sqrt(illuminance), parameters.least_crop_rad, parameters.half_width_rad);
            splat.size.y = half;
            // A square of angles extends farthest along its diagonal.
            tangent = tan(1.41421356 * half) * 0.70710678;
        }
    }

    if tangent > 0.0 {
        // A footprint in the sky: a square on the plane that is perpendicular to the star's direction and touches the
        // unit sphere.
        let reach = 1.41421356 * tangent;
        if outside(direction, reach * inverseSqrt(1.0 + reach * reach)) {
            return splat;
        }
        splat.right = right_of(direction);
        let up = cross(splat.right, direction);
        // The square is slightly larger, since the fragment shader computes the border of the profile itself.
        let side = 1.02 * tangent + 0.02 * abs(1.0 / plane.plane_scale.x);
        splat.position = clip_from_plane(direction + side * (corner.x * splat.right + corner.y * up));
        splat.centre = direction;
        splat.size.x = tangent;
    } else {
        // A footprint on the plane: a square of pixels around the star's image.
        let projected = pixel_from_direction(plane, direction);
        if projected.z == 0.0 || !(half_px > 0.0) || any(projected.xy < vec2(-half_px))
            || any(projected.xy > vec2<f32>(plane.size) + half_px) {
            return splat;
        }
        if LAW == LAW_POINT || LAW == LAW_SMOOTH_POINT {
            luminance = illuminance / pixel_of_triangles(plane, vec2<i32>(floor(projected.xy)));
        }
        if LAW == LAW_POINT {
            splat.position = clip_from_pixel(projected.xy);
        } else {
            splat.position = clip_from_pixel(projected.xy + corner * (half_px + 0.6));
        }
        splat.centre = vec3(projected.xy, 0.0);
        splat.size.x = half_px;
    }
    splat.light = luminance * colour;
    return splat;
}

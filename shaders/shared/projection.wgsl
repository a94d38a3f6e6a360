// Projections in f32, with the same functions and names as crates/render/src/view/projection/ in f64.

#import constants/faces
#import constants/projections
#import shared/math
#import tabulated = shared/tabulated_off | shared/tabulated
#import shared/viewport

// Returns the continuous pixel coordinates, on a flat plane, of the image of a direction in view space (any length but 0); z = 1 if it exists.
fn flat_pixel_from_direction(viewport: Viewport, direction: vec3<f32>) -> vec3<f32> {
    if direction.z >= 0.0 {
        return vec3(0.0);
    }
    let pixel = viewport.plane_offset + direction.xy * viewport.plane_scale / -direction.z;
    // The image of a direction close to the eye's plane is too far away to be represented.
    return vec3(pixel, select(0.0, 1.0, all(abs(pixel) < vec2(1e9))));
}

// Returns the continuous pixel coordinates in any projection.
fn pixel_from_direction(viewport: Viewport, direction: vec3<f32>) -> vec3<f32> {
#when shared/tabulated
    if viewport.kind == KIND_TABULATED {
        return tabulated_pixel(viewport, direction);
    }
#end
    switch viewport.kind {
        case KIND_PERSPECTIVE, KIND_CUBE_FACE: {
            return flat_pixel_from_direction(viewport, direction);
        }
        case KIND_EQUIRECTANGULAR: {
            let longitude = precise_atan2(direction.x, -direction.z);
            let colatitude = precise_atan2(length(direction.xz), direction.y);
            let size = vec2<f32>(viewport.size);
            return vec3((0.5 + longitude / (2.0 * PI)) * size.x, colatitude / PI * size.y, 1.0);
        }
        default: {
            let across = length(direction.xy);
            var azimuth = vec2(1.0, 0.0);
            if across > 0.0 {
                azimuth = direction.xy / across;
            }
            var rho = 0.0;
            switch viewport.kind {
                case KIND_EQUIDISTANT: {
                    rho = precise_atan2(across, -direction.z) / viewport.rim;
                }
                case KIND_EQUISOLID: {
                    // sin(theta/2). Each hemisphere uses the form that does not cancel.
                    let distance = length(direction);
                    rho = select(
                        across * inverseSqrt(2.0 * distance * (distance - direction.z)),
                        sqrt(max(0.0, 0.5 * (1.0 + direction.z / distance))),
                        direction.z > 0.0) / viewport.rim;
                }
                case KIND_ORTHOGRAPHIC: {
                    if direction.z > 0.0 {
                        return vec3(0.0);
                    }
                    rho = across / length(direction) / viewport.rim;
                }
                default: {
                    // tan(theta/2), in the form that does not cancel.
                    let distance = length(direction);
                    rho = select(across / (distance - direction.z), (distance + direction.z) / max(across, 1e-30), direction.z > 0.0)
                        / viewport.rim;
                }
            }
            let pixel = viewport.plane_offset + azimuth * vec2(rho, -rho) * viewport.plane_scale;
            return vec3(pixel, select(0.0, 1.0, all(abs(pixel) < vec2(1e9))));
        }
    }
}

// Returns the unit direction in view space of a pixel coordinate of the picture; w = 0 outside it.
fn direction_from_pixel(viewport: Viewport, pixel: vec2<f32>) -> vec4<f32> {
    if any(pixel < vec2(0.0)) || any(pixel > vec2<f32>(viewport.size)) {
        return vec4(0.0);
    }
#when shared/tabulated
    if viewport.kind == KIND_TABULATED {
        return tabulated_direction(viewport, pixel);
    }
#end
    return closed_direction_from_pixel(viewport, pixel);
}

// As `direction_from_pixel`, for projections in closed form and a point of the image.
fn closed_direction_from_pixel(viewport: Viewport, pixel: vec2<f32>) -> vec4<f32> {
    if is_fisheye(viewport) && length((pixel - viewport.plane_offset) / viewport.plane_scale) > 1.0 {
        return vec4(0.0);
    }
    return vec4(closed_direction_of_point(viewport, pixel), 1.0);
}

// Returns the unit direction in view space of a point of the plane. Outside the picture the mapping is continued as far as it is defined. Beyond
// that, the direction at its end is returned.
fn direction_of_point(viewport: Viewport, pixel: vec2<f32>) -> vec3<f32> {
#when shared/tabulated
    if viewport.kind == KIND_TABULATED {
        return tabulated_beyond(viewport, pixel);
    }
#end
    return closed_direction_of_point(viewport, pixel);
}

// Returns the unit direction in view space of the centre of a pixel of the picture, or of one next to it. Farther away a tabulated picture has no
// direction, and the result is 0: test `contains` before it is used.
fn direction_of_pixel(viewport: Viewport, pixel: vec2<i32>) -> vec3<f32> {
#when shared/tabulated
    if viewport.kind == KIND_TABULATED {
        return tabulated_node(viewport, pixel + TABLE_FRINGE).xyz;
    }
#end
    return closed_direction_of_point(viewport, vec2<f32>(pixel) + 0.5);
}

// As `direction_of_point`, for projections in closed form.
fn closed_direction_of_point(viewport: Viewport, pixel: vec2<f32>) -> vec3<f32> {
    switch viewport.kind {
        case KIND_PERSPECTIVE, KIND_CUBE_FACE: {
            return normalize(vec3((pixel - viewport.plane_offset) / viewport.plane_scale, -1.0));
        }
        case KIND_EQUIRECTANGULAR: {
            let size = vec2<f32>(viewport.size);
            // The polynomial of the sine is still accurate slightly beyond the date line.
            let longitude = (pixel.x / size.x - 0.5) * 2.0 * PI;
            let colatitude = clamp(pixel.y / size.y, 0.0, 1.0) * PI;
            let across = precise_sin(colatitude);
            return vec3(across * precise_sin(longitude), precise_cos(colatitude), -across * precise_cos(longitude));
        }
        default: {
            let p = (pixel - viewport.plane_offset) / viewport.plane_scale * vec2(1.0, -1.0);
            let rho = length(p);
            var azimuth = vec2(1.0, 0.0);
            if rho > 0.0 {
                azimuth = p / rho;
            }
            let t = rho * viewport.rim;
            var across = 0.0;
            var along = 1.0;
            switch viewport.kind {
                case KIND_EQUIDISTANT: {
                    let theta = min(t, PI);
                    across = precise_sin(theta);
                    along = precise_cos(theta);
                }
                case KIND_EQUISOLID: {
                    let half = min(t, 1.0);
                    across = 2.0 * half * sqrt(max(0.0, 1.0 - half * half));
                    along = 1.0 - 2.0 * half * half;
                }
                case KIND_ORTHOGRAPHIC: {
                    across = min(t, 1.0);
                    along = sqrt(max(0.0, 1.0 - across * across));
                }
                default: {
                    across = 2.0 * t / (1.0 + t * t);
                    along = (1.0 - t * t) / (1.0 + t * t);
                }
            }
            return vec3(azimuth * across, -along);
        }
    }
}

// Returns twice the offset of the pixel's centre from the image's centre. Both components are integers, so that further computation is exact.
fn doubled_offset(viewport: Viewport, pixel: vec2<i32>) -> vec2<i32> {
    return 2 * pixel + vec2(1) - vec2<i32>(viewport.size);
}

fn is_fisheye(viewport: Viewport) -> bool {
    return viewport.kind >= KIND_EQUIDISTANT && viewport.kind <= KIND_STEREOGRAPHIC;
}

// Whether a pixel is inside the picture. For round pictures its centre decides.
fn contains(viewport: Viewport, pixel: vec2<i32>) -> bool {
#when shared/tabulated
    if viewport.kind == KIND_TABULATED {
        return tabulated_solid_angle(viewport, pixel) > 0.0;
    }
#end
    if any(pixel < vec2(0)) || any(pixel >= vec2<i32>(viewport.size)) {
        return false;
    }
    if is_fisheye(viewport) {
        let d = doubled_offset(viewport, pixel);
        let n = i32(min(viewport.size.x, viewport.size.y));
        return d.x * d.x + d.y * d.y <= n * n;
    }
    return true;
}

// Returns the solid angle per unit area of the plane (of tangents, or of the unit circle). `p` in units of the plane; `rho_complement` = 1 - |p|^2
// for fisheye pictures.
fn solid_angle_density(viewport: Viewport, p: vec2<f32>, rho_complement: f32) -> f32 {
    switch viewport.kind {
        case KIND_EQUIDISTANT: {
            let rho = length(p);
            let theta = viewport.rim * rho;
            // Near the antipode use sin(theta) = sin(pi - theta), with pi - theta computed without cancellation.
            let from_antipode = viewport.rim_complement + viewport.rim * rho_complement / (1.0 + rho);
            let sine = sin_quarter(abs(select(theta, from_antipode, theta > 0.5 * PI)));
            let sinc = select(sine / theta, 1.0 - theta * theta / 6.0, theta < 1e-3);
            return viewport.rim * viewport.rim * sinc;
        }
        case KIND_EQUISOLID: {
            return 4.0 * viewport.rim * viewport.rim;
        }
        case KIND_ORTHOGRAPHIC: {
            // 1 - (s rho)^2 = cos^2(F/2) + s^2 (1 - rho^2)
            let squared = viewport.rim * viewport.rim;
            return squared * inverseSqrt(max(viewport.rim_complement + squared * rho_complement, 1e-12));
        }
        case KIND_STEREOGRAPHIC: {
            let squared = viewport.rim * viewport.rim;
            let denominator = 1.0 + squared * dot(p, p);
            return 4.0 * squared / (denominator * denominator);
        }
        default: {
            let q = 1.0 + dot(p, p);
            return 1.0 / (q * sqrt(q));
        }
    }
}

// Returns the solid angle of a pixel of a flat plane, sr: the density and its second-order term over the pixel, h^2 (f_xx + f_yy) / 24 with f = (1 +
// x^2 + y^2)^(-3/2).
fn flat_solid_angle(viewport: Viewport, pixel: vec2<i32>) -> f32 {
    let inverse_scale = 1.0 / viewport.plane_scale;
    let t = (vec2<f32>(pixel) + 0.5 - viewport.plane_offset) * inverse_scale;
    let squares = t * t;
    let cosine = inverseSqrt(1.0 + squares.x + squares.y);
    let cosine_squared = cosine * cosine;
    let curvature = cosine_squared * (15.0 * cosine_squared * squares - 3.0);
    let area = abs(inverse_scale.x * inverse_scale.y);
    return area * cosine * cosine_squared * (1.0 + dot(inverse_scale * inverse_scale, curvature) * (1.0 / 24.0));
}

// Whether flat_solid_angle is accurate enough for the pixels of a viewport.
fn is_flat(viewport: Viewport) -> bool {
    return viewport.kind <= KIND_CUBE_FACE && viewport.quadrature == 0u;
}

// Returns the solid angle of a pixel, sr; 0 outside the picture. The pixel must be inside the image.
fn solid_angle(viewport: Viewport, pixel: vec2<i32>) -> f32 {
#when shared/tabulated
    if viewport.kind == KIND_TABULATED {
        return tabulated_solid_angle(viewport, pixel);
    }
#end
    if is_flat(viewport) {
        return flat_solid_angle(viewport, pixel);
    }
    let size = vec2<f32>(viewport.size);
    if viewport.kind == KIND_EQUIRECTANGULAR {
        let step = PI / size.y;
        let from_north = (f32(pixel.y) + 0.5) * step;
        let from_south = (f32(i32(viewport.size.y) - 1 - pixel.y) + 0.5) * step;
        return 4.0 * PI / size.x * precise_sin(min(from_north, from_south)) * precise_sin(0.5 * step);
    }
    let inverse_scale = 1.0 / viewport.plane_scale;
    let step = abs(inverse_scale);
    let area = step.x * step.y;
    if is_fisheye(viewport) {
        let doubled = doubled_offset(viewport, pixel);
        let n = i32(min(viewport.size.x, viewport.size.y));
        let squared = dot(doubled, doubled);
        if squared > n * n {
            return 0.0;
        }
        let complement = f32(n * n - squared) / f32(n * n);
        let p = vec2<f32>(doubled) / f32(n);
        // Towards the orthographic rim the density grows without bound, so nine points are averaged within 64 pixels of it. Within 1.5 pixels of any
        // rim (including that of a full sphere), some of the points would be outside, so the value at the centre is used.
        let orthographic = viewport.kind == KIND_ORTHOGRAPHIC;
        let steep = orthographic && squared > max(n - 128, 0) * max(n - 128, 0);
        let at_rim = (orthographic || viewport.full_sphere != 0u) && squared > (n - 3) * (n - 3);
        let average = (viewport.quadrature != 0u || steep) && !at_rim;
        if !average {
            return area * solid_angle_density(viewport, p, complement);
        }
        return area * averaged_density(viewport, p, step);
    }
    let t = (vec2<f32>(pixel) + 0.5 - viewport.plane_offset) * inverse_scale;
    return area * averaged_density(viewport, t, step);
}

// Returns the Gauss-Legendre mean of the density over a pixel, three points in each direction.
fn averaged_density(viewport: Viewport, centre: vec2<f32>, step: vec2<f32>) -> f32 {
    var sum = 0.0;
    let end = turns(viewport, 2);
    for (var j = -1; j < end; j++) {
        for (var i = -1; i < end; i++) {
            let p = centre + 0.5 * 0.774596669 * vec2(f32(i), f32(j)) * step;
            let weight = select(5.0, 8.0, i == 0) * select(5.0, 8.0, j == 0) / 324.0;
            sum += weight * solid_angle_density(viewport, p, 1.0 - dot(p, p));
        }
    }
    return sum;
}

// Returns the cube face that contains a direction (any length but 0).
fn cube_face_of(direction: vec3<f32>) -> u32 {
    let size = abs(direction);
    if size.z >= size.x && size.z >= size.y {
        return select(0u, 3u, direction.z > 0.0);
    }
    if size.y >= size.x {
        return select(4u, 5u, direction.y < 0.0);
    }
    return select(1u, 2u, direction.x < 0.0);
}

// Rotates a direction from the axes of one cube face to those of another.
fn face_from_face(other: u32, own: u32, direction: vec3<f32>) -> vec3<f32> {
    var forwards = FACE_FORWARD;
    var ups = FACE_UP;
    let forward = forwards[own];
    let up = ups[own];
    let in_cube = cross(forward, up) * direction.x + up * direction.y - forward * direction.z;
    let other_forward = forwards[other];
    let other_up = ups[other];
    return vec3(dot(in_cube, cross(other_forward, other_up)), dot(in_cube, other_up), -dot(in_cube, other_forward));
}

// A Gaussian that is round in view space: every pixel within its reach gets the density at the pixel's centre times the
// pixel's solid angle. It has the requested width, as an angle or in pixels, but is never so narrow that the sum over
// the pixels depends on the position of the star. The f64 twin is crates/render/src/reference/stars/gaussian.rs.

#import constants/kernels
#import constants/projections
#import shared/math
#import shared/projection
#import shared/viewport

struct Gaussian {
    // Unit vector, and its image.
    direction: vec3<f32>,
    pixel: vec2<f32>,
    // 1 / (2 sigma^2), and the square of the greatest chord.
    inverse: f32,
    cut_squared: f32,
    first: vec2<i32>,
    last: vec2<i32>,
}

// Returns the larger and the smaller angle that a pixel subtends around a direction (unit vector), rad. `image`: position of its image, pixels.
fn pixel_extent(viewport: Viewport, direction: vec3<f32>, image: vec2<f32>) -> vec2<f32> {
#when shared/tabulated
    if viewport.kind == KIND_TABULATED {
        return tabulated_extent(viewport, image);
    }
#end
    let step = abs(1.0 / viewport.plane_scale);
    let sine = length(direction.xy);
    let cosine = -direction.z;
    switch viewport.kind {
        case KIND_PERSPECTIVE: {
            return vec2(max(step.x, step.y) * cosine, min(step.x, step.y) * cosine * cosine);
        }
        case KIND_CUBE_FACE: {
            // Use the face that contains the star, so that all faces draw the same star.
            let along = max(abs(direction.x), max(abs(direction.y), abs(direction.z)));
            return vec2(step.x * along, step.x * along * along);
        }
        case KIND_EQUIRECTANGULAR: {
            let sides = vec2(2.0 * PI / f32(viewport.size.x) * length(direction.xz), PI / f32(viewport.size.y));
            return vec2(max(sides.x, sides.y), min(sides.x, sides.y));
        }
        default: {
            // cos(theta/2), and the radial and tangential derivatives of the mapping. Beyond the rim the values at the rim apply. If the derivative
            // of a mapping is infinite at its end, the angle of its last pixel is used.
            let half = sqrt(max(0.5 * (1.0 + cosine), 0.0));
            var radial = viewport.rim;
            var across = viewport.rim;
            switch viewport.kind {
                case KIND_EQUIDISTANT: {
                    let theta = precise_atan2(sine, cosine);
                    across = select(sine / max(theta, 1e-6), 1.0, theta < 1e-3) * viewport.rim;
                }
                case KIND_EQUISOLID: {
                    let at_rim = sqrt(max(1.0 - viewport.rim * viewport.rim, 0.0));
                    let held = max(max(half, at_rim), viewport.rim * sqrt(0.5 * step.x));
                    radial = 2.0 * viewport.rim / held;
                    across = 2.0 * viewport.rim * held;
                }
                case KIND_ORTHOGRAPHIC: {
                    radial = viewport.rim / max(max(cosine, sqrt(viewport.rim_complement)), viewport.rim * sqrt(0.5 * step.x));
                }
                default: {
                    let held = max(half, inverseSqrt(1.0 + viewport.rim * viewport.rim));
                    radial = 2.0 * viewport.rim * held * held;
                    across = radial;
                }
            }
            return vec2(max(radial, across), min(radial, across)) * step.x;
        }
    }
}

// Returns the squared chord between the star and the centre of a pixel of the unbounded plane, in a closed form without cancellation if the
// projection has one.
fn chord_squared(viewport: Viewport, gaussian: Gaussian, position: vec2<i32>) -> f32 {
    let offset = vec2<f32>(position) + 0.5 - gaussian.pixel;
    switch viewport.kind {
        case KIND_PERSPECTIVE, KIND_CUBE_FACE: {
            let scale = 1.0 / viewport.plane_scale;
            let a = (gaussian.pixel - viewport.plane_offset) * scale;
            let d = offset * scale;
            let b = a + d;
            let turn = a.x * d.y - a.y * d.x;
            let sine_squared = min((dot(d, d) + turn * turn) / ((1.0 + dot(a, a)) * (1.0 + dot(b, b))), 1.0);
            let cosine = sqrt(1.0 - sine_squared);
            // Beyond a right angle the cosine is negative.
            return select(2.0 * sine_squared / (1.0 + cosine), 2.0 + 2.0 * cosine, 1.0 + dot(a, b) < 0.0);
        }
        case KIND_EQUIRECTANGULAR: {
            let size = vec2<f32>(viewport.size);
            let star_angle = gaussian.pixel.y / size.y * PI;
            let pixel_angle = (f32(position.y) + 0.5) / size.y * PI;
            let half = precise_sin(0.5 * offset.y / size.y * PI);
            let turn = precise_sin(offset.x / size.x * PI);
            return 4.0 * (half * half + precise_sin(star_angle) * precise_sin(pixel_angle) * turn * turn);
        }
        default: {
            let difference = direction_of_pixel(viewport, position) - gaussian.direction;
            return dot(difference, difference);
        }
    }
}

// Returns the pixel of the picture; columns of an equirectangular picture wrap.
fn gaussian_pixel(viewport: Viewport, position: vec2<i32>) -> vec2<i32> {
    if viewport.kind == KIND_EQUIRECTANGULAR {
        let width = i32(viewport.size.x);
        return vec2((position.x % width + width) % width, position.y);
    }
    return position;
}

// Returns density times solid angle, before division by the norm.
fn gaussian_weight(viewport: Viewport, gaussian: Gaussian, position: vec2<i32>) -> f32 {
    let pixel = gaussian_pixel(viewport, position);
    if !contains(viewport, pixel) {
        return 0.0;
    }
    let squared = chord_squared(viewport, gaussian, position);
    if squared > gaussian.cut_squared {
        return 0.0;
    }
    return exp(-squared * gaussian.inverse) * solid_angle(viewport, pixel);
}

// Returns the reach of a kernel of radius `cut` (rad) on a flat plane, pixels; at most the width of the picture.
fn flat_gaussian_reach(viewport: Viewport, direction: vec3<f32>, cut: f32) -> f32 {
    var reach = f32(max(viewport.size.x, viewport.size.y));
    let most = reach;
    let outwards = precise_atan2(length(direction.xy), -direction.z) + cut;
    // On a flat plane, the number of pixels per angle grows outwards.
    if outwards < 1.56 {
        reach = (tan(outwards) - tan(outwards - cut)) * max(abs(viewport.plane_scale.x), abs(viewport.plane_scale.y));
    }
    return min(reach, most) + 0.5;
}

// Returns the reach in any projection, pixels. `shorter` is the smaller angle that a pixel subtends, rad.
fn gaussian_reach(viewport: Viewport, direction: vec3<f32>, shorter: f32, cut: f32) -> f32 {
    if viewport.kind <= KIND_CUBE_FACE {
        return flat_gaussian_reach(viewport, direction, cut);
    }
    let most = f32(max(viewport.size.x, viewport.size.y));
#when shared/tabulated
    if viewport.kind == KIND_TABULATED {
        return min(1.3 * cut / shorter, most) + 0.5;
    }
#end
    let outwards = precise_atan2(length(direction.xy), -direction.z) + cut;
    var reach = 1.3 * cut / shorter;
    if outwards > 0.97 * PI {
        // The whole rim is the image of the antipode.
        reach = most;
    }
    return min(reach, most) + 0.5;
}

// Returns the kernel around the image `pixel` of a star; `sigma` and `cut` in rad.
fn gaussian_around(viewport: Viewport, direction: vec3<f32>, pixel: vec2<f32>, reach: f32, sigma: f32, cut: f32) -> Gaussian {
    var gaussian: Gaussian;
    gaussian.direction = direction;
    gaussian.pixel = pixel;
    gaussian.inverse = 0.5 / (sigma * sigma);
    gaussian.cut_squared = cut * cut;
    let size = vec2<i32>(viewport.size);
    if viewport.kind == KIND_EQUIRECTANGULAR {
        let rows = ceil(cut / PI * f32(size.y)) + 1.0;
        gaussian.first.y = max(i32(floor(pixel.y - rows)), 0);
        gaussian.last.y = min(i32(floor(pixel.y + rows)), size.y - 1);
        // Range of longitudes of a circle around the star; all longitudes if the circle contains a pole or is close to one.
        let sine = length(direction.xz);
        var columns = size.x;
        if sin(min(cut, 1.5)) < 0.99 * sine && cut < 1.5 {
            let span = asin(sin(cut) / sine);
            columns = i32(ceil(span / (2.0 * PI) * f32(size.x))) + 1;
        }
        gaussian.first.x = i32(floor(pixel.x)) - columns;
        gaussian.last.x = i32(floor(pixel.x)) + columns;
        if 2 * columns + 1 >= size.x {
            gaussian.first.x = 0;
            gaussian.last.x = size.x - 1;
        }
    } else {
        gaussian.first = vec2<i32>(floor(pixel - reach));
        gaussian.last = vec2<i32>(floor(pixel + reach));
    }
    return gaussian;
}

// Returns the part of the kernel on another face of the cube, rendered or not; empty if the kernel does not reach it.
fn gaussian_on_face(viewport: Viewport, gaussian: Gaussian, face: u32, cut: f32) -> Gaussian {
    var on_face = gaussian;
    on_face.direction = face_from_face(face, viewport.face, gaussian.direction);
    on_face.last = on_face.first - 1;
    let pixel = flat_pixel_from_direction(viewport, on_face.direction);
    if pixel.z > 0.0 {
        let reach = flat_gaussian_reach(viewport, on_face.direction, cut);
        if all(pixel.xy > vec2(-reach)) && all(pixel.xy < vec2<f32>(viewport.size) + reach) {
            on_face.pixel = pixel.xy;
            on_face.first = vec2<i32>(floor(pixel.xy - reach));
            on_face.last = vec2<i32>(floor(pixel.xy + reach));
        }
    }
    return on_face;
}

// Returns the number of pictures over which the weights are summed for the norm. It is 1 if the kernel is inside the picture, and 6 if other pictures
// (the faces of a cube) continue beyond its border. If it is 0, the norm is the integral instead, so that only the light outside the picture is lost.
fn gaussian_pictures(viewport: Viewport, gaussian: Gaussian, reach: f32) -> u32 {
    let size = vec2<i32>(viewport.size);
    var whole = viewport.kind == KIND_EQUIRECTANGULAR || viewport.full_sphere != 0u;
    if !whole {
        whole = all(gaussian.first >= vec2(0)) && all(gaussian.last < size);
        if is_fisheye(viewport) {
            whole = whole && length(gaussian.pixel - viewport.plane_offset) + 1.5 * reach < 0.5 * f32(min(size.x, size.y));
        }
#when shared/tabulated
        if viewport.kind == KIND_TABULATED {
            whole = whole && tabulated_holds(viewport, gaussian.first, gaussian.last);
        }
#end
    }
    if whole {
        return 1u;
    }
    return select(0u, 6u, viewport.kind == KIND_CUBE_FACE);
}

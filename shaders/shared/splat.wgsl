// Splatting a point of light into a tile, in fixed point: the kernels on the image plane, exact at every border of a
// picture. The f64 twin is src/reference/stars.rs.

#import accumulate = shared/accumulate_u32 | shared/accumulate_u64
#import constants/kernels
#import constants/projections
#import shared/gaussian
#import shared/math
#import shared/plane_gaussian
#import shared/projection
#import shared/viewport

// First pixel and weights along one axis. Tent: pixels first, first + 1; B-spline: first .. first + 2.
fn kernel_first(x: f32, tent: bool) -> f32 {
    return select(floor(x) - 1.0, floor(x - 0.5), tent);
}

fn kernel_weights(x: f32, first: f32, tent: bool) -> vec3<f32> {
    let f = x - first - select(1.5, 0.5, tent);
    let spline = vec3(0.5 * (0.5 - f) * (0.5 - f), 0.75 - f * f, 0.5 * (0.5 + f) * (0.5 + f));
    return select(spline, vec3(1.0 - f, f, 0.0), tent);
}

// Sum of the weights that lie within 0 .. n along one axis.
fn weight_inside(x: f32, n: u32, tent: bool) -> f32 {
    let first = kernel_first(x, tent);
    let weights = kernel_weights(x, first, tent);
    let position = vec3(first, first + 1.0, first + 2.0);
    let inside = (position >= vec3(0.0)) & (position < vec3(f32(n)));
    return dot(weights, select(vec3(0.0), vec3(1.0), inside));
}

// Share of the kernel that lies inside any of the six faces of the cube.
fn weight_on_cube(viewport: Viewport, direction: vec3<f32>, tent: bool) -> f32 {
    var total = 0.0;
    for (var other = 0u; other < 6u; other++) {
        let pixel = pixel_from_direction(viewport, face_from_face(other, viewport.face, direction));
        if pixel.z > 0.0 {
            total += weight_inside(pixel.x, viewport.size.x, tent) * weight_inside(pixel.y, viewport.size.y, tent);
        }
    }
    return total;
}

// Share of the kernel that lies inside a round or tabulated picture.
fn weight_in_circle(viewport: Viewport, pixel: vec2<f32>, tent: bool) -> f32 {
    let first = vec2(kernel_first(pixel.x, tent), kernel_first(pixel.y, tent));
    let weights_x = kernel_weights(pixel.x, first.x, tent);
    let weights_y = kernel_weights(pixel.y, first.y, tent);
    var total = 0.0;
    for (var j = 0; j < 3; j++) {
        for (var i = 0; i < 3; i++) {
            if contains(viewport, vec2<i32>(first) + vec2(i, j)) {
                total += weights_x[i] * weights_y[j];
            }
        }
    }
    return total;
}

// Where a pixel of the unbounded plane lies in the picture: wraps, reflects, or falls outside (x < 0).
fn settle(viewport: Viewport, pixel: vec2<i32>) -> vec2<i32> {
    if viewport.kind == KIND_EQUIRECTANGULAR {
        let size = vec2<i32>(viewport.size);
        var x = pixel.x;
        var y = pixel.y;
        if y < 0 {
            y = -1 - y;
            x += size.x / 2;
        } else if y >= size.y {
            y = 2 * size.y - 1 - y;
            x += size.x / 2;
        }
        x = (x % size.x + size.x) % size.x;
        return vec2(x, clamp(y, 0, size.y - 1));
    }
    return select(vec2(-1), pixel, contains(viewport, pixel));
}

// Thresholds for rounding without bias, one per channel: a fraction above the threshold counts as a whole unit. From the
// star's number alone, so that the same frame gives the same bits.
fn rounding_threshold(number: u32) -> vec3<f32> {
    let random = hash(number);
    return (vec3(f32(random & 1023u), f32((random >> 10u) & 1023u), f32((random >> 20u) & 1023u)) + 0.5) * (1.0 / 1024.0);
}

// Adds one row of a kernel that lies inside, of a star whose light is below 2^20 units.
fn add_row(pixel: u32, light: vec3<f32>, weights: vec3<f32>, threshold: vec3<f32>, tent: bool) {
    accumulate_small(pixel, vec3<u32>(light * weights.x + threshold));
    accumulate_small(pixel + 1u, vec3<u32>(light * weights.y + threshold));
    if !tent {
        accumulate_small(pixel + 2u, vec3<u32>(light * weights.z + threshold));
    }
}

// Splats a star as a Gaussian that is round in view space.
fn splat_round(tile: Tile, viewport: Viewport, direction: vec3<f32>, pixel: vec2<f32>, light: vec3<f32>, threshold: vec3<f32>) {
    let gaussian = gaussian_of(viewport, direction, pixel);
    if gaussian.norm <= 0.0 {
        return;
    }
    let row_0 = i32(tile.first_row);
    let columns = gaussian.last.x - gaussian.first.x + 1;
    for (var y = max(gaussian.first.y, row_0); y <= min(gaussian.last.y, row_0 + i32(tile.rows) - 1); y++) {
        for (var x = gaussian.first.x; x <= gaussian.last.x; x++) {
            let weight = gaussian_weight(viewport, gaussian, vec2(x, y)) / gaussian.norm;
            if weight > 0.0 {
                let column = gaussian_pixel(viewport, vec2(x, y)).x;
                let index = tile.first_pixel + u32((y - row_0) * i32(viewport.size.x) + column);
                // Many pixels get a fraction of a unit: with one threshold for all of them the sum would be rounded as they are.
                let tap = f32((y - gaussian.first.y) * columns + x - gaussian.first.x);
                accumulate(index, floor(light * weight + fract(threshold + tap * 0.61803399)));
            }
        }
    }
}

// Splats a star as a Gaussian on the image plane, mixed with the B-spline.
fn splat_plane(
    tile: Tile, viewport: Viewport, direction: vec3<f32>, pixel: vec2<f32>, part: f32, light: vec3<f32>, threshold: vec3<f32>) {
    let first = vec2(plane_first(pixel.x), plane_first(pixel.y));
    let first_pixel = vec2<i32>(first);
    let size = vec2<i32>(viewport.size);
    let row_0 = i32(tile.first_row);
    let row_1 = row_0 + i32(tile.rows);
    var share = 1.0;
    if viewport.kind == KIND_CUBE_FACE {
        if any(first_pixel < vec2(0)) || any(first_pixel + PLANE_GAUSSIAN_PIXELS > size) {
            share = plane_weight_on_cube(viewport, direction, part);
        }
    } else if viewport.full_sphere != 0u {
        share = plane_weight_in_circle(viewport, pixel, part);
    }
    let scale = 1.0 / (share * plane_sums(pixel.x, viewport.size.x, part).x * plane_sums(pixel.y, viewport.size.y, part).x);
    for (var j = 0; j < PLANE_GAUSSIAN_PIXELS; j++) {
        let row_light = light * (scale * plane_density(pixel.y, first.y + f32(j), part));
        for (var k = 0; k < PLANE_GAUSSIAN_PIXELS; k++) {
            let at = settle(viewport, first_pixel + vec2(k, j));
            if at.x >= 0 && at.y >= row_0 && at.y < row_1 {
                let weight = plane_density(pixel.x, first.x + f32(k), part);
                accumulate(tile.first_pixel + u32((at.y - row_0) * size.x + at.x), floor(row_light * weight + threshold));
            }
        }
    }
}

// Whether a star counts as drawn in a tile: by the pixel that holds its image.
fn holds_image(tile: Tile, viewport: Viewport, pixel: vec2<f32>) -> bool {
    let centre = vec2<i32>(floor(pixel));
    var own = settle(viewport, centre);
    if viewport.full_sphere != 0u {
        // Every star is in this picture, also one whose pixel's centre lies just over the rim.
        own = clamp(centre, vec2(0), vec2<i32>(viewport.size) - 1);
    }
    return own.x >= 0 && own.y >= i32(tile.first_row) && own.y < i32(tile.first_row + tile.rows);
}

// Splats light of `illuminance` lx in `direction`, whose image is at `pixel`, into a tile. `scale` is the light in units of the sums for
// a colour of luminance 1, `number` decides how it is rounded.
fn splat(
    tile: Tile, viewport: Viewport, direction: vec3<f32>, pixel: vec2<f32>, illuminance: f32, colour: vec3<f32>, scale: f32, number: u32) {
    let row_0 = i32(tile.first_row);
    let row_1 = i32(tile.first_row + tile.rows);
    let size = vec2<i32>(viewport.size);
    let threshold = rounding_threshold(number);
    if illuminance >= viewport.gaussian_from_lx {
        if viewport.gaussian_on_plane != 0u {
            splat_plane(tile, viewport, direction, pixel, gaussian_part(viewport, illuminance), colour * scale, threshold);
        } else {
            splat_round(tile, viewport, direction, pixel, colour * scale, threshold);
        }
        return;
    }
    let tent = illuminance < viewport.tent_below_lx;
    let n = select(3, 2, tent);
    let first = vec2(kernel_first(pixel.x, tent), kernel_first(pixel.y, tent));
    let first_pixel = vec2<i32>(first);
    let last_pixel = first_pixel + vec2(n - 1);
    let weights_x = kernel_weights(pixel.x, first.x, tent);
    let weights_y = kernel_weights(pixel.y, first.y, tent);
    // Inside of the picture, and of this tile's rows: nothing of the kernel falls over a border.
    var in_picture = all(first_pixel >= vec2(0)) && all(last_pixel < size);
    if is_fisheye(viewport) {
        let doubled = 2.0 * (pixel - viewport.plane_offset);
        let reach = f32(min(size.x, size.y)) - 6.0;
        in_picture = in_picture && reach > 0.0 && dot(doubled, doubled) < reach * reach;
    }
#when shared/tabulated
    if viewport.kind == KIND_TABULATED {
        in_picture = in_picture && tabulated_holds(viewport, first_pixel, last_pixel);
    }
#end
    let inside = in_picture && first_pixel.y >= row_0 && last_pixel.y < row_1;
    var share = 1.0;
    if !in_picture {
        // Pictures that go on beyond this border keep the star's light whole.
        if viewport.kind == KIND_CUBE_FACE {
            share = weight_on_cube(viewport, direction, tent);
        } else if viewport.full_sphere != 0u {
            share = weight_in_circle(viewport, pixel, tent);
        }
    }
    let light = colour * (scale / share);
    // Most stars are faint, and most stand inside: they take the short way.
    if inside && max(light.x, max(light.y, light.z)) < 1048576.0 {
        let row = u32(size.x);
        let pixel_0 = tile.first_pixel + u32(first_pixel.y - row_0) * row + u32(first_pixel.x);
        add_row(pixel_0, light * weights_y.x, weights_x, threshold, tent);
        add_row(pixel_0 + row, light * weights_y.y, weights_x, threshold, tent);
        if !tent {
            add_row(pixel_0 + 2u * row, light * weights_y.z, weights_x, threshold, tent);
        }
        return;
    }
    for (var j = 0; j < n; j++) {
        let row_light = light * weights_y[j];
        for (var k = 0; k < n; k++) {
            var at = first_pixel + vec2(k, j);
            if !inside {
                at = settle(viewport, at);
                if at.x < 0 || at.y < row_0 || at.y >= row_1 {
                    continue;
                }
            }
            let units = floor(row_light * weights_x[k] + threshold);
            accumulate(tile.first_pixel + u32((at.y - row_0) * size.x + at.x), units);
        }
    }
}

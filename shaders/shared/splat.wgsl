// Splats a point of light into a tile, in fixed point. The kernels on the image plane are exact at every border of a picture. The f64 twin is
// crates/render/src/reference/stars/splat.rs.

#import accumulate = shared/accumulate_u32 | shared/accumulate_u64
#import constants/kernels
#import constants/projections
#import shared/gaussian
#import shared/math
#import shared/plane_gaussian
#import shared/projection
#import shared/viewport

// Whether the brightest stars are Gaussians that are round in view space; otherwise they are Gaussians on the image plane.
override ROUND_KERNEL: bool = false;

// The image of a point of light.
struct Image {
    // View axes, any length.
    direction: vec3<f32>,
    // The larger and the smaller angle that a pixel subtends there, rad.
    extent: vec2<f32>,
    // Position, pixels.
    pixel: vec2<f32>,
    // Luminance of a pixel that contains all of the light, cd/m^2. Kernels are chosen by this value.
    peak: f32,
}

// Returns the first pixel of a kernel along one axis. The tent has the pixels first and first + 1, the B-spline first to first + 2.
fn kernel_first(x: f32, tent: bool) -> f32 {
    return select(floor(x) - 1.0, floor(x - 0.5), tent);
}

fn kernel_weights(x: f32, first: f32, tent: bool) -> vec3<f32> {
    let f = x - first - select(1.5, 0.5, tent);
    let spline = vec3(0.5 * (0.5 - f) * (0.5 - f), 0.75 - f * f, 0.5 * (0.5 + f) * (0.5 + f));
    return select(spline, vec3(1.0 - f, f, 0.0), tent);
}

// Returns the sum of the weights of the pixels 0 .. n along one axis.
fn weight_inside(x: f32, n: u32, tent: bool) -> f32 {
    let first = kernel_first(x, tent);
    let weights = kernel_weights(x, first, tent);
    let position = vec3(first, first + 1.0, first + 2.0);
    let inside = (position >= vec3(0.0)) & (position < vec3(f32(n)));
    return dot(weights, select(vec3(0.0), vec3(1.0), inside));
}

// Returns the share of the kernel inside any of the six faces of the cube.
fn weight_on_cube(viewport: Viewport, direction: vec3<f32>, tent: bool) -> f32 {
    var total = 0.0;
    let faces = u32(turns(viewport, 6));
    for (var other = 0u; other < faces; other++) {
        let pixel = flat_pixel_from_direction(viewport, face_from_face(other, viewport.face, direction));
        if pixel.z > 0.0 {
            total += weight_inside(pixel.x, viewport.size.x, tent) * weight_inside(pixel.y, viewport.size.y, tent);
        }
    }
    return total;
}

// Returns the share of the kernel inside a round or tabulated picture.
fn weight_in_circle(viewport: Viewport, pixel: vec2<f32>, tent: bool) -> f32 {
    let first = vec2(kernel_first(pixel.x, tent), kernel_first(pixel.y, tent));
    let weights_x = kernel_weights(pixel.x, first.x, tent);
    let weights_y = kernel_weights(pixel.y, first.y, tent);
    var total = 0.0;
    let n = turns(viewport, 3);
    for (var j = 0; j < n; j++) {
        for (var i = 0; i < n; i++) {
            if contains(viewport, vec2<i32>(first) + vec2(i, j)) {
                total += weights_x[i] * weights_y[j];
            }
        }
    }
    return total;
}

// Maps a pixel of the unbounded plane to the picture: wraps, reflects, or returns x < 0 if it is outside.
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

// Returns the thresholds for unbiased rounding, one per channel: a fraction above the threshold counts as a whole unit. They depend only on the
// star's number, so the same frame gives the same bits.
fn rounding_threshold(number: u32) -> vec3<f32> {
    let random = hash(number);
    return (vec3(f32(random & 1023u), f32((random >> 10u) & 1023u), f32((random >> 20u) & 1023u)) + 0.5) * (1.0 / 1024.0);
}

// Splats a star as a Gaussian that is round in view space. One loop first sums the weights for the norm, picture by picture, and then draws, because
// software drivers are slow to compile the code of a weight, which then occurs only once.
fn splat_round(tile: Tile, viewport: Viewport, image: Image, light: vec3<f32>, threshold: vec3<f32>) {
    let direction = normalize(image.direction);
    let pixel = image.pixel;
    let extent = image.extent;
    let sigma = max(viewport.gaussian_sigma_rad, viewport.gaussian_sigma_px * extent.x);
    let cut = GAUSSIAN_CUT * sigma;
    let reach = gaussian_reach(viewport, direction, extent.y, cut);
    let own = gaussian_around(viewport, direction, pixel, reach, sigma, cut);
    let columns = own.last.x - own.first.x + 1;
    let row_0 = i32(tile.first_row);
    let pictures = gaussian_pictures(viewport, own, reach);
    // The integral of exp(-chord^2 / (2 sigma^2)) over the sphere within the cut.
    var norm = select(0.0, 2.0 * PI * sigma * sigma * (1.0 - exp(-0.5 * GAUSSIAN_CUT * GAUSSIAN_CUT)), pictures == 0u);
    for (var picture = 0u; picture <= pictures; picture++) {
        let draws = picture == pictures;
        var gaussian = own;
        if draws {
            if norm <= 0.0 {
                return;
            }
            gaussian.first.y = max(own.first.y, row_0);
            gaussian.last.y = min(own.last.y, row_0 + i32(tile.rows) - 1);
        } else if pictures > 1u {
            gaussian = gaussian_on_face(viewport, own, picture, cut);
        }
        var sum = 0.0;
        for (var y = gaussian.first.y; y <= gaussian.last.y; y++) {
            for (var x = gaussian.first.x; x <= gaussian.last.x; x++) {
                let weight = gaussian_weight(viewport, gaussian, vec2(x, y));
                sum += weight;
                if draws && weight > 0.0 {
                    let column = gaussian_pixel(viewport, vec2(x, y)).x;
                    let index = tile.first_pixel + u32((y - row_0) * i32(viewport.size.x) + column);
                    // Many pixels receive a fraction of a unit. With a single threshold for all of them, rounding would bias their sum.
                    let tap = f32((y - own.first.y) * columns + x - own.first.x);
                    accumulate(index, floor(light * (weight / norm) + fract(threshold + tap * 0.61803399)));
                }
            }
        }
        norm += sum;
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
    let sums = plane_sums(viewport, pixel.x, viewport.size.x, part).x * plane_sums(viewport, pixel.y, viewport.size.y, part).x;
    let scale = 1.0 / (share * sums);
    let pixels = turns(viewport, PLANE_GAUSSIAN_PIXELS);
    for (var j = 0; j < pixels; j++) {
        let row_light = light * (scale * plane_density(pixel.y, first.y + f32(j), part));
        for (var k = 0; k < pixels; k++) {
            let position = settle(viewport, first_pixel + vec2(k, j));
            if position.x >= 0 && position.y >= row_0 && position.y < row_1 {
                let weight = plane_density(pixel.x, first.x + f32(k), part);
                accumulate(tile.first_pixel + u32((position.y - row_0) * size.x + position.x), floor(row_light * weight + threshold));
            }
        }
    }
}

// Whether a star counts as drawn in a tile, decided by the pixel that contains its image.
fn holds_image(tile: Tile, viewport: Viewport, pixel: vec2<f32>) -> bool {
    let centre = vec2<i32>(floor(pixel));
    var own = settle(viewport, centre);
    if viewport.full_sphere != 0u {
        // This picture contains every star, even if the centre of the star's pixel is slightly beyond the rim.
        own = clamp(centre, vec2(0), vec2<i32>(viewport.size) - 1);
    }
    return own.x >= 0 && own.y >= i32(tile.first_row) && own.y < i32(tile.first_row + tile.rows);
}

// Returns the image of `illuminance` lx from `direction` (any length) at `pixel`.
fn image_of(viewport: Viewport, direction: vec3<f32>, pixel: vec2<f32>, illuminance: f32) -> Image {
    let extent = pixel_extent(viewport, normalize(direction), pixel);
    return Image(direction, extent, pixel, illuminance / (extent.x * extent.y));
}

// Splats light into a tile, with the kernel for the image's peak. `scale` is the light in units of the sums for a colour of luminance 1; `number`
// determines the rounding.
fn splat(tile: Tile, viewport: Viewport, image: Image, colour: vec3<f32>, scale: f32, number: u32) {
    let pixel = image.pixel;
    let peak = image.peak;
    let row_0 = i32(tile.first_row);
    let row_1 = i32(tile.first_row + tile.rows);
    let size = vec2<i32>(viewport.size);
    let threshold = rounding_threshold(number);
    if peak >= viewport.gaussian_from_cd_m2 {
        if ROUND_KERNEL {
            splat_round(tile, viewport, image, colour * scale, threshold);
        } else {
            splat_plane(tile, viewport, image.direction, pixel, gaussian_part(viewport, peak), colour * scale, threshold);
        }
        return;
    }
    let tent = peak < viewport.tent_below_cd_m2;
    let n = select(3, 2, tent);
    let first = vec2(kernel_first(pixel.x, tent), kernel_first(pixel.y, tent));
    let first_pixel = vec2<i32>(first);
    let last_pixel = first_pixel + vec2(n - 1);
    let weights_x = kernel_weights(pixel.x, first.x, tent);
    let weights_y = kernel_weights(pixel.y, first.y, tent);
    // Whether the whole kernel is inside the picture, and inside this tile's rows.
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
        // If pictures continue beyond this border, the star's light is preserved.
        if viewport.kind == KIND_CUBE_FACE {
            share = weight_on_cube(viewport, image.direction, tent);
        } else if viewport.full_sphere != 0u {
            share = weight_in_circle(viewport, pixel, tent);
        }
    }
    let light = colour * (scale / share);
    for (var j = 0; j < n; j++) {
        let row_light = light * weights_y[j];
        for (var k = 0; k < n; k++) {
            var position = first_pixel + vec2(k, j);
            if !inside {
                position = settle(viewport, position);
                if position.x < 0 || position.y < row_0 || position.y >= row_1 {
                    continue;
                }
            }
            let units = floor(row_light * weights_x[k] + threshold);
            accumulate(tile.first_pixel + u32((position.y - row_0) * size.x + position.x), units);
        }
    }
}

// Kernel of `auto` for stars so bright that the B-spline would flicker visibly: along each axis a mixture of the B-spline and a Gaussian of 0.757
// pixels, sampled at the centres of seven pixels. Both keep the centroid and the width. The share of the Gaussian grows with brightness, so there is
// no jump between stars with the B-spline and stars with this kernel. The f64 twin is `bright_kernel` in crates/sky/src/photometry/kernel.rs.

#import constants/kernels
#import shared/projection
#import shared/viewport

// 1 / (2 * 0.757^2), and 1 / (0.757 sqrt(2 pi)).
const PLANE_GAUSSIAN_INVERSE: f32 = 0.872526;
const PLANE_GAUSSIAN_PEAK: f32 = 0.527005;

// Returns the share of the Gaussian for a star whose illuminance per solid angle of a pixel is `peak`.
fn gaussian_part(viewport: Viewport, peak: f32) -> f32 {
    let brighter = peak / max(viewport.gaussian_from_cd_m2, 1e-30);
    return smoothstep(0.0, 1.0, log2(max(brighter, 1e-30)) / log2(PLANE_GAUSSIAN_GROWTH));
}

// Returns the first pixel of the kernel along one axis.
fn plane_first(x: f32) -> f32 {
    return floor(x) - 3.0;
}

// Returns the weight of a pixel along one axis.
fn plane_density(x: f32, pixel: f32, part: f32) -> f32 {
    let offset = abs(pixel + 0.5 - x);
    let beside = max(1.5 - offset, 0.0);
    let spline = select(0.5 * beside * beside, 0.75 - offset * offset, offset < 0.5);
    return mix(spline, PLANE_GAUSSIAN_PEAK * exp(-PLANE_GAUSSIAN_INVERSE * offset * offset), part);
}

// Returns two sums of weights along one axis: of all weights, and of those of the pixels 0 .. n.
fn plane_sums(viewport: Viewport, x: f32, n: u32, part: f32) -> vec2<f32> {
    let first = plane_first(x);
    let pixels = turns(viewport, PLANE_GAUSSIAN_PIXELS);
    var sums = vec2(0.0);
    for (var i = 0; i < pixels; i++) {
        let pixel = first + f32(i);
        let density = plane_density(x, pixel, part);
        sums += vec2(density, select(0.0, density, pixel >= 0.0 && pixel < f32(n)));
    }
    return sums;
}

// Returns the share of the kernel inside any of the six faces of the cube.
fn plane_weight_on_cube(viewport: Viewport, direction: vec3<f32>, part: f32) -> f32 {
    var total = 0.0;
    let faces = u32(turns(viewport, 6));
    for (var other = 0u; other < faces; other++) {
        let pixel = flat_pixel_from_direction(viewport, face_from_face(other, viewport.face, direction));
        if pixel.z > 0.0 {
            let x = plane_sums(viewport, pixel.x, viewport.size.x, part);
            let y = plane_sums(viewport, pixel.y, viewport.size.y, part);
            total += x.y * y.y / (x.x * y.x);
        }
    }
    return total;
}

// Returns the share of the kernel inside a round or tabulated picture.
fn plane_weight_in_circle(viewport: Viewport, pixel: vec2<f32>, part: f32) -> f32 {
    let first = vec2(plane_first(pixel.x), plane_first(pixel.y));
    var total = 0.0;
    var inside = 0.0;
    let pixels = turns(viewport, PLANE_GAUSSIAN_PIXELS);
    for (var j = 0; j < pixels; j++) {
        for (var i = 0; i < pixels; i++) {
            let position = first + vec2(f32(i), f32(j));
            let density = plane_density(pixel.x, position.x, part) * plane_density(pixel.y, position.y, part);
            total += density;
            inside += select(0.0, density, contains(viewport, vec2<i32>(position)));
        }
    }
    return inside / total;
}

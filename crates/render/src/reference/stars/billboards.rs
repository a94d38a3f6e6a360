//! The star methods that use blending, in f64: points, discs, Gaussians and textured billboards on flat planes. Pictures that are not flat are drawn
//! onto cube faces first. The twin of `passes::billboards` and of the following resolve pass.
//!
//! It evaluates the published formulas at pixel centres like the fragment shader, with two differences: solid angles of
//! pixels are exact instead of two triangles in f32, and positions are not rounded to the rasteriser's sub-pixel grid.
//! Luminance is in cd/m^2.

use std::f64::consts::PI;

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::splat::Eye;
use crate::{
    catalogue::{chunks::StarSet, packed::temperature_of_step_k},
    photometry::{blackbody::rec709_in_gamut, star_image::StarImage},
    plan::{
        settings::StarMethod,
        stars::{
            billboards::{
                BillboardPlan, DrawnPsf, GREATEST_BRIGHTNESS, PUBLISHED_POGSON, SCALED_DISC_RANGE, THRESHOLD_BRIGHTNESS,
            },
            cube_faces::{CubeFaces, GUARD_PX},
        },
    },
    units::{PARSEC_M, illuminance_lx_from_magnitude, magnitude_from_illuminance_lx},
    view::projection::{Face, Perspective, PlaneMapping, Projection, pixel_centre},
};

/// Images used by `sprite` and `psf_texture`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Images<'a> {
    /// Image of `sprite`.
    pub sprite: Option<&'a StarImage>,
    /// Image of `psf_texture`.
    pub psf: Option<&'a DrawnPsf>,
}

/// Draws all stars of a set for an eye at rest (these methods do not support a moving one) with the method of `plan`,
/// using cube faces of at most `max_side_px` texels if the projection is not flat. Returns the luminance of every
/// pixel, linear Rec. 709 in cd/m^2, row by row from the top.
pub fn draw(
    set: &StarSet,
    eye: Eye,
    projection: &Projection,
    max_side_px: u32,
    plan: &BillboardPlan,
    images: Images<'_>,
) -> Vec<[f64; 3]> {
    let on_plane = |eye: Eye, plane: &Perspective, view_from_plane: DQuat| {
        let mut canvas = Canvas::new(plane, view_from_plane);
        canvas.draw(set, eye, plan, images);
        canvas.luminances
    };
    match (projection, CubeFaces::for_projection(projection, max_side_px)) {
        (Projection::Perspective(plane), _) => on_plane(eye, plane, DQuat::IDENTITY),
        (Projection::CubeFace(face), _) => on_plane(eye, face.plane(), face.face.cube_from_face()),
        (_, Some(cube)) => {
            let faces = Face::ALL.map(|face| {
                let turned = Eye { world_from_view: eye.world_from_view * face.cube_from_face(), ..eye };
                let needed = cube.needed[Face::ALL.iter().position(|other| *other == face).unwrap_or(0)];
                if needed { on_plane(turned, &cube.plane(), face.cube_from_face()) } else { Vec::new() }
            });
            look_up(projection.mapping(), cube, &faces)
        }
        (_, None) => Vec::new(),
    }
}

/// Returns the luminance of every pixel of a picture, interpolated from the faces of its cube.
fn look_up(mapping: &dyn PlaneMapping, cube: CubeFaces, faces: &[Vec<[f64; 3]>; 6]) -> Vec<[f64; 3]> {
    let [width, height] = mapping.size();
    let side = (cube.edge_px + 2 * GUARD_PX) as usize;
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    pixels
        .map(|(x, y)| {
            if !mapping.contains(x, y) {
                return [0.0; 3];
            }
            let Some(direction) = mapping.direction_from_pixel(pixel_centre(x, y)) else { return [0.0; 3] };
            let along = |face: &Face| (face.cube_from_face() * DVec3::NEG_Z).dot(direction);
            let nearest = (0..6).max_by(|a, b| along(&Face::ALL[*a]).total_cmp(&along(&Face::ALL[*b])));
            let index = nearest.unwrap_or(0);
            let on_face = Face::ALL[index].cube_from_face().conjugate() * direction;
            let Some(place) = cube.plane().pixel_from_direction(on_face) else { return [0.0; 3] };
            let image = &faces[index];
            let first = (place - 0.5).floor();
            let part = place - 0.5 - first;
            let texel = |i: usize, j: usize| image[(first.y as usize + j) * side + first.x as usize + i];
            [0, 1, 2].map(|channel| {
                let mix = |j: usize| texel(0, j)[channel] * (1.0 - part.x) + texel(1, j)[channel] * part.x;
                mix(0) * (1.0 - part.y) + mix(1) * part.y
            })
        })
        .collect()
}

/// A flat plane and the picture on it.
struct Canvas<'a> {
    plane: &'a Perspective,
    view_from_plane: DQuat,
    luminances: Vec<[f64; 3]>,
}

/// A star to be drawn.
struct Star {
    /// Unit vector in the axes of the plane.
    direction: DVec3,
    illuminance_lx: f64,
    /// Colour of luminance 1.
    colour: [f64; 3],
}

impl<'a> Canvas<'a> {
    fn new(plane: &'a Perspective, view_from_plane: DQuat) -> Self {
        let [width, height] = plane.size();
        Self { plane, view_from_plane, luminances: vec![[0.0; 3]; width as usize * height as usize] }
    }

    fn draw(&mut self, set: &StarSet, eye: Eye, plan: &BillboardPlan, images: Images<'_>) {
        let eye_pc = eye.position_m / PARSEC_M;
        let plane_from_world = eye.world_from_view.conjugate();
        for (position, at_infinity, star) in set.iter() {
            let place = if at_infinity { position.normalize_or_zero() } else { position - eye_pc };
            let illuminance_lx = star.illuminance_at_1_pc_lx() / place.length_squared();
            if illuminance_lx >= plan.faintest_lx && illuminance_lx.is_finite() {
                let colour = rec709_in_gamut(temperature_of_step_k(star.temperature_step()));
                let direction = plane_from_world * place.normalize();
                self.star(&Star { direction, illuminance_lx, colour }, plan, images);
            }
        }
    }

    fn star(&mut self, star: &Star, plan: &BillboardPlan, images: Images<'_>) {
        let illuminance = star.illuminance_lx;
        let magnitude = magnitude_from_illuminance_lx(illuminance);
        let cone = |r: f64| 3.0 * (1.0 - r).max(0.0);
        match plan.method {
            StarMethod::HardwarePoint | StarMethod::HardwareSmoothPoint => {
                let Some(centre) = self.plane.pixel_from_direction(star.direction) else { return };
                let luminance = illuminance / self.pixel_sr(centre);
                let is_point = plan.method == StarMethod::HardwarePoint;
                self.on_plane(star, 1.5, luminance, |offset| {
                    // A point covers the pixel that contains it.
                    let inside = (centre + offset).floor() == centre.floor();
                    if is_point { f64::from(u8::from(inside)) } else { (1.0 - offset.length()).clamp(0.0, 1.0) }
                });
            }
            StarMethod::Disc | StarMethod::SmoothDisc => {
                let is_disc = plan.method == StarMethod::Disc;
                let luminance = illuminance / plan.solid_angle_sr;
                self.in_sky(star, plan.radius_rad, luminance, |on_square| {
                    let r = on_square.length();
                    [if is_disc { f64::from(u8::from(r < 1.0)) } else { cone(r) }; 3]
                });
            }
            StarMethod::ScaledDisc => {
                let [largest, smallest] = SCALED_DISC_RANGE;
                let scale = map_range(magnitude, plan.magnitudes, [largest, smallest]);
                let luminance = illuminance / (plan.solid_angle_sr * scale * scale);
                self.in_sky(star, plan.radius_rad * scale, luminance, |on_square| [cone(on_square.length()); 3]);
            }
            StarMethod::GlareDisc => {
                let luminance = illuminance / plan.solid_angle_sr;
                let scale = map_range(luminance.sqrt(), [0.0, 5.0], [1.0, 100.0]);
                self.in_sky(star, plan.radius_rad * scale, luminance, |on_square| {
                    let r = on_square.length().min(1.0);
                    let glare = 0.5 * (0.5 / (r + 0.1).powi(2) - 0.5).max(0.0) / (scale * scale);
                    [0.8 * cone(r * scale) + 0.2 * glare; 3]
                });
            }
            StarMethod::Sprite => {
                let Some(image) = images.sprite else { return };
                let size = f64::from(image.size);
                let luminance = illuminance / plan.solid_angle_sr;
                self.in_sky(star, plan.radius_rad, luminance, |on_square| {
                    if on_square.abs().max_element() > 1.0 {
                        return [0.0; 3];
                    }
                    image.sample((0.5 + 0.5 * on_square.x) * size, (0.5 - 0.5 * on_square.y) * size)
                });
            }
            StarMethod::GaussianPsf | StarMethod::GaussianPsfIntegrated => self.gaussian(star, plan, magnitude),
            StarMethod::ScreenBillboard => {
                let brightness = illuminance / illuminance_lx_from_magnitude(plan.gaussian.saturation_magnitude);
                let half = plan.half_side_px;
                self.on_plane(star, half, brightness * plan.white_cd_m2, |offset| {
                    (1.0 - (offset / half).length_squared()).max(0.0).powi(2)
                });
            }
            StarMethod::PsfTexture => {
                let Some(psf) = images.psf else { return };
                let [left, right, ..] = self.plane.edge_tangents(0.0);
                let least = BillboardPlan::least_crop_rad(psf, (right - left) / f64::from(self.plane.size()[0]));
                let half = (plan.crop_rad * illuminance.sqrt()).clamp(least, psf.form.half_width_rad());
                let tangent = (half * 2.0_f64.sqrt()).tan() / 2.0_f64.sqrt();
                self.in_sky(star, tangent, illuminance, |on_square| {
                    let on_plane = on_square * tangent;
                    let angles = on_plane.normalize_or_zero() * on_plane.length().atan();
                    if angles.abs().max_element() > half {
                        return [0.0; 3];
                    }
                    psf.form.density(angles)
                });
            }
            _ => {}
        }
    }

    fn gaussian(&mut self, star: &Star, plan: &BillboardPlan, magnitude: f64) {
        let gaussian = plan.gaussian;
        let magnitude_range = gaussian.limiting_magnitude - gaussian.saturation_magnitude;
        let exponent = magnitude_range * (gaussian.saturation_magnitude - magnitude);
        let brightness = PUBLISHED_POGSON.powf(exponent).min(GREATEST_BRIGHTNESS);
        let reach2 = |brightness: f64, sigma2: f64| (brightness / THRESHOLD_BRIGHTNESS).ln() * 2.0 * sigma2;
        let core = reach2(brightness, gaussian.sigma2_px2);
        let glare = reach2(brightness * gaussian.glare_brightness, gaussian.glare_sigma2_px2);
        let half = core.max(glare).max(0.0).sqrt();
        let luminance = brightness * plan.white_cd_m2;
        if plan.method == StarMethod::GaussianPsf {
            self.on_plane(star, half, luminance, |offset| {
                let value = |sigma2: f64| (-offset.length_squared() / (2.0 * sigma2)).exp();
                value(gaussian.sigma2_px2) + gaussian.glare_brightness * value(gaussian.glare_sigma2_px2)
            });
        } else if half > 0.0 {
            self.on_plane(star, half + 0.5, luminance, |offset| {
                let value = |sigma2: f64| mean_of_gaussian(offset.x, sigma2) * mean_of_gaussian(offset.y, sigma2);
                value(gaussian.sigma2_px2) + gaussian.glare_brightness * value(gaussian.glare_sigma2_px2)
            });
        }
    }

    /// Returns the exact solid angle of the pixel at a position of the plane, also outside of the picture, sr.
    fn pixel_sr(&self, centre: DVec2) -> f64 {
        let [left, right, down, up] = self.plane.edge_tangents(0.0);
        let [width, height] = self.plane.size();
        let step = DVec2::new((right - left) / f64::from(width), (up - down) / f64::from(height));
        let x = left + centre.x.floor() * step.x;
        let y = up - centre.y.floor() * step.y;
        Perspective::from_tangents([1, 1], [x, x + step.x, y - step.y, y]).solid_angle_sr(0, 0)
    }

    /// Adds a star to the pixels whose centres lie within `half` of its image along both axes.
    fn on_plane(&mut self, star: &Star, half: f64, luminance: f64, profile: impl Fn(DVec2) -> f64) {
        let Some(centre) = self.plane.pixel_from_direction(star.direction) else { return };
        for (x, y) in self.pixels_between(centre - half, centre + half) {
            let offset = pixel_centre(x, y) - centre;
            if offset.abs().max_element() <= half {
                self.add(x, y, star, luminance, [profile(offset); 3]);
            }
        }
    }

    /// Adds a star to the pixels of a square tangent to the sky at its direction. `profile` takes positions on it in
    /// units of its half side, to the right and up.
    fn in_sky(&mut self, star: &Star, tangent: f64, luminance: f64, profile: impl Fn(DVec2) -> [f64; 3]) {
        let (right, up) = self.axes(star.direction);
        let corners = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)];
        let mut bounds = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for (i, j) in corners {
            let corner = star.direction + tangent * (i * right + j * up);
            match self.plane.pixel_from_direction(corner) {
                Some(corner_px) => bounds = (bounds.0.min(corner_px), bounds.1.max(corner_px)),
                None => bounds = (DVec2::NEG_INFINITY, DVec2::INFINITY),
            }
            if bounds.1.x == f64::INFINITY {
                break;
            }
        }
        for (x, y) in self.pixels_between(bounds.0 - 1.0, bounds.1 + 1.0) {
            let Some(direction) = self.plane.direction_from_pixel(pixel_centre(x, y)) else { continue };
            let along = direction.dot(star.direction);
            if along > 0.0 {
                let on_square = DVec2::new(direction.dot(right), direction.dot(up)) / (along * tangent);
                self.add(x, y, star, luminance, profile(on_square));
            }
        }
    }

    /// Returns the right and up axes of a billboard: those of the view, rotated by the shortest rotation from the view's axis to the star.
    fn axes(&self, direction: DVec3) -> (DVec3, DVec3) {
        let in_view = self.view_from_plane * direction;
        let turn = DMat3::from_quat(DQuat::from_rotation_arc(DVec3::NEG_Z, in_view));
        let back = self.view_from_plane.conjugate();
        (back * turn.x_axis, back * turn.y_axis)
    }

    fn pixels_between(&self, low: DVec2, high: DVec2) -> Vec<(u32, u32)> {
        let [width, height] = self.plane.size();
        let range = |low: f64, high: f64, side: u32| {
            (low.floor().clamp(0.0, f64::from(side)) as u32)..(high.ceil().clamp(0.0, f64::from(side)) as u32)
        };
        let columns = range(low.x, high.x, width);
        range(low.y, high.y, height).flat_map(|y| columns.clone().map(move |x| (x, y))).collect()
    }

    fn add(&mut self, x: u32, y: u32, star: &Star, luminance: f64, profile: [f64; 3]) {
        let pixel = &mut self.luminances[y as usize * self.plane.size()[0] as usize + x as usize];
        for channel in 0..3 {
            pixel[channel] += luminance * star.colour[channel] * profile[channel];
        }
    }
}

/// Maps `value` linearly from the interval `from` to the interval `to`, clamped at the ends.
fn map_range(value: f64, from: [f64; 2], to: [f64; 2]) -> f64 {
    to[0] + (value.clamp(from[0], from[1]) - from[0]) / (from[1] - from[0]) * (to[1] - to[0])
}

/// Returns the mean of exp(-u^2 / (2 sigma^2)) over the pixel from u - 1/2 to u + 1/2.
fn mean_of_gaussian(u: f64, sigma2: f64) -> f64 {
    let scale = (2.0 * sigma2).sqrt();
    PI.sqrt() / 2.0 * scale * (erf((u + 0.5) / scale) - erf((u - 0.5) / scale))
}

/// Returns the error function, by its series with terms of equal sign.
fn erf(x: f64) -> f64 {
    if x.abs() > 6.0 {
        return x.signum();
    }
    let mut term = x;
    let mut sum = x;
    let mut n = 1.0;
    while term.abs() > 1e-17 * sum.abs() {
        term *= 2.0 * x * x / (2.0 * n + 1.0);
        sum += term;
        n += 1.0;
    }
    2.0 / PI.sqrt() * (-x * x).exp() * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_function_has_its_tabulated_values() {
        // Abramowitz and Stegun, table 7.1.
        for (x, value) in [(0.0, 0.0), (0.5, 0.520_499_877_8), (1.0, 0.842_700_792_9), (2.0, 0.995_322_265_0)] {
            assert!((erf(x) - value).abs() < 1e-10 && (erf(-x) + value).abs() < 1e-10, "{x}: {}", erf(x));
        }
        assert_eq!(erf(9.0), 1.0);
    }

    #[test]
    fn the_pixels_of_a_gaussian_sum_to_its_integral() {
        for sigma2 in [0.05, 0.25, 2.0] {
            let sum: f64 = (-40..=40).map(|i| mean_of_gaussian(f64::from(i) + 0.27, sigma2)).sum();
            assert!((sum / (2.0 * PI * sigma2).sqrt() - 1.0).abs() < 1e-12, "{sigma2}: {sum}");
        }
    }
}

//! The light of stars in each eye, compared with the catalogue.

use std::collections::BTreeSet;

use glam::{DVec2, DVec3, EulerRot, Quat};
use steradian::{
    catalogue::bright::bright_stars,
    photometry::{exposure::white_luminance_cd_m2, rec709::luminance},
    plan::settings::{SwapchainFormat, SwapchainLayout},
    units::illuminance_lx_from_magnitude,
    view::{
        Eye, Rig,
        projection::{PlaneMapping, pixel_centre},
    },
};

use super::shots::{Assignment, Shot, canted_eyes, head, mapping, rig, sent_eyes, settings, take};
use crate::{
    figures,
    monado::{Monado, Service},
};

/// Minimum number of measured stars.
const STARS: usize = 100;
/// Radius around a star that contains its light, pixels.
const RADIUS_PX: f64 = 6.0;
/// Exposure at which the brightest star does not reach display white.
const EV100: f64 = 0.0;

/// Returns the light within a radius of a position, lx; solid angles come from a mapping.
fn light_lx(image: &[[f32; 4]], centre: DVec2, mapping: &dyn PlaneMapping) -> f64 {
    let [width, height] = mapping.size();
    let range = |middle: f64, side: u32| {
        let first = (middle - RADIUS_PX - 1.0).max(0.0) as u32;
        first..side.min((middle + RADIUS_PX + 1.0).ceil() as u32)
    };
    let mut sum_lx = 0.0;
    for y in range(centre.y, height) {
        for x in range(centre.x, width) {
            if (pixel_centre(x, y) - centre).length() <= RADIUS_PX {
                let [r, g, b, _] = image[(y * width + x) as usize].map(f64::from);
                sum_lx += luminance([r, g, b]) * white_luminance_cd_m2(EV100) * mapping.solid_angle_sr(x, y);
            }
        }
    }
    sum_lx
}

/// Returns the stars whose images are complete and isolated for both eyes: number in the catalogue, and positions.
fn isolated(directions: &[DVec3], eyes: &[Eye; 2], rig: &Rig) -> Vec<(usize, [DVec2; 2])> {
    let places: Vec<[Option<DVec2>; 2]> = directions
        .iter()
        .map(|direction| {
            [0, 1].map(|eye| mapping(rig, eye).pixel_from_direction(eyes[eye].room_from_eye.conjugate() * *direction))
        })
        .collect();
    let inside = |eye: usize, position: DVec2| {
        let [width, height] = eyes[eye].size.map(f64::from);
        let margin = RADIUS_PX + 2.0;
        (margin..width - margin).contains(&position.x) && (margin..height - margin).contains(&position.y)
    };
    let alone = |star: usize, eye: usize, position: DVec2| {
        let others = places.iter().enumerate().filter(|(other, _)| *other != star);
        others.filter_map(|(_, places)| places[eye]).all(|other| (other - position).length() > 2.0 * RADIUS_PX + 2.0)
    };
    let both = places.iter().enumerate().filter_map(|(star, places)| Some((star, [places[0]?, places[1]?])));
    both.filter(|(star, places)| [0, 1].iter().all(|&eye| inside(eye, places[eye]) && alone(*star, eye, places[eye])))
        .collect()
}

/// Returns the same eyes with one edge of each field of view 1 % farther out.
fn wider(eyes: [Eye; 2]) -> [Eye; 2] {
    eyes.map(|mut eye| {
        eye.fov.right_rad *= 1.01;
        eye
    })
}

/// Tests both layouts of swapchains with eyes of different orientation and field of view.
pub fn stars_have_the_light_of_the_catalogue(monado: &'static Monado) {
    let service = Service::remote(monado);
    let mut worst = figures::HEADSET_FLUX.worst();
    let stars = bright_stars(0.0);
    let directions: Vec<DVec3> = stars.iter().map(|star| star.position.normalize()).collect();
    let scene = format!(
        "[glare]\nmethod = \"none\"\n[exposure]\nmode = \"manual\"\nev100 = {EV100:?}\n[tone_map]\noperator = \"srgb\"\ndesaturation = 0.0\n"
    );
    let turns =
        [(0.3, 0.1, 0.0), (1.9, -0.2, 0.4), (3.5, 0.3, -0.5), (5.1, 0.0, 0.2), (0.7, 1.0, 0.0), (2.5, -1.0, 0.3)];
    let states = turns.map(|(yaw, pitch, roll)| head(Quat::from_euler(EulerRot::YXZ, yaw, pitch, roll), canted_eyes()));
    for layout in [SwapchainLayout::Array, SwapchainLayout::Two] {
        let assignments = states.iter().map(|state| Assignment::new(*state, &scene)).collect();
        let shots: Vec<Shot> = take(&service, settings(SwapchainFormat::Rgba16f, layout, 2.0), assignments);
        let mut measured = BTreeSet::new();
        let mut errors: [Vec<f64>; 2] = Default::default();
        let (mut of_wrong_solid_angles, mut of_swapped_eyes) = (Vec::new(), Vec::new());
        let mut brightest = 0.0_f32;
        for (shot, state) in shots.iter().zip(&states) {
            let eyes = sent_eyes(state, [shot.images[0].size, shot.images[1].size]);
            let (sent, wrong) = (rig(eyes), rig(wider(eyes)));
            for (star, places) in isolated(&directions, &eyes, &sent) {
                measured.insert(star);
                let expected_lx = illuminance_lx_from_magnitude(stars[star].apparent_magnitude());
                for eye in [0, 1] {
                    let error = |image: usize, mapping: &dyn PlaneMapping| {
                        (light_lx(shot.linear(image), places[eye], mapping) / expected_lx - 1.0).abs()
                    };
                    errors[eye].push(error(eye, mapping(&sent, eye)));
                    of_wrong_solid_angles.push(error(eye, mapping(&wrong, eye)));
                    of_swapped_eyes.push(error(1 - eye, mapping(&sent, eye)));
                }
            }
            let channels = [0, 1].into_iter().flat_map(|eye| shot.linear(eye)).flat_map(|pixel| &pixel[..3]);
            brightest = channels.fold(brightest, |brightest, value| brightest.max(*value));
        }
        let greatest = |errors: &[f64]| errors.iter().fold(0.0_f64, |a, b| a.max(*b));
        let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
        println!(
            "{layout:?}: {} stars, {} times; relative error of the light at most {:.1e} and {:.1e}, mean {:.1e} and {:.1e}; \
             brightest channel {brightest:.3}; with solid angles of another field of view mean {:.1e}, with eyes in each \
             other's place mean {:.1e}",
            measured.len(),
            errors[0].len(),
            greatest(&errors[0]),
            greatest(&errors[1]),
            mean(&errors[0]),
            mean(&errors[1]),
            mean(&of_wrong_solid_angles),
            mean(&of_swapped_eyes),
        );
        assert!(brightest > 0.0 && brightest < 1.0, "nothing may be clipped: {brightest}");
        assert!(measured.len() >= STARS, "{} stars", measured.len());
        errors.iter().flatten().for_each(|error| worst.add(*error, format_args!("{layout:?}")));
        assert!(!figures::HEADSET_FLUX.holds(mean(&of_wrong_solid_angles)) && mean(&of_swapped_eyes) > 0.5);
    }
    worst.print();
}

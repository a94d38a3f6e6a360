//! Depth: positions of bodies in the images of both eyes.

use glam::{DVec2, DVec3, Quat};
use steradian::{
    metrics::{HdrView, MetricError, centroid_direction},
    plan::settings::{SwapchainFormat, SwapchainLayout},
};

use super::shots::{Assignment, Shot, Sphere, head, mapping, rig, sent_eyes, settings, take};
use crate::{
    figures,
    monado::{Eye, Monado, Pose, RemoteState, Service},
};

/// Distance between the eyes, m.
const BASELINE_M: f64 = 0.064;
/// Height of the eyes above the floor, m.
const HEIGHT_M: f64 = 1.6;
/// Edges of the left eye's field of view, rad; the right eye has the mirror image.
const FOV_RAD: [f32; 4] = [-0.85, 0.75, 0.7, -0.72];
/// Bodies: depth, m; position to the right and up, relative to the midpoint between the eyes, in units of the depth;
/// angular radius, rad.
const BODIES: [(f64, [f64; 2], f64); 3] =
    [(1.0, [-0.2, 0.12], 0.03), (10.0, [0.03, -0.08], 0.008), (1000.0, [0.22, 0.1], 0.05)];
const SCENE: &str = r#"
[scene]
catalogues = []
[glare]
method = "none"
[exposure]
mode = "manual"
ev100 = 0.0
[tone_map]
operator = "srgb"
"#;

/// Returns a state with a rolled head. Relative to the head, the right eye is higher than the left one by `raised_m`.
fn state(roll_deg: f32, raised_m: f32) -> RemoteState {
    let [left, right, up, down] = FOV_RAD;
    let half_m = BASELINE_M as f32 / 2.0;
    let eye = |fov_rad, position_m| Eye { fov_rad, pose: Pose { position_m, ..Pose::IDENTITY } };
    let eyes =
        [eye([left, right, up, down], [-half_m, 0.0, 0.0]), eye([-right, -left, up, down], [half_m, raised_m, 0.0])];
    head(Quat::from_rotation_z(roll_deg.to_radians()), eyes)
}

/// Returns the position of a body, m.
fn place_m((depth_m, [x, y], _): (f64, [f64; 2], f64)) -> DVec3 {
    DVec3::new(x, y, -1.0) * depth_m + HEIGHT_M * DVec3::Y
}

/// Returns the difference of a body's positions in the left and right image, in closed form. It depends on the
/// parallax, and on the edges from which pixels are counted.
fn closed_form_px(depth_m: f64, roll_rad: f64, [x, y]: [f64; 2], width: f64) -> f64 {
    let [left, right] = [FOV_RAD[0], FOV_RAD[1]].map(|edge| f64::from(edge).tan());
    let px_per_tangent = width / (right - left);
    // Direction along the eyes' x axis, which rolls with the head.
    let along = x * roll_rad.cos() + y * roll_rad.sin();
    let half = BASELINE_M / 2.0 / depth_m;
    let left_px = (along + half - left) * px_per_tangent;
    let right_px = (along - half + right) * px_per_tangent;
    left_px - right_px
}

/// Returns the centroid of a body's light in the images of both eyes, pixels; `None` if there is no light at the
/// expected position. `images` are the images used for the left and the right eye.
fn measured_px(shot: &Shot, state: &RemoteState, body: (f64, [f64; 2], f64), images: [usize; 2]) -> Option<[DVec2; 2]> {
    let eyes = sent_eyes(state, [shot.images[0].size, shot.images[1].size]);
    let rig = rig(eyes);
    let centroids = [0, 1].map(|eye| {
        let mapping = mapping(&rig, eye);
        let view = HdrView::new(mapping, shot.linear(images[eye])).unwrap();
        let expected = eyes[eye].room_from_eye.conjugate() * (place_m(body) - eyes[eye].position_m);
        // The mean direction of a disc is that of its centre, unlike the centroid of its plane image.
        match centroid_direction(&[view], expected, body.2 + 0.02) {
            Ok(direction) => mapping.pixel_from_direction(direction),
            Err(MetricError::NoLight(_)) => None,
            Err(error) => panic!("{error}"),
        }
    });
    let [left, right] = centroids;
    Some([left?, right?])
}

/// Tests bodies at 1, 10 and 1000 m with the head upright and rolled by 30 degrees.
pub fn bodies_have_the_disparity_of_their_distance(monado: &'static Monado) {
    let service = Service::remote(monado);
    let (mut error, mut vertical) = (figures::HEADSET_DISPARITY.worst(), figures::HEADSET_VERTICAL_DISPARITY.worst());
    // The last head has one eye higher than the other, to show that vertical disparity is detected.
    let heads = [(0.0, 0.0), (30.0, 0.0), (0.0, 0.002)];
    let spheres = BODIES.map(|body| Sphere {
        position_m: place_m(body).to_array(),
        radius_m: body.2 * body.0,
        luminance_cd_m2: 1.0,
    });
    let order = heads.map(|(roll_deg, raised_m)| Assignment {
        spheres: spheres.to_vec(),
        ..Assignment::new(state(roll_deg, raised_m), SCENE)
    });
    let shots = take(&service, settings(SwapchainFormat::Rgba16f, SwapchainLayout::Auto, 2.0), order.to_vec());
    let width = f64::from(shots[0].images[0].size[0]);
    let [left_edge, right_edge] = [FOV_RAD[0], FOV_RAD[1]].map(|edge| f64::from(edge).tan());
    for (shot, (roll_deg, raised_m)) in shots.iter().zip(heads).take(2) {
        let roll_rad = f64::from(roll_deg).to_radians();
        for body in BODIES {
            let (depth_m, direction, radius_rad) = body;
            let [left, right] = measured_px(shot, &state(roll_deg, raised_m), body, [0, 1]).unwrap();
            let disparity_px = left - right;
            let expected_px = closed_form_px(depth_m, roll_rad, direction, width);
            let infinity_px = closed_form_px(f64::INFINITY, roll_rad, direction, width);
            println!(
                "{depth_m} m, {:.1} px across, rolled by {roll_deg} degrees: disparity {:.4} px, closed form {:.4}; vertical {:.4} px",
                2.0 * radius_rad * width / (right_edge - left_edge),
                disparity_px.x - infinity_px,
                expected_px - infinity_px,
                disparity_px.y,
            );
            let fits = |disparity_px: DVec2, expected_px: f64| {
                let along = figures::HEADSET_DISPARITY.holds(disparity_px.x - expected_px);
                along && figures::HEADSET_VERTICAL_DISPARITY.holds(disparity_px.y)
            };
            let case = format!("{depth_m} m, rolled by {roll_deg} degrees");
            error.add(disparity_px.x - expected_px, &case);
            vertical.add(disparity_px.y, &case);
            // Swapped images do not match, and neither does another distance, as far as the pixels resolve it.
            let swapped = measured_px(shot, &state(roll_deg, raised_m), body, [1, 0]);
            assert!(swapped.is_none_or(|[left, right]| !fits(left - right, expected_px)), "{swapped:?}");
            let other_m = if depth_m < 100.0 { 0.9 * depth_m } else { 100.0 };
            assert!(!fits(disparity_px, closed_form_px(other_m, roll_rad, direction, width)), "{other_m} m");
        }
    }
    error.print();
    vertical.print();
    let [left, right] = measured_px(&shots[2], &state(heads[2].0, heads[2].1), BODIES[0], [0, 1]).unwrap();
    println!("with one eye 2 mm higher: vertical disparity {:.4} px at 1 m", (left - right).y);
    let expected_px = f64::from(heads[2].1) * f64::from(shots[2].images[0].size[1])
        / (f64::from(FOV_RAD[2]).tan() - f64::from(FOV_RAD[3]).tan());
    assert!(!figures::HEADSET_VERTICAL_DISPARITY.holds(expected_px));
    assert!(figures::HEADSET_DISPARITY.holds((left - right).y + expected_px), "{left} {right}");
}

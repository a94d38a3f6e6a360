//! Bodies: their light at every size and position, the transition to points, and the stars that they hide.

use std::sync::Arc;

use glam::{DQuat, DVec2, DVec3};

use super::{
    super::{
        Figure,
        context::{CheckError, Context, hdr_view, light_of_views_lx, worst},
        scenes::{all_views, rig, spiral, star},
    },
    stage::{Fault, black, light_around_lx, scene_of, sun, window},
};
use crate::{
    catalogue::chunks::StarSet,
    metrics,
    photometry::rec709::luminance,
    plan::bodies::light::illuminance_of,
    render::Frame,
    scene::{
        SceneSnapshot,
        bodies::{Body, Emission, ReflectionLaw, Surface, hides, suns},
    },
    units::illuminance_lx_from_magnitude,
    view::ViewImage,
};

/// Distance of the bodies, m.
const DISTANCE_M: f64 = 1e8;
/// Tested diameters, rad: from 0.004 pixels in the coarsest picture to 100 in the finest.
const DIAMETERS_RAD: [f64; 8] = [6e-5, 1e-3, 6e-3, 0.014, 0.03, 0.07, 0.2, 0.55];

/// Returns a grey body in a direction.
fn grey(direction: DVec3, radii_m: DVec3, albedo: f64) -> Body {
    let law = ReflectionLaw::LommelSeeliger;
    let surface = Surface {
        law,
        geometric_albedo: [0.3, 0.2, 0.1].map(|channel| channel * albedo),
        phase_curve: None,
        texture: None,
    };
    Body { surface, ..black("body", direction.normalize() * DISTANCE_M, radii_m) }
}

/// Returns the true light of a scene's body at the camera, lx. The fault is applied to it.
fn expected_lx(scene: &SceneSnapshot, fault: Fault) -> f64 {
    let of_body = |body: &Arc<Body>| {
        let mut body = body.as_ref().clone();
        body.surface.geometric_albedo = body.surface.geometric_albedo.map(|albedo| albedo * fault.albedo);
        body.radii_m *= fault.radius;
        luminance(illuminance_of(&body, scene.camera.position_m, &suns(&scene.objects), 0.0))
    };
    scene.objects.bodies.first().map_or(f64::NAN, of_body)
}

/// Measures the light of an ellipsoid in every projection, from hundredths of a pixel to a hundred pixels, and at
/// difficult places of pictures of the whole sphere.
pub(in crate::verify) fn light(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let everywhere = rig(all_views())?;
    let whole = rig(all_views().into_iter().filter(|(name, _)| matches!(*name, "cube" | "equirectangular")))?;
    let ahead = DVec3::new(0.11, -0.07, -1.0);
    let cases = [
        ("in every projection", &everywhere, vec![ahead]),
        (
            "at poles, corners and the date line",
            &whole,
            vec![
                DVec3::Y,
                DVec3::new(1e-3, -1.0, 2e-3),
                DVec3::new(1.0, 1.0, -1.0),
                DVec3::new(1.0, 0.0, 1.0),
                DVec3::Z,
            ],
        ),
    ];
    let mut figures = Vec::new();
    for (name, rig, places) in cases {
        let mut errors = Vec::new();
        for direction in places.iter().map(|place| place.normalize()) {
            for diameter_rad in DIAMETERS_RAD {
                let radii_m = DVec3::new(1.0, 0.8, 0.6) * (0.5 * diameter_rad).sin() * DISTANCE_M;
                let to_sun = DQuat::from_axis_angle(direction.any_orthonormal_vector(), 0.9) * -direction;
                let scene = scene_of(vec![grey(direction, radii_m, 1.0), sun(to_sun)], Vec::new());
                let expected = expected_lx(&scene, context.object_fault);
                let frame = context.render(&scene, rig)?;
                let light = light_around_lx(&frame, rig, direction, 0.5 * diameter_rad)?;
                errors.extend(light.into_iter().map(|light| (light / expected - 1.0).abs()));
            }
        }
        figures.push(Figure::at_most(format!("error of light {name}"), worst(errors), 0.01, "relative"));
    }
    Ok(figures)
}

/// Shrinks a uniformly bright disc from six pixels to one at four sub-pixel positions; measures its light and its
/// centre.
pub(in crate::verify) fn shrinks(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    const SIDE: u32 = 64;
    const PIXEL_RAD: f64 = 2e-3;
    const SHRINKS: f64 = 0.96;
    let rig = rig([("window", window(SIDE, PIXEL_RAD, 0.0))])?;
    let image = rig.views().iter().flat_map(|view| &view.images).next().ok_or(CheckError::Missing("an image"))?;
    let mapping = image.projection.mapping();
    let places = [(16.1, 16.4), (48.6, 16.15), (16.35, 48.6), (48.9, 48.85)].map(|(x, y)| DVec2::new(x, y));
    let mut ratios: Vec<Vec<f64>> = vec![Vec::new(); places.len()];
    let mut middles: Vec<Vec<DVec2>> = vec![Vec::new(); places.len()];
    let steps = (6.0_f64.ln() / -SHRINKS.ln()).ceil() as i32;
    for step in 0..=steps {
        let radius_m = DISTANCE_M * (0.5 * 6.0 * SHRINKS.powi(step) * PIXEL_RAD).sin();
        let body = |(index, place): (usize, &DVec2)| {
            let direction = mapping.direction_from_pixel(*place).unwrap_or(DVec3::NEG_Z);
            let emission = Some(Emission { luminance_cd_m2: [5.0; 3], limb_darkening: 0.0, corona: false });
            Body { emission, ..black(&format!("body-{index}"), direction * DISTANCE_M, DVec3::splat(radius_m)) }
        };
        let scene = scene_of(places.iter().enumerate().map(body).collect(), Vec::new());
        let frame = context.render(&scene, &rig)?;
        let view = hdr_view(frame.images.first().ok_or(CheckError::Missing("an image"))?, mapping)?;
        for (index, place) in places.iter().enumerate() {
            let mut body = scene.objects.bodies[index].as_ref().clone();
            body.radii_m *= context.object_fault.radius;
            let expected = luminance(illuminance_of(&body, scene.camera.position_m, &[], 0.0));
            ratios[index].push(metrics::illuminance_near_pixel_lx(&view, *place, 14.0)? / expected);
            middles[index].push(metrics::centroid_px(&view, *place, 14.0)? - *place);
        }
    }
    let jumps = ratios.iter().flat_map(|ratios| ratios.windows(2).map(|pair| (pair[1] - pair[0]).abs()));
    Ok(vec![
        Figure::at_most(
            "error of light",
            worst(ratios.iter().flatten().map(|ratio| (ratio - 1.0).abs())),
            0.01,
            "relative",
        ),
        Figure::at_most("jump of the light in a step", worst(jumps), 0.01, "relative"),
        Figure::at_most("middle", worst(middles.iter().flatten().map(|offset| offset.length())), 0.05, "px"),
    ])
}

/// Transit: in each picture, exactly the stars behind the body must be missing.
pub(in crate::verify) fn hides_stars(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let stars: Vec<DVec3> = spiral(40_000).collect();
    let sky = Arc::new(StarSet::from_records(stars.iter().map(|direction| star(*direction, 6.0)).collect()));
    let rig = rig(all_views())?;
    let rendered = |context: &mut Context<'_>, bodies: Vec<Body>| -> Result<(SceneSnapshot, Frame), CheckError> {
        let scene = SceneSnapshot { stars: sky.clone(), ..scene_of(bodies, Vec::new()) };
        let frame = context.render(&scene, &rig)?;
        Ok((scene, frame))
    };
    let (_, open) = rendered(context, Vec::new())?;
    let open_lx = light_of_views_lx(&open, &rig)?;
    let star_lx = illuminance_lx_from_magnitude(6.0);
    let (mut hidden_stars, mut wrong, mut light) = (0, 0, Vec::new());
    for direction in [DVec3::new(0.12, -0.05, -1.0), DVec3::new(-0.08, 0.14, -1.0)] {
        // A tilted ellipsoid: its outline is not a circle.
        let orientation = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, 1.1, -0.3);
        let radii_m = DVec3::new(0.24, 0.15, 0.09) * DISTANCE_M;
        let body = Body { orientation, ..black("dark", direction.normalize() * DISTANCE_M, radii_m) };
        let (scene, frame) = rendered(context, vec![body])?;
        let lx = light_of_views_lx(&frame, &rig)?;
        let mut body = scene.objects.bodies[0].as_ref().clone();
        body.radii_m *= context.object_fault.radius;
        for (index, view) in rig.views().iter().enumerate() {
            let behind = |image: &ViewImage| {
                let (mapping, eye_m) = (image.projection.mapping(), scene.camera.position_m + image.eye_position_m);
                let in_picture = |star: &&DVec3| {
                    mapping.pixel_from_direction(image.camera_from_view.conjugate() * **star).is_some_and(|pixel| {
                        let inside = pixel.x >= 0.0 && pixel.y >= 0.0;
                        mapping.shows_full_sphere() || (inside && mapping.contains(pixel.x as u32, pixel.y as u32))
                    })
                };
                stars.iter().filter(in_picture).filter(|star| hides(&body, eye_m, **star, 0.0)).count() as i64
            };
            let hidden: i64 = view.images.iter().map(behind).sum();
            let all = open.views[index].stars_drawn as i64;
            wrong += (all - frame.views[index].stars_drawn as i64 - hidden).abs();
            hidden_stars += hidden;
            light.push(((open_lx[index] - lx[index]) / star_lx / hidden as f64 - 1.0).abs());
        }
    }
    Ok(vec![
        Figure::informative("stars behind bodies", hidden_stars as f64, ""),
        Figure::at_most("stars wrongly drawn or hidden", wrong as f64, 0.0, ""),
        Figure::at_most("light of hidden stars", worst(light), 1e-3, "relative"),
    ])
}

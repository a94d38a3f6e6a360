//! The shape of the glare of one star: round in view space, with the falloff of the kernel and the correct light.

use glam::DVec3;

use super::{
    super::{
        Figure,
        context::{CheckError, Context, worst},
        scenes::{cube, fisheye, snapshot, star},
    },
    Picture, flat, off_axis, pictures, stereo, turned,
};
use crate::{
    metrics::{self, Annulus, HdrView},
    photometry::glare::GlareKernel,
    plan::settings::GlareSettings,
    render::Frame,
    scene::SceneSnapshot,
    units::illuminance_lx_from_magnitude,
    view::{Rig, View, ViewKind, projection::FisheyeMapping},
};

/// Radii of circles around a star, in pixels at the centre of the picture. Interpolation between pixels adds 0.5 % to
/// the deviation on the smallest circle.
const CIRCLES_PX: [f64; 3] = [12.0, 20.0, 32.0];
/// Direction of the star in camera axes. Its position relative to a cube is not symmetric.
const PLACE: DVec3 = DVec3::new(0.3, 0.5, -0.8);

/// 20: measures roundness on the axis and 45 and 60 degrees off it. These angles are limited to 0.85 of half the field of view.
pub(in crate::verify) fn roundness(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    // Off the axis towards an edge, and towards a corner.
    let within = |half_deg: f64| {
        let off = |degrees: f64| degrees.min(0.85 * half_deg);
        vec![off_axis(0.0, 0.0), off_axis(off(45.0), 0.0), off_axis(off(60.0), 40.0)]
    };
    let kinds: [(&str, ViewKind, Vec<DVec3>); 7] = [
        ("perspective-60", flat(256, 60.0), within(30.0)),
        ("perspective-110", flat(256, 110.0), within(55.0)),
        ("stereo", stereo(200, 80.0), within(40.0)),
        // Next to an edge of a face, and next to a corner.
        ("cube", cube(96), vec![off_axis(0.0, 0.0), off_axis(44.0, 0.0), DVec3::new(0.97, 0.95, -1.0)]),
        ("fisheye-180", fisheye(256, FisheyeMapping::Equidistant, 180.0), within(90.0)),
        ("fisheye-220", fisheye(256, FisheyeMapping::Equisolid, 220.0), within(110.0)),
        (
            "equirectangular",
            ViewKind::Equirectangular { size: [384, 192] },
            [within(180.0), vec![DVec3::new(0.02, 1.0, -0.03)]].concat(),
        ),
    ];
    let (mut views, mut of_kind) = (Vec::new(), Vec::new());
    for (index, (name, kind, directions)) in kinds.iter().enumerate() {
        for (place, direction) in directions.iter().enumerate() {
            views.push(turned(&format!("{name}-{place}"), kind, *direction, PLACE)?);
            of_kind.push(index);
        }
    }
    let rig = Rig::new(views)?;
    let scene = snapshot(vec![star(PLACE, 0.0)]);
    context.scatter_all();
    let frame = context.render(&scene, &rig)?;
    let mut deviations = vec![Vec::new(); kinds.len()];
    let pictures = pictures(&scene, &rig, &frame)?;
    for (view, kind) in rig.views().iter().zip(of_kind) {
        let of_view: Vec<&Picture<'_>> = pictures.iter().filter(|picture| picture.name == view.name).collect();
        let pixel_rad = view.images[0].projection.middle_pixel_rad();
        // The faces of a cube form one picture of the sky, but two eyes have two pictures.
        let together = if matches!(view.kind, ViewKind::Stereo { .. }) { 1 } else { of_view.len() };
        for some in of_view.chunks(together) {
            let some: Vec<HdrView<'_>> = some.iter().map(|picture| picture.hdr).collect();
            for circle_px in CIRCLES_PX {
                let found = metrics::roundness(&some, PLACE, circle_px * pixel_rad)?;
                deviations[kind].push(found.largest_deviation);
            }
        }
    }
    let figure = |((name, ..), deviations): (&(&str, ViewKind, Vec<DVec3>), Vec<f64>)| {
        Figure::at_most(format!("deviation on circles, {name}"), worst(deviations), 0.02, "relative")
    };
    Ok(kinds.iter().zip(deviations).map(figure).collect())
}

/// Fields of view of flat pictures, degrees, and the range of angles from the star that their pixels resolve, degrees.
const FIELDS: [(f64, [f64; 2]); 3] = [(4.0, [0.2, 1.9]), (24.0, [1.0, 11.0]), (80.0, [4.0, 30.0])];
/// Side of these pictures, pixels.
const SIDE: u32 = 256;
/// Number of rings in each picture.
const RINGS: u32 = 12;
/// Radius within which light counts as the star's own image, pixels.
const IMAGE_PX: f64 = 8.0;

/// Measures the falloff from 0.2 to 30 degrees, the light scattered over the sphere, and the unscattered light.
pub(in crate::verify) fn profile(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let mut figures = profile_of(context, "")?;
    let default = GlareSettings { method: context.glare.method, ..GlareSettings::default() };
    let has_default_kernel = GlareSettings { weights: context.glare.weights, ..default.clone() } == context.glare;
    if !has_default_kernel && !context.has_fixed_kernel() {
        let kept = (context.glare.clone(), context.expected_glare.clone());
        (context.glare, context.expected_glare) = (default.clone(), default);
        figures.extend(profile_of(context, "default ")?);
        (context.glare, context.expected_glare) = kept;
    }
    Ok(figures)
}

fn profile_of(context: &mut Context<'_>, which: &str) -> Result<Vec<Figure>, CheckError> {
    const MAGNITUDE: f64 = 0.0;
    let light_lx = illuminance_lx_from_magnitude(MAGNITUDE);
    let scene = snapshot(vec![star(PLACE, MAGNITUDE as f32)]);
    let kernel = context.expected_kernel()?;
    let flat_views = FIELDS
        .iter()
        .enumerate()
        // The star lies between the centre of a pixel and its corner.
        .map(|(index, (degrees, _))| {
            turned(&format!("flat-{index}"), &flat(SIDE, *degrees), off_axis(0.3 * degrees / 256.0, 30.0), PLACE)
        })
        .collect::<Result<Vec<View>, _>>()?;
    let flat_rig = Rig::new(flat_views)?;
    context.scatter_all();
    let frame = context.render(&scene, &flat_rig)?;
    let mut rings = Vec::new();
    for (picture, (_, between_deg)) in pictures(&scene, &flat_rig, &frame)?.iter().zip(FIELDS) {
        let [least, most] = between_deg.map(f64::to_radians);
        let edges: Vec<f64> =
            (0..=RINGS).map(|i| least * (most / least).powf(f64::from(i) / f64::from(RINGS))).collect();
        // A tabulated kernel may end at an angle below 30 degrees.
        let lit = edges.partition_point(|edge| kernel.per_sr(*edge) > 0.0);
        rings.extend(metrics::radial_profile(&[picture.hdr], PLACE.normalize(), &edges[..lit], |angle| {
            light_lx * kernel.per_sr(angle)
        })?);
    }
    let pairs: Vec<_> = rings.iter().map(|ring| (ring.luminance_cd_m2, ring.expected_cd_m2)).collect();
    let (scale, scale_note) = context.glare_scale(&pairs)?;
    let largest = worst(pairs.iter().map(|(found, expected)| (scale * found / expected - 1.0).abs()));
    let all = [0.0, f64::INFINITY];
    let slope = metrics::log_log_slope(&rings, all)?;
    let expected_rings: Vec<Annulus> =
        rings.iter().map(|ring| Annulus { luminance_cd_m2: ring.expected_cd_m2, ..*ring }).collect();
    let kernel_slope = metrics::log_log_slope(&expected_rings, all)?;

    // The whole sphere receives all scattered light, wherever the star is: on a corner of pixels in one view, elsewhere
    // in other views. Pixels are a third of a degree wide. The wider they are, the more of the scattered light lies in
    // the few pixels around the star.
    let kinds = [("cube", cube(256)), ("equirectangular", ViewKind::Equirectangular { size: [1024, 512] })];
    let mut views = Vec::new();
    for (name, kind) in &kinds {
        for (index, direction) in [off_axis(0.0, 0.0), off_axis(17.3, 20.0), off_axis(31.9, 75.0)].iter().enumerate() {
            views.push(turned(&format!("{name}-{index}"), kind, *direction, PLACE)?);
        }
    }
    let lights = context.light_lx(&scene, &Rig::new(views)?)?;
    let scattered = worst(lights.iter().map(|lx| (lx / light_lx - 1.0).abs()));

    // The light that is not scattered forms the star's own image.
    let fraction = context.glare.fraction_scattered();
    context.settings.glare = context.glare.clone();
    let frame = context.render(&scene, &flat_rig)?;
    let (own_lx, share) = own_image(&scene, &flat_rig, &frame, &*kernel)?;
    let own = ((own_lx - fraction * light_lx * share) / light_lx - (1.0 - fraction)).abs();
    Ok(vec![
        Figure::informative(format!("{which}slope from 0.2 to 30 degrees"), slope, ""),
        Figure::at_most("off the kernel's", (slope - kernel_slope).abs(), 0.01, ""),
        Figure::at_most(format!("{which}largest error{scale_note}"), largest, 0.02, "relative"),
        Figure::at_most("scattered light", scattered, 5e-3, "relative"),
        Figure::at_most("light of the star's own image", own, 5e-3, "relative"),
    ])
}

/// Returns the light near the star in the picture with the smallest pixels, lx, and the kernel's share of the scattered light there. Small pixels are
/// needed: if pixels are wider than the kernel's plateau, more scattered light lies within them than the light that remains after this share is
/// subtracted.
fn own_image(
    scene: &SceneSnapshot,
    rig: &Rig,
    frame: &Frame,
    kernel: &dyn GlareKernel,
) -> Result<(f64, f64), CheckError> {
    let pictures = pictures(scene, rig, frame)?;
    let picture = pictures.first().ok_or(CheckError::Missing("an image"))?;
    let radius = IMAGE_PX * picture.view_image.projection.middle_pixel_rad();
    let light = metrics::illuminance_near_direction_lx(&[picture.hdr], PLACE.normalize(), radius)?;
    Ok((light, kernel.share_within(radius)))
}

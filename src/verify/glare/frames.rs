//! Glare between frames: a source that leaves the picture, and a night that becomes day and night again.

use glam::DVec3;

use super::{
    super::{
        Figure,
        context::{CheckError, Context, hdr_pixels, worst},
        scenes::{fisheye, rig, snapshot, spiral, star},
    },
    flat, off_axis, pictures, reference, stereo, turned,
};
use crate::{
    catalogue::StarRecord,
    render::{FrameRequest, Wanted},
    scene::SceneSnapshot,
    view::{
        Rig, View, ViewKind,
        projection::{Face, FisheyeMapping},
    },
};

/// Direction of the star in camera axes.
const PLACE: DVec3 = DVec3::new(-0.4, 0.7, -0.5);

/// 22: moves a bright star in half-degree steps from 3 degrees inside of the border to 10 degrees outside. At fixed
/// positions of the picture, the veil is divided by the kernel's prediction for the position of the star. This ratio
/// must not jump.
pub(in crate::verify) fn leaves_frame(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    const STEPS: u32 = 26;
    let one_face = ViewKind::Cubemap { face_size: 128, faces: vec![Face::Front] };
    let kinds: [(&str, ViewKind, f64); 7] = [
        ("perspective-60", flat(128, 60.0), 30.0),
        ("perspective-110", flat(128, 110.0), 55.0),
        ("stereo", stereo(128, 80.0), 40.0),
        ("face", one_face, 45.0),
        ("fisheye-180", fisheye(128, FisheyeMapping::Equidistant, 180.0), 90.0),
        ("fisheye-220", fisheye(128, FisheyeMapping::Equisolid, 220.0), 110.0),
        ("domemaster", ViewKind::DomeMaster { size: 128, fov_rad: std::f64::consts::PI, tilt_rad: 0.0 }, 90.0),
    ];
    let kernel = context.expected_kernel()?;
    let scene = snapshot(vec![star(PLACE, -4.0)]);
    context.scatter_all();
    // There is one list of ratios, over all steps, for each kind of view and each fixed position in an image.
    let mut ratios: Vec<(&str, Vec<f64>)> = Vec::new();
    for step in 0..=STEPS {
        let beyond_deg = -3.0 + 0.5 * f64::from(step);
        let views = kinds
            .iter()
            .map(|(name, kind, half_deg)| turned(name, kind, off_axis(half_deg + beyond_deg, 0.0), PLACE))
            .collect::<Result<Vec<View>, _>>()?;
        let rig = Rig::new(views)?;
        let frame = context.render(&scene, &rig)?;
        let mut index = 0;
        for picture in pictures(&scene, &rig, &frame)? {
            let (name, _, half_deg) = kinds[kinds.iter().position(|(name, ..)| *name == picture.name).unwrap_or(0)];
            let inwards = [8.0, 15.0, 28.0].map(|inside_deg| off_axis(half_deg - inside_deg, 0.0));
            for place in inwards.into_iter().chain([off_axis(0.5 * half_deg, 50.0)]) {
                let mapping = picture.hdr.mapping();
                let pixel = mapping.pixel_from_direction(place).ok_or(CheckError::Missing("a pixel"))?;
                let ratio = picture.ratio(&*kernel, [pixel.x as u32, pixel.y as u32]);
                if step == 0 {
                    ratios.push((name, Vec::new()));
                }
                ratios[index].1.push(ratio);
                index += 1;
            }
        }
    }
    let figure = |(name, ..): &(&str, ViewKind, f64)| {
        let of_kind = ratios.iter().filter(|(kind, _)| kind == name);
        // The ratios are relative to the veil before the star reaches the border.
        let jumps =
            of_kind.flat_map(|(_, ratios)| ratios.windows(2).map(|pair| ((pair[1] - pair[0]) / ratios[0]).abs()));
        Figure::at_most(format!("jump of the veil, {name}"), worst(jumps), 0.02, "relative")
    };
    Ok(kinds.iter().map(figure).collect())
}

/// Draws faint stars, then the Sun among them, then the faint stars again. No frame may show a remainder of the
/// previous one.
pub(in crate::verify) fn night_to_sun(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    const SAMPLES: usize = 200;
    let night: Vec<StarRecord> = spiral(300).map(|direction| star(direction, 5.0)).collect();
    let day: Vec<StarRecord> = night.iter().copied().chain([star(DVec3::new(0.2, -0.1, -1.0), -26.7)]).collect();
    let scenes: [SceneSnapshot; 3] = [night.clone(), day, night].map(snapshot);
    let rig = rig([
        ("flat", flat(128, 90.0)),
        ("dome", fisheye(128, FisheyeMapping::Equidistant, 180.0)),
        ("equirectangular", ViewKind::Equirectangular { size: [256, 128] }),
    ])?;
    context.scatter_all();
    let (mut not_finite, mut frames) = (0, Vec::new());
    for scene in &scenes {
        let frame = context
            .renderer
            .render(FrameRequest::new(scene, &rig).settings(&context.settings).wanted(Wanted::both()))?;
        not_finite += u64::from(!frame.exposure_ev100.is_finite());
        for image in &frame.images {
            not_finite += hdr_pixels(image)?.iter().flatten().filter(|value| !value.is_finite()).count() as u64;
        }
        frames.push(frame);
    }
    let mut changed = u64::from(frames[0].exposure_ev100.to_bits() != frames[2].exposure_ev100.to_bits());
    for (before, after) in frames[0].images.iter().zip(&frames[2].images) {
        let pairs = hdr_pixels(before)?.iter().zip(hdr_pixels(after)?);
        changed += pairs.filter(|(a, b)| a.map(f32::to_bits) != b.map(f32::to_bits)).count() as u64;
        changed += u64::from(before.display.is_none() || before.display != after.display);
    }
    let mut figures = vec![
        Figure::at_most("values that are not finite", not_finite as f64, 0.0, ""),
        Figure::at_most("pixels of the night that differ after the day", changed as f64, 0.0, ""),
    ];
    if not_finite == 0 {
        for ((scene, frame), name) in scenes.iter().zip(&frames).zip(["night", "day"]) {
            figures.extend(reference::compare(context, name, &pictures(scene, &rig, frame)?, SAMPLES)?);
        }
    }
    Ok(figures)
}

use std::{collections::BTreeSet, f64::consts::PI};

use super::*;
use crate::{
    catalogue::bright::bright_stars,
    chart::ViewShape,
    photometry::{glare::GlareKernel, rec709::luminance},
    reference::{glare::sky_cube::Veil, sky::SkyStar},
};

/// A kernel that falls off with a power other than the inverse square.
struct Power(f64);

impl GlareKernel for Power {
    fn per_sr(&self, angle_rad: f64) -> f64 {
        0.02 * angle_rad.max(self.inner_rad()).powf(self.0)
    }

    fn inner_rad(&self) -> f64 {
        0.1_f64.to_radians()
    }

    fn share_within(&self, _angle_rad: f64) -> f64 {
        1.0
    }
}

fn scenes_of(view: ViewShape) -> GlareScenes {
    let records = bright_stars(0.0);
    let kernel = GlareSettings::default().kernel().unwrap();
    GlareScenes::new(view, &ScoredSky { records: &records, pixels: 200 }, kernel).unwrap()
}

/// Error that is introduced into a picture computed in f64.
#[derive(Clone, Copy, PartialEq)]
enum Wrong {
    Nothing,
    /// All light is scaled.
    Factor(f64),
    /// The angle has a power other than -2.
    FallOff(f64),
    /// Distances on the screen replace angles.
    OnScreen,
    /// Sources outside of the image give no light.
    InsideOnly,
    Black,
}

fn shows(image: &ViewImage, star: &SkyStar) -> bool {
    let mapping = image.projection.mapping();
    let [width, height] = mapping.size().map(f64::from);
    mapping.pixel_from_direction(star.direction).is_some_and(|position| {
        (0.0..width).contains(&position.x)
            && (0.0..height).contains(&position.y)
            && mapping.direction_from_pixel(position).is_some()
    })
}

/// Returns a picture that is black except for the `compared` pixels.
fn picture(scene: &SceneSnapshot, image: &ViewImage, wrong: Wrong, compared: impl Fn([u32; 2]) -> bool) -> Pixels {
    let mapping = image.projection.mapping();
    let [width, height] = mapping.size();
    let mut sources = scenes::sources(scene, image);
    if wrong == Wrong::InsideOnly {
        sources.retain(|star| shows(image, star));
    }
    let all: Vec<[u32; 2]> = (0..height).flat_map(|y| (0..width).map(move |x| [x, y])).collect();
    let pixels: Vec<[u32; 2]> = all.iter().copied().filter(|pixel| compared(*pixel)).collect();
    let right = GlareSettings::default().kernel().unwrap();
    let light: Vec<[f64; 3]> = match wrong {
        Wrong::OnScreen => {
            let pixel_rad = image.projection.middle_pixel_rad();
            let towards = |[x, y]: [u32; 2]| {
                let mut sum = [0.0; 3];
                for star in &sources {
                    let Some(position) = mapping.pixel_from_direction(star.direction) else { continue };
                    let distance = (position - glam::DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)).length();
                    (0..3).for_each(|c| sum[c] += star.rgb_lx[c] * right.per_sr((distance * pixel_rad).min(PI)));
                }
                sum
            };
            pixels.iter().map(|pixel| towards(*pixel)).collect()
        }
        _ => {
            let other = Power(if let Wrong::FallOff(power) = wrong { power } else { -2.0 });
            let kernel: &dyn GlareKernel = if matches!(wrong, Wrong::FallOff(_)) { &other } else { &*right };
            let veil = Veil { sources: &sources, kernel, fraction: 1.0 };
            veil.over_pixels(mapping, &pixels).into_iter().map(Option::unwrap_or_default).collect()
        }
    };
    let factor = match wrong {
        Wrong::Factor(factor) => factor,
        Wrong::Black => 0.0,
        _ => 1.0,
    };
    let inside = |pixel: &[u32; 2]| mapping.solid_angle_sr(pixel[0], pixel[1]) > 0.0;
    let as_frame = |(pixel, [r, g, b]): (&[u32; 2], [f64; 3])| {
        let factor = if inside(pixel) { factor } else { 0.0 };
        [(factor * r) as f32, (factor * g) as f32, (factor * b) as f32, 1.0]
    };
    let mut lit = pixels.iter().zip(light).map(as_frame);
    let black = [0.0, 0.0, 0.0, 1.0];
    all.iter().map(|pixel| if compared(*pixel) { lit.next().unwrap() } else { black }).collect()
}

fn scored(scenes: &GlareScenes, wrong: Wrong) -> impl Fn(GlareMetric) -> Option<f64> + use<> {
    // A pixel of the starry sky gets light from many sources, so only some pixels are compared; for the other scenes
    // all are.
    let compared: BTreeSet<(usize, [u32; 2])> = scenes.places.iter().map(|place| (place.image, place.pixel)).collect();
    let mut draw = |scene: &SceneSnapshot, _: &Rig| {
        let sky = std::ptr::eq(scene, &scenes.sky);
        let of_image = |(index, image): (usize, &ViewImage)| {
            picture(scene, image, wrong, |pixel| !sky || compared.contains(&(index, pixel)))
        };
        Ok(scenes.images().iter().enumerate().map(of_image).collect())
    };
    let scores = score(scenes, &mut draw).unwrap();
    move |metric| scores.get(metric).and_then(|score| score.value)
}

#[test]
fn reference_scores_as_a_perfect_method() {
    for view in [
        ViewShape::Flat([96, 54]),
        ViewShape::Stereo([80, 88]),
        ViewShape::Dome(96),
        ViewShape::Cubemap(40),
        ViewShape::FullSky([96, 48]),
    ] {
        let scenes = scenes_of(view);
        assert!(scenes.places.len() > 50 && scenes.places.len() < scenes.sampled, "{view:?}: {}", scenes.places.len());
        let score = scored(&scenes, Wrong::Nothing);
        for metric in GlareMetric::ALL {
            let limit = match metric {
                GlareMetric::Roundness => 0.012,
                GlareMetric::Slope => 0.02,
                _ => 1e-5,
            };
            let applies = match metric {
                GlareMetric::FromOutside => !matches!(view, ViewShape::Cubemap(_) | ViewShape::FullSky(_)),
                GlareMetric::Seam => matches!(view, ViewShape::Cubemap(_)),
                _ => true,
            };
            match score(metric) {
                Some(value) => {
                    assert!(applies && (value - metric.best()).abs() < limit, "{view:?} {metric:?}: {value}")
                }
                None => assert!(!applies, "{view:?}: {metric:?} has no figure"),
            }
        }
    }
}

#[test]
fn excess_light_is_detected() {
    let scenes = scenes_of(ViewShape::Flat([96, 54]));
    let score = scored(&scenes, Wrong::Factor(1.1));
    for metric in [GlareMetric::VeilRms, GlareMetric::VeilLargest] {
        assert!((score(metric).unwrap() - 0.1).abs() < 1e-5);
    }
    for metric in [GlareMetric::FromOutside, GlareMetric::FluxKept] {
        assert!((score(metric).unwrap() - 1.1).abs() < 1e-5);
    }
}

#[test]
fn wrong_falloff_is_detected() {
    let scenes = scenes_of(ViewShape::Dome(96));
    let score = scored(&scenes, Wrong::FallOff(-3.0));
    assert!((score(GlareMetric::Slope).unwrap() + 3.0).abs() < 0.02);
    assert!(score(GlareMetric::VeilRms).unwrap() > 0.3);
}

#[test]
fn glare_round_on_screen_is_detected_as_not_round() {
    for view in [ViewShape::Flat([96, 54]), ViewShape::Dome(96), ViewShape::FullSky([96, 48])] {
        let off = scored(&scenes_of(view), Wrong::OnScreen)(GlareMetric::Roundness).unwrap();
        assert!(off > 0.1, "{view:?}: {off}");
    }
}

#[test]
fn glare_confined_to_its_image_is_detected_outside_and_at_edges() {
    let flat = scored(&scenes_of(ViewShape::Flat([96, 54])), Wrong::InsideOnly);
    assert_eq!(flat(GlareMetric::FromOutside), Some(0.0));
    assert!(flat(GlareMetric::VeilRms).unwrap() > 0.3);
    let cube = scored(&scenes_of(ViewShape::Cubemap(40)), Wrong::InsideOnly);
    assert!((cube(GlareMetric::Seam).unwrap() - 1.0).abs() < 1e-5);
    assert!(cube(GlareMetric::FluxKept).unwrap() < 0.9);
}

#[test]
fn black_picture_is_not_a_perfect_veil() {
    let score = scored(&scenes_of(ViewShape::Cubemap(40)), Wrong::Black);
    assert_eq!([GlareMetric::VeilRms, GlareMetric::VeilLargest].map(&score), [Some(1.0); 2]);
    assert_eq!(score(GlareMetric::FluxKept), Some(0.0));
    // Black has neither roundness nor a slope.
    assert_eq!([GlareMetric::Roundness, GlareMetric::Slope].map(&score), [None; 2]);
}

#[test]
fn scenes_match_the_reference() {
    let scenes = scenes_of(ViewShape::Cubemap(40));
    // The whole sky receives all light of the star.
    let star: f64 =
        scenes::sources(&scenes.central.scene, &scenes.images()[0]).iter().map(|star| luminance(star.rgb_lx)).sum();
    assert!((scenes.flux_lx / star - 1.0).abs() < 1e-3, "{}", scenes.flux_lx / star);
    // Every border pixel has a neighbour.
    assert_eq!(scenes.edges.len(), 6 * 4 * 40);
    assert!(scenes.edges.iter().all(|[here, there]| here.image != there.image));
}

//! Measures the light of stars through six overlapping projectors, for each way of delivering and drawing their calibration.
//!
//! Light is weighted with solid angles of the closed form, not with those that the program derives from the files.

use std::{fmt::Write as _, fs, path::Path, sync::Arc};

use glam::{DVec2, DVec3};
use steradian::{
    config::Config,
    photometry::rec709::luminance,
    render::{FrameImage, FrameRequest, Wanted},
    scene::{SceneSnapshot, loader::load_stars},
    units::illuminance_lx_from_magnitude,
    view::projector::Blend,
};

use crate::common::{
    renderer,
    theatre::{Alpha, Mpcdi, Projector, bourke, projectors_of, sgct, share},
};

const SIZE: [u32; 2] = [320, 200];
const STARS: usize = 200;
/// Radius around a star within which all of its light is, pixels.
const PATCH_PX: i64 = 5;

/// A star that is visible on the dome.
struct Star {
    direction: DVec3,
    light_lx: f64,
}

/// Stars in directions on the dome that are well inside of the raster of at least one projector.
fn stars(projectors: &[Projector]) -> Vec<Star> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let lattice = (0..400).map(|index| {
        let up = 0.98 - 0.93 * (f64::from(index) + 0.5) / 400.0;
        let (sin, cos) = (golden * f64::from(index)).sin_cos();
        let across = (1.0 - up * up).sqrt();
        DVec3::new(across * cos, up, across * sin)
    });
    let inside = |direction: &DVec3| {
        let margin = DVec2::splat(f64::from(PATCH_PX as i32)) / DVec2::new(f64::from(SIZE[0]), f64::from(SIZE[1]));
        let well_within = |place: DVec2| place.cmpgt(margin).all() && place.cmplt(DVec2::ONE - margin).all();
        projectors.iter().filter_map(|projector| projector.place(*direction)).any(well_within)
    };
    let light = |index: usize| illuminance_lx_from_magnitude(4.0 * (index as f64 * 2.0_f64.sqrt()).fract());
    let found: Vec<DVec3> = lattice.filter(inside).take(STARS).collect();
    assert_eq!(found.len(), STARS);
    found.into_iter().enumerate().map(|(index, direction)| Star { direction, light_lx: light(index) }).collect()
}

fn catalogue(stars: &[Star]) -> String {
    let mut text = "x,y,z,v_mag,teff_k\n".to_owned();
    for (index, star) in stars.iter().enumerate() {
        let position = star.direction * 1e4;
        let magnitude = 4.0 * (index as f64 * 2.0_f64.sqrt()).fract();
        writeln!(text, "{},{},{},{magnitude},6500", position.x, position.y, position.z).unwrap();
    }
    text
}

/// Measurements of all stars for one way of delivering the calibration.
struct Measured {
    /// Light of each star divided by its light in the catalogue.
    light: Vec<f64>,
    /// The same ratio, computed from the closed form, if every pixel had the share that the masks encode.
    encoded: Vec<f64>,
    /// Distance from the star to the centroid of its light, and root mean square of the angle from the centroid, in pixels of the projector with the largest share.
    centroids_px: Vec<f64>,
    widths_px: Vec<f64>,
}

impl Measured {
    fn light_of_all(&self, stars: &[Star]) -> f64 {
        let sum: f64 = stars.iter().map(|star| star.light_lx).sum();
        stars.iter().zip(&self.light).map(|(star, light)| star.light_lx * light).sum::<f64>() / sum
    }

    /// Returns the largest relative error of the light of a star, compared with the catalogue, and with the shares that the masks encode.
    fn worst_light(&self) -> [f64; 2] {
        let worst = |ratio: &dyn Fn(usize) -> f64| {
            (0..self.light.len()).map(|star| (ratio(star) - 1.0).abs()).fold(0.0, f64::max)
        };
        [worst(&|star| self.light[star]), worst(&|star| self.light[star] / self.encoded[star])]
    }
}

fn percentile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[((sorted.len() - 1) as f64 * share).round() as usize]
}

/// Draws the views of a configuration, one for each projector, and measures the stars.
fn measured(
    folder: &Path,
    views: &str,
    projectors: &[Projector],
    stars: &[Star],
    encoded: &dyn Fn(f64) -> f64,
) -> Measured {
    let text = format!(
        "[scene]\ncatalogues = ['stars.csv']\n[glare]\nmethod = 'none'\n[exposure]\nmode = 'manual'\nev100 = -3.0\n{views}"
    );
    let config = Config::from_text(&text, "dome.toml", folder, &[]).unwrap();
    let (loaded, _) = load_stars(&config.star_sources(), &config.epoch(), &mut |_| {}).unwrap();
    let scene = SceneSnapshot {
        revision: 1,
        stars: Arc::new(loaded),
        objects: Arc::new(config.objects().unwrap()),
        camera: config.camera().unwrap(),
    };
    let (rig, settings) = (config.rig().unwrap(), config.render_settings());
    let frame = renderer().render(FrameRequest::new(&scene, &rig).settings(&settings).wanted(Wanted::hdr())).unwrap();
    let images = &frame.images;
    assert_eq!(images.len(), projectors.len());
    let mut result =
        Measured { light: Vec::new(), encoded: Vec::new(), centroids_px: Vec::new(), widths_px: Vec::new() };
    for star in stars {
        let on_projectors: Vec<OnProjector> = (0..projectors.len())
            .filter_map(|own| OnProjector::measure(projectors, own, &images[own], star.direction, encoded))
            .collect();
        let sum = |light: fn(&OnProjector) -> f64| on_projectors.iter().map(light).sum::<f64>() / star.light_lx;
        result.light.push(sum(|star| star.shared_lx));
        result.encoded.push(sum(|star| star.encoded_lx));
        let largest = on_projectors.iter().max_by(|a, b| a.share.total_cmp(&b.share)).unwrap();
        result.centroids_px.push(largest.centroid_px);
        result.widths_px.push(largest.width_px);
    }
    result
}

/// Measurements of a star on one projector.
struct OnProjector {
    /// Light times the share of the projector.
    shared_lx: f64,
    /// Light times the share that the masks encode.
    encoded_lx: f64,
    share: f64,
    centroid_px: f64,
    width_px: f64,
}

impl OnProjector {
    fn measure(
        projectors: &[Projector],
        own: usize,
        image: &FrameImage,
        star: DVec3,
        encoded: &dyn Fn(f64) -> f64,
    ) -> Option<Self> {
        let projector = &projectors[own];
        let place = projector.place(star)?;
        let [width, height] = SIZE.map(i64::from);
        let middle = [place.x * width as f64, place.y * height as f64].map(|at| at as i64);
        let blend = image.projector.as_ref().and_then(|output| output.blend());
        let share = |index: usize| blend.map_or(1.0, |blend: &Blend| f64::from(blend.weights()[index][0]));
        let hdr = image.hdr.as_ref().unwrap();
        let (mut shared_lx, mut encoded_lx, mut sum_lx, mut weighted) = (0.0, 0.0, 0.0, DVec3::ZERO);
        let mut pixels = Vec::new();
        for y in (middle[1] - PATCH_PX).max(0)..=(middle[1] + PATCH_PX).min(height - 1) {
            for x in (middle[0] - PATCH_PX).max(0)..=(middle[0] + PATCH_PX).min(width - 1) {
                let index = (y * width + x) as usize;
                let [r, g, b, _] = hdr[index].map(f64::from);
                let light = luminance([r, g, b]) * projector.pixel_sr(x as u32, y as u32);
                if light > 0.0 {
                    let (x, y) = ((x as f64 + 0.5) / width as f64, (y as f64 + 0.5) / height as f64);
                    let direction = projector.direction(x, y);
                    encoded_lx += light * encoded(crate::common::theatre::share(projectors, own, x, y));
                    shared_lx += light * share(index);
                    sum_lx += light;
                    weighted += direction * light;
                    pixels.push((direction, light));
                }
            }
        }
        let [x, y] = middle.map(|at| at as u32);
        let pixel_rad = projector.pixel_sr(x.min(SIZE[0] - 1), y.min(SIZE[1] - 1)).sqrt();
        let centre = weighted.normalize_or_zero();
        let square: f64 = pixels.iter().map(|(direction, light)| light * direction.angle_between(centre).powi(2)).sum();
        Some(Self {
            shared_lx,
            encoded_lx,
            share: share((y.min(SIZE[1] - 1) * SIZE[0] + x.min(SIZE[0] - 1)) as usize),
            centroid_px: centre.angle_between(star) / pixel_rad,
            width_px: (square / sum_lx).sqrt() / pixel_rad,
        })
    }
}

/// A way of delivery: its name, the keys of the views, the share that the masks encode for an exact share, and the limits of the relative errors of
/// the light, compared with the catalogue and with the encoded shares.
type Way<'a> = (&'a str, &'a str, &'a dyn Fn(f64) -> f64, [f64; 2]);

/// Returns the `[[views]]` of all projectors. `{name}` in the keys is replaced by the name of the projector.
fn views(projectors: &[Projector], keys: &str) -> String {
    projectors
        .iter()
        .map(|projector| {
            let keys = keys.replace("{name}", &projector.name);
            format!("[[views]]\nname = '{}'\ntype = 'projector'\n{keys}\n", projector.name)
        })
        .collect()
}

#[test]
#[ignore = "long: make test-all"]
fn stars_keep_their_light_through_the_blends_of_six_projectors() {
    let projectors = projectors_of(SIZE);
    let stars = stars(&projectors);
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    write("stars.csv", catalogue(&stars).as_bytes());
    let fine = Alpha { bits: 16, gamma: 1.0 };
    let coarse = Alpha { bits: 8, gamma: 2.2 };
    let a3 = |alpha| Mpcdi { alpha, ..Mpcdi::a3(65, 65) }.bytes(&projectors);
    write("fine.mpcdi", &a3(Some(fine)));
    write("coarse.mpcdi", &a3(Some(coarse)));
    write("bare.mpcdi", &a3(None));
    let sl =
        Mpcdi { alpha: Some(Alpha { bits: 16, gamma: 2.2 }), profile: "sl", per_metre: 1000.0, ..Mpcdi::a3(65, 65) };
    write("sl.mpcdi", &sl.bytes(&projectors));
    for (own, projector) in projectors.iter().enumerate() {
        let name = &projector.name;
        // Programs that read such meshes multiply the codes of the display, whose gamma is 2.2, by the intensities.
        let intensity = |column: usize, row: usize| {
            share(&projectors, own, column as f64 / 128.0, row as f64 / 128.0).powf(1.0 / 2.2)
        };
        write(&format!("{name}.data"), bourke(projector, 129, 129, intensity).as_bytes());
        write(&format!("{name}_mesh.data"), bourke(projector, 129, 129, |_, _| 1.0).as_bytes());
        let mask = Alpha { bits: 8, gamma: 2.2 }.map(&projectors, own);
        write(&format!("{name}_mask.png"), &mask);
        let fisheye = r#"{"type":"FisheyeProjection","fov":180,"tilt":0}"#;
        let more = format!(r#","mesh":"{name}_mesh.data","blendmask":"{name}_mask.png""#);
        write(&format!("{name}.json"), sgct(SIZE, fisheye, &more).as_bytes());
    }
    let exact = |share: f64| share;
    let eight = |share: f64| coarse.quantized(share);
    let sets: [Way<'_>; 7] = [
        ("MPCDI a3, alpha of 16 bits", "file = 'fine.mpcdi'\nregion = '{name}'", &exact, [4e-4, 8e-5]),
        (
            "MPCDI a3, computed blends",
            "file = 'bare.mpcdi'\nregion = '{name}'\nblend = 'computed'",
            &exact,
            [4e-4, 4e-7],
        ),
        ("MPCDI a3, alpha of 8 bits", "file = 'coarse.mpcdi'\nregion = '{name}'", &eight, [0.015, 2e-7]),
        ("MPCDI sl, mm, alpha of 16 bits", "file = 'sl.mpcdi'\nregion = '{name}'", &exact, [4e-4, 8e-5]),
        ("SGCT, mesh and mask of 8 bits", "file = '{name}.json'", &eight, [0.015, 2e-7]),
        ("Paul Bourke's mesh", "file = '{name}.data'\nsize = [320, 200]", &exact, [2e-3, 2e-3]),
        ("MPCDI a3, resampled", "file = 'fine.mpcdi'\nregion = '{name}'\nmethod = 'resampled'", &exact, [0.8, 1e-4]),
    ];
    for (name, keys, encoded, most) in sets {
        let found = measured(folder.path(), &views(&projectors, keys), &projectors, &stars, encoded);
        let (all, worst) = (found.light_of_all(&stars) - 1.0, found.worst_light());
        let [centroid, width] =
            [&found.centroids_px, &found.widths_px].map(|values| [0.5, 1.0].map(|share| percentile(values, share)));
        println!(
            "{name}: relative error of the light of {STARS} stars {all:+.1e}, largest {:.1e}, against the masks {:.1e}; centroid error {:.4} px, largest {:.4}; width {:.3} px, largest {:.3}",
            worst[0], worst[1], centroid[0], centroid[1], width[0], width[1]
        );
        assert!(worst[0] < most[0] && worst[1] < most[1], "{name}: {worst:?}");
    }
}

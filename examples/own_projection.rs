//! A custom projection: `cargo run --release --example own_projection -- --out out`.
//!
//! The Hammer projection shows the whole sphere in an ellipse twice as wide as high, and every pixel of it has the same
//! solid angle. The library does not include it; this example implements `PlaneMapping` for it. The f64 renderer draws
//! with the mapping; the adapter draws with a table of it. `hammer.png` is the sky in galactic coordinates in f64,
//! `hammer_adapter.png` the adapter's picture. Exits with 1 if the light of the f64 map differs from that of all stars
//! by more than 1e-9, if that of the adapter's map differs by more than 1e-4, or if the adapter's pixels differ from
//! those of the f64 map.

use std::{
    error::Error,
    f64::consts::{PI, SQRT_2},
    io::Write,
    path::PathBuf,
    process::ExitCode,
    sync::Arc,
};

use clap::Parser;
use glam::{DMat3, DQuat, DVec2, DVec3};
use steradian::{
    FrameRequest, Gpu, GpuOptions, RenderSettings, Renderer, Rig, SceneSnapshot, StarSet, View, ViewKind, Wanted,
    catalogue::{
        bright::bright_stars,
        galaxy::{GalaxyParameters, generate},
    },
    coordinates::icrs_from_galactic,
    output::{Encoding, encode},
    photometry::{
        exposure::{limiting_ev100, white_luminance_cd_m2},
        kernel::SplatKernel,
        rec709::luminance,
        tone_map::ToneMapSettings,
    },
    plan::settings::{GlareSettings, StarMethod},
    reference::stars::splat::{Eye, ReferenceImage, draw},
    render::FrameImage,
    units::illuminance_lx_from_magnitude,
    view::{
        Part,
        projection::{BoundingCone, Footprint, PlaneMapping, TabulatedMapping, Tap},
    },
};

/// Magnitude of the faintest visible stars, and the 8-bit code of their peak.
const LIMITING_MAGNITUDE: f64 = 6.5;
const JUST_SEEN_CODE: f64 = 20.0;

/// Draws the whole sky as an ellipse.
#[derive(Debug, Parser)]
struct Arguments {
    /// Folder for the pictures; created if it does not exist.
    #[arg(long)]
    out: PathBuf,
    /// Height of the picture in pixels; it is twice as wide.
    #[arg(long, default_value_t = 512, value_parser = clap::value_parser!(u32).range(16..=8192))]
    height: u32,
    /// Number of synthetic stars in addition to the real ones.
    #[arg(long, default_value_t = 200_000)]
    stars: usize,
}

/// Hammer projection (1892), centred on -z, +y at the top. On its plane (x to 2 sqrt 2, y to sqrt 2) areas are solid
/// angles:
/// x = 2 sqrt 2 cos(b) sin(l/2) / w, y = sqrt 2 sin(b) / w, w = sqrt(1 + cos(b) cos(l/2)).
struct Hammer {
    height: u32,
}

impl Hammer {
    /// Pixels per unit of the plane.
    fn scale(&self) -> f64 {
        f64::from(self.height) / (2.0 * SQRT_2)
    }

    fn middle(&self) -> DVec2 {
        DVec2::new(f64::from(self.height), f64::from(self.height) / 2.0)
    }
}

impl PlaneMapping for Hammer {
    fn size(&self) -> [u32; 2] {
        [2 * self.height, self.height]
    }

    fn pixel_from_direction(&self, direction: DVec3) -> Option<DVec2> {
        let direction = direction.try_normalize()?;
        let across = direction.x.hypot(direction.z);
        let half_longitude = direction.x.atan2(-direction.z) / 2.0;
        let w = (1.0 + across * half_longitude.cos()).sqrt();
        let on_plane = DVec2::new(2.0 * across * half_longitude.sin(), -direction.y) * SQRT_2 / w;
        Some(self.middle() + on_plane * self.scale())
    }

    fn direction_from_pixel(&self, pixel: DVec2) -> Option<DVec3> {
        let p = (pixel - self.middle()) / self.scale() * DVec2::new(1.0, -1.0);
        // On the ellipse z^2 is 1/2; it is smaller outside.
        let z_squared = 1.0 - (p.x / 4.0).powi(2) - (p.y / 2.0).powi(2);
        if z_squared < 0.5 {
            return None;
        }
        let z = z_squared.sqrt();
        let longitude = 2.0 * (z * p.x).atan2(2.0 * (2.0 * z_squared - 1.0));
        let sin_latitude = (z * p.y).clamp(-1.0, 1.0);
        let across = (1.0 - sin_latitude * sin_latitude).sqrt();
        Some(DVec3::new(across * longitude.sin(), sin_latitude, -across * longitude.cos()))
    }

    /// Every pixel of the picture has the same solid angle.
    fn solid_angle_sr(&self, x: u32, y: u32) -> f64 {
        if self.contains(x, y) { self.scale().powi(-2) } else { 0.0 }
    }

    fn shows_full_sphere(&self) -> bool {
        true
    }

    fn bounding_cone(&self, _margin_px: f64) -> BoundingCone {
        BoundingCone { axis: DVec3::NEG_Z, half_angle_rad: PI }
    }

    /// The edge of the ellipse is a cut through the sky. The part of a star's kernel outside of the ellipse is added to
    /// the pixels inside, so that the map has all light of the star.
    fn taps(&self, kernel: Footprint<'_>, direction: DVec3) -> Vec<Tap> {
        let Some(centre) = self.pixel_from_direction(direction) else { return Vec::new() };
        let mut taps: Vec<Tap> = kernel(centre).into_iter().filter_map(|tap| self.tap_inside(tap)).collect();
        let inside: f64 = taps.iter().map(|tap| tap.weight).sum();
        for tap in &mut taps {
            tap.weight /= inside;
        }
        taps
    }
}

/// Largest allowed difference between the adapter's map and the f64 map: the sum of all differences divided by the sum
/// of all light. For a star displaced by a hundredth of a pixel, it is 1e-2.
const MOST_APART: f64 = 6e-4;

/// Draws the map on the adapter with a table of the mapping. Compares the light with `true_lx`, and the pixels with
/// those of `map`.
fn draw_on_adapter(
    stars: StarSet,
    world_from_view: DQuat,
    (mapping, map): (Hammer, &ReferenceImage),
    true_lx: f64,
) -> Result<FrameImage, Box<dyn Error>> {
    let table = Arc::new(TabulatedMapping::new(mapping)?);
    println!("table       {:.1} MiB, {:?}", table.bytes() as f64 / f64::from(1 << 20), table.accuracy());
    let rig = Rig::new(vec![View::new(
        "hammer",
        ViewKind::Tabulated { mapping: Arc::clone(&table) },
        world_from_view,
        DVec3::ZERO,
    )?])?;
    let mut settings = RenderSettings { glare: GlareSettings::none(), ..RenderSettings::default() };
    settings.stars.method = StarMethod::BSpline;
    let scene = SceneSnapshot::of_stars(stars);
    let mut renderer = Renderer::new(Gpu::open(&GpuOptions::default())?);
    let frame = renderer.render(FrameRequest::new(&scene, &rig).settings(&settings).wanted(Wanted::both()))?;
    let image = frame.images.into_iter().next().ok_or("no image")?;
    let drawn_lx = image.illuminance_lx().ok_or("no HDR image")?;
    let error = drawn_lx / true_lx - 1.0;
    println!("adapter     {}: {drawn_lx:.9e} lx, relative difference {error:+.1e}", renderer.adapter().adapter);
    if error.is_nan() || error.abs() > 1e-4 {
        return Err("the light of the adapter's map differs from that of all stars".into());
    }
    let expected = map.luminance_cd_m2(&*table);
    let apart: f64 = image
        .hdr
        .iter()
        .flatten()
        .zip(&expected)
        .map(|(found, expected)| {
            let [red, green, blue, omega_sr] = found.map(f64::from);
            let found = [red, green, blue];
            (0..3).map(|channel| (found[channel] - expected[channel]).abs() * omega_sr).sum::<f64>() / 3.0
        })
        .sum::<f64>()
        / true_lx;
    println!("pixels      differences from f64 add up to {apart:.1e} of the light");
    if apart.is_nan() || apart > MOST_APART {
        return Err("the adapter's pixels differ from those of the f64 map".into());
    }
    Ok(image)
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let mut records = bright_stars(0.0);
    let real = records.len();
    let galaxy = GalaxyParameters { stars: arguments.stars, seed: 1, fainter_than: Some(3.5), unresolved_light: false };
    records.extend(generate(&galaxy)?.stars);
    let stars = StarSet::from_records(records);
    println!("stars       {real} real, {} synthetic", stars.stars.len() - real);

    // Galactic coordinates: the centre of the Milky Way in the middle, its north pole at the top, longitude to the
    // left.
    let [centre, left, north] = icrs_from_galactic().to_cols_array_2d().map(DVec3::from_array);
    let world_from_view = DQuat::from_mat3(&DMat3::from_cols(-left, north, -centre));
    let eye = Eye { world_from_view, ..Eye::default() };
    let mapping = Hammer { height: arguments.height };
    let map = draw(&stars, eye, &mapping, |_| Some(SplatKernel::BSpline));

    // Compare the light of the pixels with the light of the stars.
    let drawn_lx: f64 = map.illuminance_lx.iter().map(|rgb| luminance(*rgb)).sum();
    let true_lx: f64 = stars
        .iter()
        .map(|(position, at_infinity, star)| {
            star.illuminance_at_1_pc_lx() / if at_infinity { 1.0 } else { position.length_squared() }
        })
        .sum();
    let error = drawn_lx / true_lx - 1.0;
    println!("flux        {drawn_lx:.9e} lx, all stars {true_lx:.9e} lx: relative difference {error:+.1e}");
    if error.is_nan() || error.abs() > 1e-9 {
        return Err("the light of the map differs from that of all stars".into());
    }

    let tone_map = ToneMapSettings::default();
    // All pixels have the same solid angle: the ellipse has the area 4 pi if the map's height is 2 sqrt 2.
    let pixel_sr = 8.0 / f64::from(arguments.height).powi(2);
    let limit_lx = illuminance_lx_from_magnitude(LIMITING_MAGNITUDE);
    let white_cd_m2 = white_luminance_cd_m2(limiting_ev100(limit_lx, pixel_sr, tone_map.light_of_code(JUST_SEEN_CODE)));
    let display = map
        .luminance_cd_m2(&mapping)
        .into_iter()
        .flat_map(|rgb| {
            let [red, green, blue] = tone_map.display_rgb(rgb, white_cd_m2).map(ToneMapSettings::byte);
            [red, green, blue, 255]
        })
        .collect();
    let [width, height] = map.size;
    let image =
        FrameImage { view: 0, part: Part::Whole, width, height, display: Some(display), hdr: None, projector: None };
    std::fs::create_dir_all(&arguments.out)?;
    let write = |name: &str, image: &FrameImage| -> Result<(), Box<dyn Error>> {
        let path = arguments.out.join(name);
        std::fs::write(&path, encode(Encoding::Png, image)?)?;
        println!("picture     {}", path.display());
        Ok(())
    };
    write("hammer.png", &image)?;
    write("hammer_adapter.png", &draw_on_adapter(stars, world_from_view, (mapping, &map), true_lx)?)
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // If standard error is closed too, the exit code still reports the failure.
            match writeln!(std::io::stderr(), "error: {error}") {
                Ok(()) | Err(_) => ExitCode::FAILURE,
            }
        }
    }
}

//! Draws one view with the library, without the daemon:
//! `cargo run --release --example render_view -- --out out`.
//!
//! The view is a flat window with real bright stars around Orion: `orion.png` and `orion.exr`. Prints the light in the
//! picture, as drawn by the adapter and as computed for the same view in f64; exits with 1 if the two differ by more
//! than 1e-3.

use std::{error::Error, io::Write, path::PathBuf, process::ExitCode, sync::Arc};

use clap::Parser;
use glam::{DQuat, DVec3};
use steradian::{
    catalogue::{bright::bright_stars, chunks::StarSet},
    gpu::{Gpu, GpuOptions},
    output::{Encoding, encode},
    photometry::{kernel::SplatKernel, rec709::luminance},
    plan::settings::{ExposureValues, GlareSettings, RenderSettings, StarMethod},
    reference::stars::splat::{Eye, draw},
    render::{FrameRequest, Renderer, Wanted},
    scene::{Camera, SceneSnapshot},
    view::{Rig, View, ViewKind},
};

/// Rotation from camera axes to ICRS axes: looks at Orion, north up.
const TOWARDS_ORION: [f64; 4] = [0.699_883_6, -0.037_904_3, -0.038_571_7, 0.712_206_7];

/// Draws Orion with the library.
#[derive(Debug, Parser)]
struct Arguments {
    /// Folder for the pictures; created if it does not exist.
    #[arg(long)]
    out: PathBuf,
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    // The scene: stars, and a camera at the Solar System's barycentre.
    let camera = Camera::new([0.0; 3], TOWARDS_ORION, [0.0; 3])?;
    let stars = Arc::new(StarSet::from_records(bright_stars(0.0)));
    let scene = SceneSnapshot { revision: 1, stars, objects: Default::default(), camera };

    // The rig has a single view with a single image. A rig may also have many views of all kinds, which are drawn
    // together.
    let kind = ViewKind::Perspective { size: [960, 640], fov_y_rad: 32f64.to_radians() };
    let rig = Rig::new(vec![View::new("orion", kind, DQuat::IDENTITY, DVec3::ZERO)?])?;

    let mut settings = RenderSettings::default();
    settings.stars.method = StarMethod::BSpline;
    // Turn off glare, because it would scatter light from stars near the border out of the picture, and the comparison
    // is with the light of the stars.
    settings.glare = GlareSettings::none();
    // Stars of this magnitude are just visible; brighter ones keep their colours.
    settings.exposure = ExposureValues { limiting_magnitude: 6.5, ..ExposureValues::default() }.into();

    let mut renderer = Renderer::new(Gpu::open(&GpuOptions::default())?);
    let frame = renderer.render(FrameRequest::new(&scene, &rig).settings(&settings).wanted(Wanted::both()))?;
    println!("adapter     {}", renderer.adapter().adapter);
    println!("stars       {} of {} in view", frame.views[0].stars_drawn, scene.stars.stars.len());

    std::fs::create_dir_all(&arguments.out)?;
    let image = frame.images.first().ok_or("the frame has no image")?;
    for (encoding, extension) in [(Encoding::Png, "png"), (Encoding::Exr, "exr")] {
        let path = arguments.out.join(format!("orion.{extension}"));
        std::fs::write(&path, encode(encoding, image)?)?;
        println!("picture     {}", path.display());
    }

    // Luminance times solid angle is illuminance: the light that arrives from all stars in the picture.
    let viewport = &rig.viewports(scene.camera.world_from_camera)[0];
    let mapping = viewport.projection.mapping();
    let drawn_lx = image.illuminance_lx().ok_or("the frame has no HDR image")?;
    let eye = Eye {
        position_m: scene.camera.position_m,
        world_from_view: viewport.world_from_view,
        velocity_c: scene.camera.velocity_c,
    };
    let twin = draw(&scene.stars, eye, mapping, |_| Some(SplatKernel::BSpline));
    let twin_lx: f64 = twin.illuminance_lx.iter().map(|rgb| luminance(*rgb)).sum();
    let error = drawn_lx / twin_lx - 1.0;
    println!("flux        {drawn_lx:.6e} lx, in f64 {twin_lx:.6e} lx: relative difference {error:+.1e}");
    if error.is_nan() || error.abs() > 1e-3 {
        return Err("the light in the picture differs from that of its stars".into());
    }
    Ok(())
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

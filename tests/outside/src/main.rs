//! Draws two stars in a flat view and a cube, and compares the light of each picture with the catalogue. Exits with 1
//! if they differ by more than 1e-4. Uses only names on the first page of the library's documentation, and items
//! reachable from them.

use std::{error::Error, process::ExitCode};

use steradian::{
    Frame, FrameRequest, Gpu, GpuOptions, RenderSettings, Renderer, Rig, SceneSnapshot, StarSet, View, ViewKind,
    Wanted,
    catalogue::StarRecord,
    glam::{DQuat, DVec3},
    plan::settings::GlareSettings,
    units::illuminance_lx_from_magnitude,
    view::projection::Face,
};

const MAGNITUDES: [f32; 2] = [1.0, 2.5];
const LARGEST_ERROR: f64 = 1e-4;

/// Returns the relative error of the light of each view, in the order of the rig.
fn errors_of_views(frame: &Frame, expected_lx: f64) -> Result<Vec<f64>, Box<dyn Error>> {
    let mut drawn_lx = vec![0.0; frame.views.len()];
    for image in &frame.images {
        drawn_lx[image.view] += image.illuminance_lx().ok_or("an image without HDR")?;
    }
    Ok(drawn_lx.into_iter().map(|drawn_lx| drawn_lx / expected_lx - 1.0).collect())
}

fn all_within(errors: &[f64]) -> bool {
    !errors.is_empty() && errors.iter().all(|error| error.abs() <= LARGEST_ERROR)
}

fn run() -> Result<(), Box<dyn Error>> {
    let star = |x: f64, magnitude| StarRecord {
        position: DVec3::new(x, 0.1, -1.0).normalize(),
        magnitude,
        temperature_k: 6500.0,
        distance_known: false,
    };
    let stars = vec![star(-0.2, MAGNITUDES[0]), star(0.3, MAGNITUDES[1])];
    let scene = SceneSnapshot::of_stars(StarSet::from_records(stars));

    let view = |name, kind| View::new(name, kind, DQuat::IDENTITY, DVec3::ZERO);
    let rig = Rig::new(vec![
        view("flat", ViewKind::Perspective { size: [320, 200], fov_y_rad: 1.0 })?,
        view("cube", ViewKind::Cubemap { face_size: 128, faces: Face::ALL.to_vec() })?,
    ])?;
    // Turn off glare, because it would scatter light over the edges of the flat view.
    let settings = RenderSettings { glare: GlareSettings::none(), ..RenderSettings::default() };

    let mut renderer = Renderer::new(Gpu::open(&GpuOptions::default())?);
    let request = FrameRequest::new(&scene, &rig).settings(&settings);
    let frame = renderer.render(request.wanted(Wanted::hdr()))?;
    let expected_lx = |magnitudes: &[f32]| -> f64 {
        magnitudes.iter().map(|magnitude| illuminance_lx_from_magnitude(f64::from(*magnitude))).sum()
    };
    let errors = errors_of_views(&frame, expected_lx(&MAGNITUDES))?;
    let texts: Vec<String> = errors.iter().map(|error| format!("{error:+.1e}")).collect();
    println!("{}: relative error of the light {texts:?}", renderer.adapter().adapter);
    if errors.len() != rig.views().len() || !all_within(&errors) {
        return Err("the light in the pictures differs from that of their stars".into());
    }
    // The comparison must detect a missing star.
    if all_within(&errors_of_views(&frame, expected_lx(&MAGNITUDES[..1]))?) {
        return Err("a missing star was not detected".into());
    }
    // Without options, a request reads back only the display images.
    let frame = renderer.render(FrameRequest::new(&scene, &rig))?;
    if !frame.images.iter().all(|image| image.display.is_some() && image.hdr.is_none()) {
        return Err("a request without options did not return exactly the display images".into());
    }
    Ok(())
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

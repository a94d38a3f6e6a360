//! Compares the light in images with the catalogue: `cargo run --release --example flux -- --config configs/demo.toml --pictures out`.
//!
//! For every view of a configuration that shows the whole sphere, sums luminance times solid angle over the pixels of
//! its EXR files, and compares that with the light of the stars and the diffuse light towards the same pixels. Solid
//! angles come from the projection in f64, not from the files. Exits with 1 if a sum differs by more than 1e-3.

use std::{
    error::Error,
    f64::consts::PI,
    io::Write,
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::Parser;
use exr::prelude::{ReadChannels, ReadLayers, read};
use steradian::{
    config::Config,
    metrics::{self, HdrView},
    photometry::rec709::luminance,
    scene::loader::{StarSource, load_stars},
    units::PARSEC_M,
    view::projection::{PlaneMapping, pixel_centre},
};

/// Compares the light in pictures with the light of the stars.
#[derive(Debug, Parser)]
struct Arguments {
    /// Configuration with which the pictures were rendered.
    #[arg(long)]
    config: PathBuf,
    /// Folder of the pictures.
    #[arg(long)]
    pictures: PathBuf,
}

/// Returns the illuminance of an EXR file, lx: luminance of each pixel times its solid angle.
fn illuminance_lx(path: &Path, mapping: &dyn PlaneMapping) -> Result<f64, Box<dyn Error>> {
    let file = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
    let layer = file.from_file(path).map_err(|error| format!("{}: {error}", path.display()))?.layer_data;
    let [width, height] = mapping.size();
    if (layer.size.width(), layer.size.height()) != (width as usize, height as usize) {
        return Err(format!("{}: the size is not {width} x {height} pixels", path.display()).into());
    }
    let channel = |name: &str| {
        let found = layer.channel_data.list.iter().find(|channel| channel.name == *name);
        found.ok_or_else(|| format!("{}: no channel {name}", path.display()))
    };
    let (red, green, blue) = (channel("R")?, channel("G")?, channel("B")?);
    let pixels: Vec<[f64; 3]> = (0..width as usize * height as usize)
        .map(|index| {
            [red, green, blue].map(|channel| f64::from(channel.sample_data.value_by_flat_index(index).to_f32()))
        })
        .collect();
    Ok(metrics::illuminance_lx(&HdrView::new(mapping, &pixels)?)?)
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let config = Config::load(&arguments.config, &[])?;
    let sources = config.star_sources();
    let (stars, report) = load_stars(&sources, &config.epoch(), &mut |_| {})?;
    for (source, catalogue) in sources.iter().zip(&report.catalogues) {
        let kind = if matches!(source, StarSource::Galaxy(_)) { "synthetic" } else { "real" };
        println!("stars       {} {kind}: {}", catalogue.stars, catalogue.name);
    }
    let camera = config.camera()?;
    let camera_pc = camera.position_m / PARSEC_M;
    let stars_lx: f64 = stars
        .iter()
        .map(|(position, at_infinity, star)| {
            star.illuminance_at_1_pc_lx() / if at_infinity { 1.0 } else { (position - camera_pc).length_squared() }
        })
        .sum();
    println!("light       {stars_lx:.6e} lx from all stars together");

    let rig = config.rig()?;
    let mut weighed = 0;
    let viewports = rig.viewports(camera.world_from_camera);
    for (number, view) in rig.views().iter().enumerate() {
        let sphere_sr: f64 = view.images.iter().map(|image| image.projection.picture_solid_angle_sr()).sum();
        if (sphere_sr - 4.0 * PI).abs() > 1e-6 {
            continue;
        }
        let mut drawn_lx = 0.0;
        for image in &view.images {
            let part = image.part.name().map_or(String::new(), |part| format!(".{part}"));
            let path = arguments.pictures.join(format!("{}{part}.exr", view.name));
            drawn_lx += illuminance_lx(&path, image.projection.mapping())?;
        }
        // Evaluate the diffuse light at the centre of each pixel, as the renderer does.
        let mut diffuse_lx = 0.0;
        if let Some(diffuse) = &stars.unresolved {
            for viewport in viewports.iter().filter(|viewport| viewport.view == number) {
                let mapping = viewport.projection.mapping();
                let [width, height] = mapping.size();
                for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                    if let Some(towards) = mapping.direction_from_pixel(pixel_centre(x, y)) {
                        let light = luminance(diffuse.luminance_cd_m2(viewport.world_from_view * towards));
                        diffuse_lx += light * mapping.solid_angle_sr(x, y);
                    }
                }
            }
            println!("light       {diffuse_lx:.6e} lx diffuse towards {}", view.name);
        }
        let error = drawn_lx / (stars_lx + diffuse_lx) - 1.0;
        println!("flux        {:.6e} lx in {}: relative error {error:+.1e}", drawn_lx, view.name);
        if error.is_nan() || error.abs() > 1e-3 {
            return Err(format!("{}: the light in the picture differs from the light of the stars", view.name).into());
        }
        weighed += 1;
    }
    if weighed == 0 {
        return Err("no view shows the whole sphere, so there is nothing to compare with".into());
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

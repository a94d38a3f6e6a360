//! Writes the files of one frame, or of several frames that show the views of one rig. The files are `<view>.exr` and
//! `<view>.png` (`<view>.<part>.exr` and `.png` for a view of several images), `timings.json`, and `manifest.json`. The
//! manifest is written last, so the images are complete if it exists. Except for the times, the files are
//! deterministic.

use std::io;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::Serialize;

use super::encode::{EncodeError, Encoding, encode};
use super::provenance::Provenance;
use crate::files::{self, write_whole};
use crate::plan::FramePlan;
use crate::render::{AsteroidCounts, Frame, FrameImage, FrameTimes, ViewStatistics};
use crate::view::{Rig, View};

/// Reason why the files of a frame cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// The operating system reported an error.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// An image cannot be encoded.
    #[error("cannot encode {}: {source}", path.display())]
    Encode {
        /// Target file.
        path: PathBuf,
        /// Reason.
        source: EncodeError,
    },
    /// The frame belongs to a different rig.
    #[error("the frame has an image of view {view}, but the rig has {views} views")]
    OtherRig {
        /// Index of the view.
        view: usize,
        /// Number of views.
        views: usize,
    },
    /// The manifest or the times cannot be serialised as JSON, because a number is not finite.
    #[error("cannot encode {}: {source}", path.display())]
    Manifest {
        /// The file.
        path: PathBuf,
        /// Reason.
        source: serde_json::Error,
    },
}

#[derive(Serialize)]
struct Manifest<'a> {
    #[serde(flatten)]
    provenance: &'a Provenance,
    scene_revision: u64,
    exposure_ev100: f64,
    views: Vec<ManifestView<'a>>,
}

#[derive(Serialize)]
struct ManifestView<'a> {
    name: &'a str,
    files: Vec<String>,
    /// Exposure of the display images.
    exposure_ev100: f64,
    stars_drawn: u64,
    stars_in_map: u64,
    /// Magnitude of the faintest stars visible in the display image.
    limiting_magnitude: Option<f64>,
    /// Numbers of asteroids by drawing method.
    asteroids: &'a AsteroidCounts,
    /// Plan of the display images, and plan of the HDR images if those are separate frames.
    plan: &'a FramePlan,
    #[serde(skip_serializing_if = "Option::is_none")]
    hdr_plan: Option<&'a FramePlan>,
}

#[derive(Serialize)]
struct Timings<'a> {
    /// Times of the frame, or of the first of several frames. They are sums if display and HDR images were drawn
    /// separately.
    frame: Option<&'a FrameTimes>,
    /// Times of all frames if there are several, in the order of their first views.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    frames: Vec<&'a FrameTimes>,
    views: Vec<ViewTimings<'a>>,
}

#[derive(Serialize)]
struct ViewTimings<'a> {
    name: &'a str,
    gpu_ms: Option<f64>,
}

fn write_json(path: PathBuf, content: &impl Serialize) -> Result<PathBuf, OutputError> {
    let mut json =
        serde_json::to_vec_pretty(content).map_err(|source| OutputError::Manifest { path: path.clone(), source })?;
    json.push(b'\n');
    match write_whole(&path, &json) {
        Ok(()) => Ok(path),
        Err(source) => Err(OutputError::Write { path, source }),
    }
}

/// Writes one frame with [`write_frames`].
///
/// # Errors
///
/// Those of [`write_frames`].
pub fn write_frame(
    folder: &Path,
    rig: &Rig,
    frame: &Frame,
    provenance: &Provenance,
    written: &(dyn Fn(&Path) + Sync),
) -> Result<Vec<PathBuf>, OutputError> {
    write_frames(folder, rig, std::slice::from_ref(frame), provenance, written)
}

/// Checks that files can be written into a folder, before the work that produces them. The folder is not created.
///
/// # Errors
///
/// The folder, or the folder in which it would be created, is a file or cannot be written.
pub fn check_folder(folder: &Path) -> Result<(), OutputError> {
    files::check_folder(folder).map_err(|source| OutputError::Write { path: folder.to_owned(), source })
}

/// Writes every HDR image of the frames as EXR and every display image as PNG, the times and the manifest into
/// `folder`, which is created if necessary. Each view of the rig belongs to one of the frames; the manifest contains
/// the exposure of the first frame.
///
/// Files are encoded in parallel; `written` is called for each completed file. Returns the paths in the order of views
/// and images, the manifest last. Each file is written atomically.
///
/// # Errors
///
/// See [`OutputError`].
pub fn write_frames(
    folder: &Path,
    rig: &Rig,
    frames: &[Frame],
    provenance: &Provenance,
    written: &(dyn Fn(&Path) + Sync),
) -> Result<Vec<PathBuf>, OutputError> {
    std::fs::create_dir_all(folder).map_err(|source| OutputError::Write { path: folder.to_owned(), source })?;
    // List the files: encoding, image and path.
    let views = rig.views();
    let mut files: Vec<Vec<String>> = vec![Vec::new(); views.len()];
    let mut jobs = Vec::new();
    let mut images: Vec<&FrameImage> = frames.iter().flat_map(|frame| &frame.images).collect();
    // Views in the order of the rig; the sort is stable, so a view's parts keep their order.
    images.sort_by_key(|image| image.view);
    for image in images {
        let other_rig = OutputError::OtherRig { view: image.view, views: views.len() };
        let view = views.get(image.view).ok_or(other_rig)?;
        let stem = image.part.name().map_or(view.name.clone(), |part| format!("{}.{part}", view.name));
        let held = [(Encoding::Exr, "exr", image.hdr.is_some()), (Encoding::Png, "png", image.display.is_some())];
        for (encoding, extension, _) in held.into_iter().filter(|(.., held)| *held) {
            let name = format!("{stem}.{extension}");
            jobs.push((encoding, image, folder.join(&name)));
            files[image.view].push(name);
        }
    }
    // Encode and write them in parallel.
    jobs.par_iter().try_for_each(|(encoding, image, path)| {
        let bytes = encode(*encoding, image).map_err(|source| OutputError::Encode { path: path.clone(), source })?;
        write_whole(path, &bytes).map_err(|source| OutputError::Write { path: path.clone(), source })?;
        written(path);
        Ok(())
    })?;
    // Manifest and times of the views that have statistics.
    let mut paths: Vec<PathBuf> = jobs.into_iter().map(|(_, _, path)| path).collect();
    let statistics = |view: &View| {
        frames
            .iter()
            .find_map(|frame| Some((frame, frame.views.iter().find(|statistics| statistics.name == view.name)?)))
    };
    let known: Vec<(&Frame, &ViewStatistics, Vec<String>)> = views
        .iter()
        .zip(files)
        .filter_map(|(view, files)| statistics(view).map(|(frame, statistics)| (frame, statistics, files)))
        .collect();
    let views = known
        .iter()
        .map(|(frame, statistics, files)| ManifestView {
            name: &statistics.name,
            files: files.clone(),
            exposure_ev100: frame.exposure_ev100,
            stars_drawn: statistics.stars_drawn,
            stars_in_map: statistics.stars_in_map,
            limiting_magnitude: statistics.limiting_magnitude,
            asteroids: &statistics.asteroids,
            plan: &frame.plan,
            hdr_plan: frame.hdr_plan.as_ref(),
        })
        .collect();
    let manifest = Manifest {
        provenance,
        scene_revision: frames.first().map_or(0, |frame| frame.scene_revision),
        exposure_ev100: frames.first().map_or(0.0, |frame| frame.exposure_ev100),
        views,
    };
    let views = known.iter().map(|(_, view, _)| ViewTimings { name: &view.name, gpu_ms: view.gpu_ms }).collect();
    let several = frames.iter().map(|frame| &frame.times).filter(|_| frames.len() > 1);
    let timings = Timings { frame: frames.first().map(|frame| &frame.times), frames: several.collect(), views };
    for path in
        [write_json(folder.join("timings.json"), &timings)?, write_json(folder.join("manifest.json"), &manifest)?]
    {
        written(&path);
        paths.push(path);
    }
    Ok(paths)
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::super::encode::tests::{exr_channel, sample};
    use super::super::provenance::{InputFile, UsedConfiguration};
    use super::*;
    use crate::config::CameraConfig;
    use crate::scene::Camera;
    use crate::view::projection::Face;
    use crate::view::{Part, ViewKind};

    fn provenance() -> Provenance {
        Provenance {
            version: "1.2.3".to_owned(),
            adapter: "some adapter".to_owned(),
            driver: "some driver".to_owned(),
            configuration: UsedConfiguration { folder: "/skies".into(), toml: "[scene]\n".to_owned() },
            camera: CameraConfig::from(&Camera::default()),
            time_s_since_j2000: 8.5,
            catalogues: Vec::new(),
            files: vec![InputFile { file: "a.csv".to_owned(), bytes: 3, sha256: "00".to_owned() }],
        }
    }

    fn rig_and_frame() -> (Rig, Frame) {
        let view = |name: &str, kind: ViewKind| View::new(name, kind, DQuat::IDENTITY, DVec3::ZERO).unwrap();
        let rig = Rig::new(vec![
            view("sky", ViewKind::Equirectangular { size: [8, 4] }),
            view("cube", ViewKind::Cubemap { face_size: 5, faces: vec![Face::Front, Face::Down] }),
        ])
        .unwrap();
        let image = |view, part, width, height| FrameImage { view, part, ..sample(width, height) };
        let images = vec![
            image(0, Part::Whole, 8, 4),
            image(1, Part::Face(Face::Front), 5, 5),
            image(1, Part::Face(Face::Down), 5, 5),
        ];
        let views = rig
            .views()
            .iter()
            .zip([3, 4])
            .map(|(view, stars_drawn)| ViewStatistics {
                name: view.name.clone(),
                stars_drawn,
                stars_in_map: 0,
                limiting_magnitude: (stars_drawn == 4).then_some(6.25),
                asteroids: AsteroidCounts::default(),
                gpu_ms: (stars_drawn == 3).then_some(1.5),
            })
            .collect();
        let frame = Frame {
            number: 1,
            scene_revision: 7,
            camera_revision: 2,
            exposure_ev100: -3.25,
            metered_ev100: -3.25,
            mean_luminance_cd_m2: 0.01,
            images,
            views,
            plan: FramePlan { stars: "bspline".to_owned(), ..FramePlan::default() },
            hdr_plan: None,
            times: FrameTimes::default(),
        };
        (rig, frame)
    }

    #[test]
    fn file_names_manifest_and_pixels_match_the_frame() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("deep/out");
        let (rig, frame) = rig_and_frame();
        let written = write_frame(&out, &rig, &frame, &provenance(), &|_| {}).unwrap();
        let names: Vec<&str> = written.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
        let expected =
            "sky.exr sky.png cube.front.exr cube.front.png cube.down.exr cube.down.png timings.json manifest.json";
        assert_eq!(names.join(" "), expected);
        assert_eq!(std::fs::read_dir(&out).unwrap().count(), written.len(), "no other file is left");

        let manifest: serde_json::Value =
            serde_json::from_slice(&std::fs::read(out.join("manifest.json")).unwrap()).unwrap();
        assert_eq!(manifest["adapter"], "some adapter");
        assert_eq!(manifest["files"][0]["file"], "a.csv");
        let read: Provenance = serde_json::from_value(manifest.clone()).unwrap();
        assert_eq!(read, provenance(), "the manifest contains the complete provenance");
        assert_eq!(manifest["scene_revision"], 7);
        assert_eq!(manifest["exposure_ev100"], -3.25);
        assert_eq!(manifest["views"][1]["name"], "cube");
        assert_eq!(manifest["views"][1]["files"].as_array().unwrap().len(), 4);
        assert_eq!(manifest["views"][1]["stars_drawn"], 4);
        assert_eq!(manifest["views"][1]["limiting_magnitude"], 6.25);
        assert!(manifest["views"][0]["limiting_magnitude"].is_null());
        assert_eq!(manifest["views"][0]["plan"]["stars"], "bspline");

        let timings: serde_json::Value =
            serde_json::from_slice(&std::fs::read(out.join("timings.json")).unwrap()).unwrap();
        assert_eq!(timings["views"][0]["gpu_ms"], 1.5);
        assert!(timings["views"][1]["gpu_ms"].is_null());
        assert_eq!(timings["frame"]["total_ms"], 0.0);

        let omega = exr_channel(&std::fs::read(out.join("cube.down.exr")).unwrap(), "omega");
        let expected: Vec<f32> = frame.images[2].hdr.as_ref().unwrap().iter().map(|pixel| pixel[3]).collect();
        assert_eq!(omega, expected);
    }

    #[test]
    fn undrawn_images_have_no_files() {
        let folder = tempfile::tempdir().unwrap();
        let (rig, mut frame) = rig_and_frame();
        frame.images[0].hdr = None;
        frame.images[2].display = None;
        let written = write_frame(folder.path(), &rig, &frame, &provenance(), &|_| {}).unwrap();
        let names: Vec<&str> = written.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
        assert_eq!(names.join(" "), "sky.png cube.front.exr cube.front.png cube.down.exr timings.json manifest.json");
    }

    #[test]
    fn errors_name_the_path() {
        let folder = tempfile::tempdir().unwrap();
        let (rig, mut frame) = rig_and_frame();
        let occupied = folder.path().join("file");
        std::fs::write(&occupied, "x").unwrap();
        let error = write_frame(&occupied, &rig, &frame, &provenance(), &|_| {}).unwrap_err();
        assert!(error.to_string().contains("file"), "{error}");
        frame.images[1].display = Some(vec![0; 3]);
        let error = write_frame(folder.path(), &rig, &frame, &provenance(), &|_| {}).unwrap_err();
        assert!(error.to_string().contains("cube.front.png"), "{error}");
        assert!(!folder.path().join("manifest.json").exists());
        frame.images[0].view = 2;
        assert!(matches!(
            write_frame(folder.path(), &rig, &frame, &provenance(), &|_| {}),
            Err(OutputError::OtherRig { .. })
        ));
    }
}

//! Fuzz tests of messages, like those of files in `tests/fuzz`: mutated bytes are decoded and converted to plain values, without a daemon. The tests
//! are in this crate because the generated types are private to the service.
//!
//! The first byte of an input selects the message. Asteroid fields are converted but not placed, because that takes
//! long.

#![allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
#![allow(clippy::print_stderr, reason = "the child process reports why it ends")]

use std::{
    path::Path,
    sync::{Arc, LazyLock},
};

use prost::Message;
use prost_types::{FieldMask, Timestamp};

use crate::{
    config::{Config, ObserverConfig, ViewSpec},
    plan::settings::RenderSettings,
    scene::{Camera, SceneClock, SceneObjects},
    service::{
        client::connection::ReceivedFrame,
        proto,
        scene::{
            objects::Objects,
            state::{SceneState, SceneUpdate},
            views::{ViewSet, ViewUpdate},
        },
        state_file::Saved,
        time_source::TimeSource,
        wire::{
            camera::{self, camera_from_pb},
            encoding,
            objects::{body_from_pb, field_from_pb},
            overlay::overlay_from_pb,
            scene::{self, scene_to_pb, scene_update_from_pb, star_method},
            views::{ViewChange, settings_to_pb, spec_from_pb, spec_to_pb, view_change_from_pb, view_to_pb},
        },
    },
    verify,
};

#[path = "../../tests/fuzz/driver.rs"]
mod driver;

use driver::{Run, Target, as_it_is, check};

/// An observer and its surroundings.
static PLACE: LazyLock<(ObserverConfig, Arc<SceneObjects>)> = LazyLock::new(|| {
    let text = "[scene]\ntime = 2026-11-23T20:00:00Z\nsolar_system = false\n\
                [scene.observer]\nlatitude_deg = 48\nlongitude_deg = 11\n";
    let config = Config::from_text(text, "place.toml", Path::new(""), &[]).unwrap();
    (config.scene.observer.clone().unwrap(), Arc::new(config.objects().unwrap()))
});

/// Returns a scene with two views and no objects.
fn scene() -> SceneState {
    let RenderSettings { stars, asteroids, .. } = RenderSettings::default();
    let given = |name: &str| {
        let table = format!("name = '{name}'\ntype = 'fisheye'\nsize = [8, 8]\nfov_deg = 180.0");
        ViewSpec::from_toml(&table).unwrap()
    };
    let views = ["dome", "flat"].map(given).to_vec();
    let views = ViewSet::new(&RenderSettings::default(), views, Path::new("")).unwrap();
    let (observer, drawn) = &*PLACE;
    SceneState {
        revision: 1,
        stars,
        asteroids,
        clock: SceneClock::stopped(drawn.time_s),
        objects: Objects::new(Arc::clone(drawn), &[], Some(observer.clone())).unwrap(),
        views: Arc::new(views),
        jumps: 0,
    }
}

fn decoded<T: Message + Default>(bytes: &[u8]) -> Result<T, String> {
    T::decode(bytes).map_err(|error| error.to_string())
}

fn changed(update: &SceneUpdate) -> Result<SceneState, String> {
    let scene = scene();
    update.overlay.check_views(&["dome", "flat"])?;
    let made = update.make(&scene)?;
    let time = TimeSource::default();
    let changed = scene.changed(&made, None, time.now()).map_err(|error| error.to_string())?;
    // Messages to clients and state files.
    scene_to_pb(&changed, &[], &time).encode_to_vec();
    Saved::from_scene(&changed, None, &time).encode_to_vec();
    Ok(changed)
}

fn update_scene(bytes: &[u8]) -> Result<(), String> {
    let update = scene_update_from_pb(&decoded(bytes)?)?;
    scene::scene_update_to_pb(&update, None).encode_to_vec();
    if !update.asteroid_fields.is_nothing() { Ok(()) } else { changed(&update).map(drop) }
}

fn update_view(bytes: &[u8]) -> Result<(), String> {
    let request: proto::UpdateViewRequest = decoded(bytes)?;
    let general = RenderSettings::default();
    let before = scene();
    for view in 0..2 {
        let after = match view_change_from_pb(&request, &before.views.spec(view))? {
            ViewChange::Update(update) => before.views.changed(&general, view, &update)?,
            ViewChange::Replace(spec) => before.views.replaced(&general, view, &spec)?,
        };
        encode_views(&before, after);
    }
    Ok(())
}

/// Encodes messages about views, for clients and for state files.
fn encode_views(before: &SceneState, views: ViewSet) {
    let scene = before.clone().with_views(views, Some(("flat", true))).unwrap();
    for view in 0..scene.views.ids().len() {
        view_to_pb(view, &scene).encode_to_vec();
    }
    scene.views.frame_groups(&RenderSettings::default());
    Saved::from_scene(&scene, None, &TimeSource::default()).encode_to_vec();
}

fn create_view(bytes: &[u8]) -> Result<(), String> {
    let request: proto::CreateViewRequest = decoded(bytes)?;
    let read = spec_from_pb(&request.definition.unwrap_or_default());
    let (spec, view) = read.map_err(|error| error.to_string())?;
    let (general, before) = (RenderSettings::default(), scene());
    let after = before.views.with(&general, spec, view)?;
    encode_views(&before, after.without(&general, 0)?);
    encode_views(&before, after);
    Ok(())
}

fn set_camera(bytes: &[u8]) -> Result<(), String> {
    let update = camera::update_from_pb(decoded(bytes)?);
    let [zero, at_rest] = [[0.0; 3]; 2];
    let camera = Camera::new(
        update.position_m.unwrap_or(zero),
        update.orientation.unwrap_or([0.0, 0.0, 0.0, 1.0]),
        update.velocity_c.unwrap_or(at_rest),
    );
    camera.map(|camera| drop(camera::camera_to_pb(&camera).encode_to_vec())).map_err(|error| error.to_string())
}

/// Reads names in requests.
fn names(bytes: &[u8]) -> Result<(), String> {
    let request: proto::VerifyRequest = decoded(bytes)?;
    verify::select(Some(&request.filter)).map_err(|error| error.to_string())?;
    star_method(&request.star_method)?;
    let request: proto::NextFrameRequest = decoded(bytes)?;
    encoding::encoding_from_pb(request.encoding).map(drop).ok_or_else(|| "no encoding".to_owned())
}

/// Reads the content of a state file.
fn saved(bytes: &[u8]) -> Result<(), String> {
    let mut saved: Saved = decoded(bytes)?;
    if let Some(scene) = &mut saved.scene {
        scene.asteroid_fields.clear();
    }
    if let Some(camera) = saved.camera.clone() {
        camera_from_pb(camera).map_err(|error| error.to_string())?;
    }
    saved.applied(&scene(), &RenderSettings::default(), TimeSource::default().now()).map(drop)
}

/// Reads messages to clients.
fn answers(bytes: &[u8]) -> Result<(), String> {
    let frame = decoded::<proto::Frame>(bytes)
        .and_then(|frame| ReceivedFrame::try_from(frame).map(drop).map_err(|error| error.to_string()));
    let scene: proto::Scene = decoded(bytes)?;
    for body in scene.bodies {
        body_from_pb(body)?;
    }
    for field in scene.asteroid_fields {
        field_from_pb(field)?;
    }
    overlay_from_pb(scene.overlay.unwrap_or_default())?;
    frame
}

type Reader = fn(&[u8]) -> Result<(), String>;

const READERS: [Reader; 7] = [update_scene, update_view, set_camera, names, saved, answers, create_view];

fn read(data: &[u8]) -> String {
    let Some((first, bytes)) = data.split_first() else { return "no message".to_owned() };
    let number = usize::from(*first) % READERS.len();
    READERS[number](bytes)
        .err()
        .map_or(String::new(), |problem| format!("{} {problem}", char::from(b'a' + number as u8)))
}

fn full_scene() -> proto::Scene {
    let vector = |x: f64, y: f64, z: f64| Some(proto::Vector3 { x, y, z });
    let style = Some(proto::LineStyle { colour: Some("#80ff00".to_owned()), width_px: Some(2.0), opacity: Some(0.5) });
    let body = proto::Body {
        name: "moon".to_owned(),
        position_m: vector(4e8, 0.0, 0.0),
        orientation: Some(proto::Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }),
        radii_m: vector(1.7e6, 1.7e6, 1.7e6),
        geometric_albedo: Some(proto::Rgb { red: 0.1, green: 0.1, blue: 0.1 }),
        law: "lambert".to_owned(),
        spin: Some(proto::Spin { period_s: Some(2e6), phase_rad: 0.5 }),
        emission: Some(proto::Emission {
            luminance_cd_m2: Some(proto::Rgb { red: 2e9, green: 2e9, blue: 2e9 }),
            limb_darkening: 0.6,
            corona: Some(true),
        }),
        ..Default::default()
    };
    let field = proto::AsteroidField {
        name: "belt".to_owned(),
        position_m: vector(0.0, 0.0, 0.0),
        instances: 100,
        placement: Some(proto::asteroid_field::Placement::Belt(proto::BeltPlacement {
            inner_m: 1e9,
            outer_m: 2e9,
            height_m: 1e7,
        })),
        radius_m: Some(proto::Range { least: 100.0, most: 1e4 }),
        size_index: 3.0,
        spin_period_s: Some(proto::Range { least: 1e4, most: 1e5 }),
        geometric_albedo: Some(proto::Rgb { red: 0.1, green: 0.1, blue: 0.1 }),
        law: "lommel_seeliger".to_owned(),
        shapes: Some(proto::asteroid_field::Shapes::ShapeSeed(7)),
        ..Default::default()
    };
    proto::Scene {
        stars: Some(proto::StarSettings { method: "tent".to_owned(), magnitude_limit: 6.5 }),
        bodies: vec![body],
        asteroid_fields: vec![field],
        time: Some(Timestamp { seconds: 1_000_000_000, nanos: 5 }),
        asteroids: Some(proto::AsteroidSettings { impostor: "auto".to_owned(), quality: 1.0 }),
        overlay: Some(proto::Overlay {
            cardinal_points: false,
            grids: vec![proto::Grid {
                kind: "equatorial".to_owned(),
                spacing_deg: Some(10.0),
                numbers: Some(true),
                style: style.clone(),
            }],
            trajectories: vec![proto::Trajectory {
                name: "orbit".to_owned(),
                points_m: vec![proto::Vector3 { x: 1e9, y: 0.0, z: 0.0 }, proto::Vector3 { x: 0.0, y: 1e9, z: 0.0 }],
                style,
            }],
            labels: vec![proto::Label {
                name: "pole".to_owned(),
                text: "Pole".to_owned(),
                anchor: Some(proto::label::Anchor::Direction(proto::Vector3 { x: 0.0, y: 0.0, z: 1.0 })),
                ..Default::default()
            }],
            test_patterns: vec!["dome".to_owned()],
            pictures: vec![proto::OverlayPicture {
                name: "title".to_owned(),
                // The head of a PNG without the rest.
                png: Some(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01\x08\x06\0\0\0\x1f\x15\xc4\x89".to_vec()),
                anchor: Some(proto::overlay_picture::Anchor::Direction(proto::Vector3 { x: 1.0, y: 0.0, z: 0.0 })),
                width_deg: 20.0,
                ..Default::default()
            }],
        }),
        ..Default::default()
    }
}

/// A table of `[[views]]` with many kinds of keys.
const EYES: &str = "
name = 'eyes'
type = 'stereo'
size = [8, 8]
ipd_m = 0.064
fov_left = { left_deg = -50.0, right_deg = 40.0, up_deg = 45.0, down_deg = -45.0 }
fov_right = { left_deg = -40.0, right_deg = 50.0, up_deg = 45.0, down_deg = -45.0 }
orientation = [0.0, 0.0, 0.0, 1.0]
position_m = [0.0, 1.0, 0.0]
glare = { fraction = 0.2 }
";

fn seeds() -> Vec<Vec<u8>> {
    let message = |kind: u8, bytes: Vec<u8>| [vec![kind], bytes].concat();
    let mask = |paths: &[&str]| Some(FieldMask { paths: paths.iter().map(|path| (*path).to_owned()).collect() });
    let scene_request = |paths: &[&str]| {
        let request = proto::UpdateSceneRequest {
            scene: Some(full_scene()),
            update_mask: mask(paths),
            expected_revision: Some(1),
        };
        message(0, request.encode_to_vec())
    };
    let general = RenderSettings::default();
    let view = settings_to_pb(&scene().views.settings[0], general.stars.method);
    let view_request = |paths: &[&str]| {
        let mut view = proto::View { exposure_group: "both".to_owned(), ..view.clone() };
        if let Some(glare) = &mut view.glare {
            glare.psf_file = None;
        }
        let request = proto::UpdateViewRequest { view: Some(view), update_mask: mask(paths), expected_revision: None };
        message(1, request.encode_to_vec())
    };
    let camera = camera::camera_to_pb(&Camera::default());
    let moved = proto::SetCameraRequest {
        position_m: camera.position_m,
        orientation: camera.orientation,
        velocity_c: camera.velocity_c,
        expected_revision: Some(3),
        look: Some(proto::Look { at: "Mars".to_owned(), ..Default::default() }),
        frame: 1,
        turn: camera.orientation,
    };
    let asked = proto::VerifyRequest { filter: "two-colours".to_owned(), star_method: "tent".to_owned() };
    let definition = proto::ViewDefinition {
        exposure_group: Some("both".to_owned()),
        test_pattern: Some(true),
        ..spec_to_pb(&ViewSpec::from_toml(EYES).unwrap().0).unwrap()
    };
    let create = proto::CreateViewRequest { definition: Some(definition.clone()), expected_revision: Some(1) };
    let redefined = |paths: &[&str]| {
        let definition = Some(proto::ViewDefinition { name: None, ..definition.clone() });
        let view = proto::View { definition, ..Default::default() };
        message(
            1,
            proto::UpdateViewRequest { view: Some(view), update_mask: mask(paths), ..Default::default() }
                .encode_to_vec(),
        )
    };
    let mut displayed = scene();
    let join = ViewUpdate { exposure_group: Some("both".to_owned()), ..ViewUpdate::default() };
    for view in 0..2 {
        displayed.views = Arc::new(displayed.views.changed(&general, view, &join).unwrap());
    }
    let (eyes, view) = spec_from_pb(&definition).unwrap();
    displayed.views = Arc::new(displayed.views.with(&general, eyes, view).unwrap().without(&general, 0).unwrap());
    let mut full = Saved::from_scene(&displayed, Some(&Camera::default()), &TimeSource::default());
    full.scene = Some(full_scene());
    let frame = proto::Frame {
        view: "dome".to_owned(),
        pose_time: Some(Timestamp { seconds: 1_000_000_000, nanos: 0 }),
        render_time: Some(Timestamp { seconds: 1_000_000_000, nanos: 1 }),
        camera: Some(camera),
        images: vec![proto::Image { width: 1, height: 1, encoding: 1, data: vec![0; 4].into(), ..Default::default() }],
        ..Default::default()
    };
    vec![
        scene_request(&["stars", "time", "asteroids", "bodies", "overlay"]),
        scene_request(&["stars.method", "stars.magnitude_limit", "bodies.moon", "bodies.sun", "overlay.grids"]),
        scene_request(&["asteroid_fields"]),
        scene_request(&["asteroid_fields.belt", "asteroids.impostor", "asteroids.quality"]),
        scene_request(&["overlay.pictures", "overlay.cardinal_points"]),
        scene_request(&["overlay.trajectories.orbit", "overlay.labels.pole", "overlay.test_patterns"]),
        view_request(&["exposure", "glare", "tone_map", "exposure_group"]),
        view_request(&["exposure.mode", "exposure.ev100", "glare.fraction", "tone_map.dither"]),
        redefined(&["definition"]),
        redefined(&["definition.ipd_m", "definition.fov_left", "definition.test_pattern"]),
        message(2, moved.encode_to_vec()),
        message(3, asked.encode_to_vec()),
        message(4, Saved::from_scene(&displayed, Some(&Camera::default()), &TimeSource::default()).encode_to_vec()),
        message(4, full.encode_to_vec()),
        message(5, frame.encode_to_vec()),
        message(5, full_scene().encode_to_vec()),
        message(6, create.encode_to_vec()),
    ]
}

const TARGET: Target = Target {
    name: "messages",
    read,
    seeds,
    tokens: &[
        "stars",
        "time",
        "asteroids",
        "bodies",
        "bodies.",
        "bodies.moon",
        "asteroid_fields",
        "asteroid_fields.belt",
        "overlay",
        "overlay.grids",
        "overlay.labels.pole",
        "overlay.pictures.title",
        "exposure",
        "exposure.mode",
        "glare",
        "glare.kernel",
        "glare.psf_file",
        "tone_map",
        "tone_map.operator",
        "exposure_group",
        "definition",
        "definition.fov_left",
        "stereo",
        "fisheye",
        "manual",
        "auto",
        "mean",
        "spot",
        "cie",
        "psf",
        "\u{0}\u{0}\u{0}\u{0}\u{0}\u{0}\u{7f}",
        "#ffffff",
        "lambert",
        "tent",
    ],
    repair: as_it_is,
    most_bytes: 512 << 20,
};

#[test]
fn few_messages() {
    check(&TARGET, Run::Short, concat!(module_path!(), "::few_messages"));
}

#[test]
#[ignore = "long: make test-all"]
fn messages_for_a_minute() {
    check(&TARGET, Run::Long, concat!(module_path!(), "::messages_for_a_minute"));
}

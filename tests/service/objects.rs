//! Bodies, asteroid fields, time and asteroid settings are added, changed, removed and watched.

use std::sync::Arc;

use glam::{DQuat, DVec3};
use steradian::{
    output::Encoding,
    plan::settings::ImpostorMethod,
    scene::{
        SceneObjects,
        asteroids::{FieldParameters, FieldSpec, Placement, ShapeSource, make_fields},
        bodies::{Body, ReflectionLaw, SolarBody, Texture},
    },
    service::{BodyForm, Change, Client, ClientError, SceneUpdate, ServeOptions},
};
use tonic::Code;

use crate::daemon::{Daemon, small_rig, within};

pub fn swarm(name: &str) -> FieldSpec {
    FieldSpec {
        name: name.to_owned(),
        position_m: DVec3::X * 1e9,
        orientation: DQuat::IDENTITY,
        parameters: FieldParameters {
            instances: 300,
            seed: 1,
            placement: Placement::Box { size_m: DVec3::splat(1e5) },
            radius_m: [10.0, 100.0],
            size_index: 2.5,
            spin_period_s: [7200.0, 86_400.0],
        },
        shapes: ShapeSource::Procedural { seed: 3 },
        law: ReflectionLaw::LommelSeeliger,
        geometric_albedo: [0.1; 3],
    }
}

/// Shapes beyond the memory limit are refused before they are baked, and the scene stays unchanged.
#[tokio::test]
async fn impostors_beyond_the_memory_limit_are_refused() {
    // With large tiles, a shape needs 179 MB.
    let large = |options: &mut ServeOptions| options.views.settings.asteroids.tile_px = 128;
    let daemon = Daemon::start_with(small_rig(), large).await;
    let mut client = daemon.client().await;
    let error = client.put_asteroid_field(swarm("swarm"), None).await;
    refused(error, Code::ResourceExhausted, &["MiB", "at most 512 MiB", "asteroids.tile_px"]);
    assert_eq!(client.scene().await.unwrap().asteroid_fields, []);
    // Without impostors there are no atlases, so the change is accepted.
    let none = SceneUpdate { impostor: Some(ImpostorMethod::None), ..SceneUpdate::default() };
    client.update_scene(&none, None).await.unwrap();
    client.put_asteroid_field(swarm("swarm"), None).await.unwrap();
    let again = SceneUpdate { impostor: Some(ImpostorMethod::Octahedral), ..SceneUpdate::default() };
    refused(client.update_scene(&again, None).await, Code::ResourceExhausted, &["asteroids.tiles"]);
    assert_eq!(client.scene().await.unwrap().impostor, "none");
    daemon.shutdown().await.unwrap();
}

/// Draws a frame; returns its objects.
async fn drawn_objects(daemon: &Daemon, client: &mut Client) -> Arc<SceneObjects> {
    client.render_frame("flat", Encoding::Rgba8).await.unwrap();
    daemon.controls.shown.lock().unwrap().clone().expect("a frame").0
}

#[track_caller]
fn refused<T: std::fmt::Debug>(answer: Result<T, ClientError>, code: Code, parts: &[&str]) {
    match answer {
        Err(ClientError::Status { code: found, message }) => {
            assert!(found == code && parts.iter().all(|part| message.contains(part)), "{found:?} {message}");
        }
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn frames_show_bodies_that_are_added_moved_and_removed() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    assert!(drawn_objects(&daemon, &mut client).await.is_empty());
    let mars = Body::preset(SolarBody::Mars, "mars", DVec3::X * 2e11);
    let scene = client.put_body(mars.clone(), Some(7)).await.unwrap();
    assert_eq!((scene.revision, scene.bodies.as_slice()), (8, &[BodyForm::from(mars.clone())][..]));
    client.put_body(Body::preset(SolarBody::Sun, "sun", DVec3::ZERO), None).await.unwrap();
    assert_eq!(*drawn_objects(&daemon, &mut client).await.bodies[0], mars);

    let mut moved = mars.clone();
    moved.position_m = DVec3::Y * 3e11;
    let scene = client.put_body(moved.clone(), Some(9)).await.unwrap();
    let names: Vec<_> = scene.bodies.iter().map(|form| form.body.name.as_str()).collect();
    assert_eq!((scene.revision, names), (10, vec!["mars", "sun"]));
    let before = drawn_objects(&daemon, &mut client).await;
    assert_eq!(*before.bodies[0], moved);

    let scene = client.remove_body("mars", None).await.unwrap();
    assert_eq!((scene.revision, scene.bodies.len()), (11, 1));
    let after = drawn_objects(&daemon, &mut client).await;
    assert!(after.bodies.len() == 1 && Arc::ptr_eq(&after.bodies[0], &before.bodies[1]), "the other body stays");
    assert_eq!(client.scene().await.unwrap(), scene);

    let all = SceneUpdate { bodies: Change::All(vec![moved.into(), mars.into()]), ..SceneUpdate::default() };
    refused(client.update_scene(&all, None).await, Code::InvalidArgument, &["mars", "unique"]);
    let none = SceneUpdate { bodies: Change::All(Vec::new()), ..SceneUpdate::default() };
    assert!(client.update_scene(&none, None).await.unwrap().bodies.is_empty());
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn invalid_changes_have_no_effect() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let mars = Body::preset(SolarBody::Mars, "mars", DVec3::X * 2e11);
    let before = client.put_body(mars.clone(), None).await.unwrap();
    let mut flat = mars.clone();
    flat.radii_m.z = 0.0;
    let mut painted = BodyForm::from(mars.clone());
    painted.texture_of = Some("mars".to_owned());
    let mut named = mars.clone();
    named.name = "a.b".to_owned();
    refused(client.put_body(mars.clone(), Some(7)).await, Code::Aborted, &["revision 8, not 7"]);
    refused(client.remove_body("mars", Some(9)).await, Code::Aborted, &["revision 8, not 9"]);
    refused(
        client.remove_body("venus", None).await,
        Code::InvalidArgument,
        &["bodies.venus", "the existing ones are: mars"],
    );
    refused(client.put_body(flat, None).await, Code::InvalidArgument, &["bodies.mars", "radii_m", "0.001"]);
    refused(client.put_body(painted, None).await, Code::InvalidArgument, &["texture_of", "configuration: none"]);
    refused(client.put_body(named, None).await, Code::InvalidArgument, &["letters"]);
    let mut empty = swarm("swarm");
    empty.parameters.instances = 0;
    refused(client.put_asteroid_field(empty, None).await, Code::InvalidArgument, &["swarm", "instances = 0"]);
    let mut lent = swarm("swarm");
    lent.shapes = ShapeSource::OfField("rocks".to_owned());
    refused(client.put_asteroid_field(lent, None).await, Code::InvalidArgument, &["shapes_of", "rocks", "none"]);
    refused(client.remove_asteroid_field("swarm", None).await, Code::InvalidArgument, &["does not exist"]);
    // If one part of a change is invalid, no part of it is made.
    let mixed = SceneUpdate {
        magnitude_limit: Some(3.0),
        time_s: Some(5.0),
        bodies: Change::remove("mars"),
        asteroid_fields: Change::remove("nothing"),
        ..SceneUpdate::default()
    };
    refused(client.update_scene(&mixed, None).await, Code::InvalidArgument, &["asteroid_fields.nothing"]);
    let many = (0..257).map(|i| Body::preset(SolarBody::Moon, &format!("m{i}"), DVec3::X).into()).collect();
    let many = SceneUpdate { bodies: Change::All(many), ..SceneUpdate::default() };
    refused(client.update_scene(&many, None).await, Code::InvalidArgument, &["one too many", "256"]);
    for quality in [0.0, f64::NAN, 11.0] {
        let update = SceneUpdate { quality: Some(quality), ..SceneUpdate::default() };
        refused(client.update_scene(&update, None).await, Code::InvalidArgument, &["quality", "between 0.1 and 10"]);
    }
    assert_eq!(client.scene().await.unwrap(), before);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn fields_are_placed_once_and_kept_across_other_changes() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let scene = client.put_asteroid_field(swarm("swarm"), Some(7)).await.unwrap();
    assert_eq!((scene.revision, scene.asteroid_fields.as_slice()), (8, &[swarm("swarm")][..]));
    let first = drawn_objects(&daemon, &mut client).await;
    assert_eq!((first.fields[0].instances.packed.len(), first.fields[0].position_m), (300, DVec3::X * 1e9));

    let mut moved = swarm("swarm");
    moved.position_m = DVec3::Y;
    client.put_asteroid_field(moved, None).await.unwrap();
    client.put_body(Body::preset(SolarBody::Sun, "sun", DVec3::ZERO), None).await.unwrap();
    client.put_asteroid_field(swarm("other"), None).await.unwrap();
    let second = drawn_objects(&daemon, &mut client).await;
    assert_eq!((second.fields.len(), second.fields[0].position_m), (2, DVec3::Y));
    for field in &second.fields {
        assert!(Arc::ptr_eq(&field.instances, &first.fields[0].instances), "{}", field.name);
    }
    let mut other = swarm("other");
    other.parameters.seed = 2;
    client.put_asteroid_field(other, None).await.unwrap();
    let third = drawn_objects(&daemon, &mut client).await;
    assert!(Arc::ptr_eq(&third.fields[0], &second.fields[0]));
    assert_ne!(third.fields[1].instances, second.fields[1].instances);
    let scene = client.remove_asteroid_field("swarm", None).await.unwrap();
    assert_eq!((scene.asteroid_fields.len(), scene.asteroid_fields[0].parameters.seed), (1, 2));
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn time_and_asteroid_settings_apply_from_the_next_frame() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let scene = client.scene().await.unwrap();
    assert_eq!((scene.time_s, scene.impostor.as_str(), scene.quality), (0.0, "auto", 1.0));
    let update = SceneUpdate {
        time_s: Some(820_497_600.5),
        impostor: Some(ImpostorMethod::EulerAtlas),
        quality: Some(2.5),
        ..SceneUpdate::default()
    };
    let scene = client.update_scene(&update, Some(7)).await.unwrap();
    assert_eq!((scene.time_s, scene.impostor.as_str(), scene.quality), (820_497_600.5, "euler_atlas", 2.5));
    assert_eq!(drawn_objects(&daemon, &mut client).await.time_s, 820_497_600.5);
    let settings = daemon.controls.shown.lock().unwrap().clone().unwrap().1;
    assert_eq!((settings.impostor, settings.quality, settings.tiles), (ImpostorMethod::EulerAtlas, 2.5, 32));
    let before = drawn_objects(&daemon, &mut client).await;
    client.update_scene(&SceneUpdate { quality: Some(1.0), ..SceneUpdate::default() }, None).await.unwrap();
    assert!(Arc::ptr_eq(&before, &drawn_objects(&daemon, &mut client).await), "unchanged objects are shared");
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn watchers_receive_changes_of_objects() {
    let daemon = Daemon::start(small_rig()).await;
    let (mut client, mut other) = (daemon.client().await, daemon.client().await);
    let mut watch = client.watch_scene().await.unwrap();
    assert!(within(watch.next()).await.unwrap().expect("the scene as it is").bodies.is_empty());
    other.put_body(Body::preset(SolarBody::Earth, "earth", DVec3::X * 1.5e11), None).await.unwrap();
    let scene = within(watch.next()).await.unwrap().expect("a change");
    assert_eq!((scene.revision, scene.bodies[0].body.name.as_str()), (8, "earth"));
    other.put_asteroid_field(swarm("swarm"), None).await.unwrap();
    assert_eq!(within(watch.next()).await.unwrap().expect("a change").asteroid_fields, [swarm("swarm")]);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn textures_of_the_configuration_can_be_kept_and_shared() {
    let mut moon = Body::preset(SolarBody::Moon, "moon", DVec3::X);
    let texture = Arc::new(Texture { size: [2, 1], rgb: vec![[0.5; 3], [1.0; 3]] });
    moon.surface.texture = Some(Arc::clone(&texture));
    let spec = Arc::new(FieldSpec {
        name: "swarm".to_owned(),
        position_m: DVec3::ZERO,
        orientation: DQuat::IDENTITY,
        parameters: swarm("swarm").parameters,
        shapes: ShapeSource::Procedural { seed: 3 },
        law: ReflectionLaw::Lambert,
        geometric_albedo: [0.2; 3],
    });
    let fields = make_fields(&[Arc::clone(&spec)], &[]).unwrap().into_iter().map(|made| made.field).collect();
    let objects = SceneObjects { bodies: vec![Arc::new(moon)], fields, time_s: 1.0, ..Default::default() };
    let daemon = Daemon::start_with(small_rig(), |options| {
        options.scene.snapshot.objects = Arc::new(objects);
        options.scene.asteroid_fields = vec![spec];
    })
    .await;
    let mut client = daemon.client().await;
    let scene = client.scene().await.unwrap();
    assert_eq!(
        (scene.asteroid_fields[0].law, scene.asteroid_fields[0].geometric_albedo),
        (ReflectionLaw::Lambert, [0.2; 3])
    );
    assert_eq!((scene.bodies[0].texture_of.as_deref(), scene.time_s), (Some("moon"), 1.0));
    let mut form = scene.bodies[0].clone();
    form.body.position_m = DVec3::Y;
    let mut copy = form.clone();
    copy.body.name = "copy".to_owned();
    client.put_body(form, None).await.unwrap();
    assert_eq!(client.put_body(copy, None).await.unwrap().bodies[1].texture_of.as_deref(), Some("moon"));
    for body in &drawn_objects(&daemon, &mut client).await.bodies {
        assert!(Arc::ptr_eq(body.surface.texture.as_ref().unwrap(), &texture));
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn fields_without_a_definition_are_refused_at_the_start() {
    let spec = FieldSpec {
        name: "swarm".to_owned(),
        position_m: DVec3::ZERO,
        orientation: DQuat::IDENTITY,
        parameters: swarm("swarm").parameters,
        shapes: ShapeSource::Procedural { seed: 3 },
        law: ReflectionLaw::Lambert,
        geometric_albedo: [0.2; 3],
    };
    let fields = make_fields(&[Arc::new(spec)], &[]).unwrap().into_iter().map(|made| made.field).collect();
    let engine = Box::new(crate::daemon::TestEngine::new(Arc::default()));
    let scene = steradian::scene::SceneSnapshot {
        revision: 1,
        stars: Arc::default(),
        objects: Arc::new(SceneObjects { fields, ..SceneObjects::default() }),
        camera: steradian::scene::Camera::default(),
    };
    let settings = steradian::plan::settings::RenderSettings::default();
    let options = steradian::service::ServeOptions::new("127.0.0.1:0", engine, scene, small_rig(), settings, |_| ());
    let error = steradian::service::run(options).await.unwrap_err();
    assert!(error.to_string().contains("swarm"), "{error}");
}

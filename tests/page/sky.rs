//! Steering below a turning sky, and the search for objects.

use std::{path::Path, time::Duration};

use fantoccini::{
    actions::{InputSource, KeyAction, KeyActions},
    key::Key,
};
use glam::{DQuat, DVec3};
use steradian::{
    config::Config,
    observer::{Frame, Observer},
    scene::Camera,
    service::{CameraUpdate, SceneUpdate},
};
use tokio::time::sleep;

use crate::{
    Test,
    browser::{Browser, Screen, with_page},
    daemon::Daemon,
    pictures::has_picture,
};

pub const TESTS: &[Test] = &[
    ("sky::a_key_turns_from_what_is_seen_while_the_sky_turns", a_key_turns_from_what_is_seen),
    ("sky::a_drag_turns_from_what_is_seen_while_the_sky_turns", a_drag_turns_from_what_is_seen),
    ("sky::a_name_is_found_and_looked_at", a_name_is_found_and_looked_at),
];

/// A place without air and ground, which these tests do not need.
pub const PLACE: &str = "
[scene.observer]
latitude_deg = 48.14
longitude_deg = 11.58
[scene.observer.air]
enabled = false
[scene.observer.ground]
enabled = false
";

fn observer() -> Observer {
    Config::from_text(&format!("[scene]\n{PLACE}"), "place.toml", Path::new("."), &[]).unwrap().observer().unwrap()
}

/// Returns the orientation of a camera relative to the horizon axes.
fn on_horizon(camera: &Camera) -> DQuat {
    let icrs_from_horizon = Frame::Horizon.icrs_from(Some(&observer()), camera.as_of_s).unwrap();
    DQuat::from_mat3(&icrs_from_horizon).inverse() * camera.world_from_camera
}

/// Starts the daemon with a sky that turns by 15 degrees per second, and waits until it has turned by more than 45
/// degrees.
async fn turn_the_sky(page: &Browser, daemon: &mut Daemon) -> Camera {
    daemon.restart_at(PLACE);
    // The page may still be building its panel when the daemon restarts.
    page.until("document.getElementById('horizontal')?.textContent.includes('Azimuth')").await;
    let mut client = daemon.client().await;
    let fixed = CameraUpdate { frame: Some(Frame::Horizon), ..CameraUpdate::default() };
    let before = client.set_camera(&fixed).await.unwrap();
    client.update_scene(&SceneUpdate { time_rate: Some(3600.0), ..SceneUpdate::default() }, None).await.unwrap();
    page.until("document.querySelector('[data-view=window]').dataset.camera === '1'").await;
    sleep(Duration::from_secs(4)).await;
    let turned = client.camera().await.unwrap();
    assert_eq!(turned.revision, before.revision);
    let angle_deg = turned.world_from_camera.angle_between(before.world_from_camera).to_degrees();
    assert!(angle_deg > 30.0, "the camera turns with the sky: {angle_deg}");
    assert!(on_horizon(&turned).angle_between(on_horizon(&before)) < 1e-6);
    turned
}

/// The panel shows the direction of the camera, in ICRS axes and relative to the observer's horizon.
async fn check_panel(page: &Browser, daemon: &Daemon) {
    let mut client = daemon.client().await;
    client.update_scene(&SceneUpdate { time_rate: Some(0.0), ..SceneUpdate::default() }, None).await.unwrap();
    let camera = client.camera().await.unwrap();
    let ahead = camera.world_from_camera * DVec3::NEG_Z;
    page.until(&format!(
        "document.getElementById('pointing').textContent.includes('declination {:.2}')",
        ahead.z.asin().to_degrees()
    ))
    .await;
    let local = on_horizon(&camera) * DVec3::NEG_Z;
    let azimuth_deg = (-local.y.atan2(local.x)).to_degrees().rem_euclid(360.0);
    let text = page.run::<String>("return document.getElementById('horizontal').textContent").await;
    let told: Vec<f64> =
        text.split(|c: char| !"0123456789.-".contains(c)).filter_map(|word| word.parse().ok()).collect();
    assert!(
        (told[0] - azimuth_deg).abs() < 0.02 && (told[1] - local.z.asin().to_degrees()).abs() < 0.02,
        "{text}: {local}"
    );
    let errors = page.errors_beside_restarts();
    assert!(errors.is_empty(), "{errors:#?}");
}

fn a_key_turns_from_what_is_seen() -> Result<(), String> {
    with_page(Screen::Desk, async |page, daemon| {
        let before = turn_the_sky(page, daemon).await;
        page.run::<Option<u8>>("document.querySelector('[data-view=window] canvas').focus()").await;
        let left = char::from(Key::Left);
        let keys = KeyActions::new("keyboard".to_owned())
            .then(KeyAction::Down { value: left })
            .then(KeyAction::Pause { duration: Duration::from_millis(300) })
            .then(KeyAction::Up { value: left });
        page.client.perform_actions(keys).await.unwrap();
        page.until("Number(document.querySelector('[data-view=window]').dataset.camera) > 1").await;
        sleep(Duration::from_millis(500)).await;
        let after = daemon.client().await.camera().await.unwrap();
        // In 0.3 s at 0.5 rad/s the camera turns by 8.6 degrees around its y axis.
        let turn = on_horizon(&before).inverse() * on_horizon(&after);
        let (axis, angle_rad) = turn.to_axis_angle();
        assert!(axis.y.abs() > 0.9999, "{axis}");
        assert!((1.0..25.0).contains(&angle_rad.to_degrees()), "{} degrees", angle_rad.to_degrees());
        check_panel(page, daemon).await;
    })
}

fn a_drag_turns_from_what_is_seen() -> Result<(), String> {
    with_page(Screen::Desk, async |page, daemon| {
        let before = turn_the_sky(page, daemon).await;
        page.drag(Screen::Desk, [600.0, 400.0], [660.0, 420.0]).await;
        sleep(Duration::from_millis(500)).await;
        let after = daemon.client().await.camera().await.unwrap();
        assert!(after.revision > before.revision);
        let angle_deg = on_horizon(&before).angle_between(on_horizon(&after)).to_degrees();
        assert!((1.0..15.0).contains(&angle_deg), "{angle_deg} degrees");
        check_panel(page, daemon).await;
    })
}

fn a_name_is_found_and_looked_at() -> Result<(), String> {
    with_page(Screen::Desk, async |page, daemon| {
        page.until(&has_picture("window")).await;
        page.fill("#panel-camera [name=find]", "sirius").await;
        page.click("#panel-camera [role=search] [type=submit]").await;
        page.until("document.getElementById('found').textContent.includes('Sirius (alf CMa), magnitude -1.4')").await;
        page.click("#panel-camera [role=search] [type=button]").await;
        page.until("document.getElementById('found').textContent.includes('looks at')").await;
        let mut client = daemon.client().await;
        let direction = client.find("Sirius").await.unwrap().direction;
        let camera = client.camera().await.unwrap();
        assert!((camera.world_from_camera * DVec3::NEG_Z).angle_between(direction) < 1e-6);
        page.fill("#panel-camera [name=find]", "Pluto").await;
        page.click("#panel-camera [role=search] [type=submit]").await;
        page.until("document.getElementById('notices').textContent.includes('`Pluto`')").await;
    })
}

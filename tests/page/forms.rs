//! Forms change the daemon, and never overwrite the changes of another client.

use steradian::service::{CameraUpdate, SceneUpdate};

use crate::{
    Test,
    browser::{Browser, Screen, with_page},
    pictures::has_picture,
};

pub const TESTS: &[Test] = &[
    ("forms::bodies_are_added_changed_and_removed", bodies_are_added_changed_and_removed),
    ("forms::a_change_by_another_client_is_reported_and_kept", a_change_by_another_client_is_reported_and_kept),
    ("forms::stars_time_grids_and_camera_are_set", stars_time_grids_and_camera_are_set),
];

async fn wait_for_notice(page: &Browser, text: &str) {
    page.until(&format!("document.getElementById('notices').textContent.includes({text:?})")).await;
}

async fn add_body(page: &Browser, name: &str) {
    page.click("#panel-bodies > .buttons button").await;
    for (field, value) in [
        ("name", name),
        ("position_m.x", "2e7"),
        ("position_m.y", "0"),
        ("position_m.z", "-4e7"),
        ("radii_m.x", "3396000"),
        ("radii_m.y", "3396000"),
        ("radii_m.z", "3376000"),
    ] {
        page.fill(&format!("#body-form [name='{field}']"), value).await;
    }
    page.click("#body-form [type=submit]").await;
}

fn bodies_are_added_changed_and_removed() -> Result<(), String> {
    with_page(Screen::Desk, async |page, daemon| {
        let mut client = daemon.client().await;
        page.until(&has_picture("window")).await;
        page.click("#tab-bodies").await;
        add_body(page, "mars").await;
        wait_for_notice(page, "Body mars is added").await;
        let scene = client.scene().await.unwrap();
        assert_eq!(scene.bodies.len(), 1);
        assert_eq!(scene.bodies[0].body.name, "mars");
        // A refusal shows the daemon's message, and the form keeps its values.
        page.click("#bodies button").await;
        page.fill("#body-form [name='radii_m.z']", "-1").await;
        page.click("#body-form [type=submit]").await;
        wait_for_notice(page, "radii").await;
        assert!(page.find("#body-form").await.is_displayed().await.unwrap());
        page.fill("#body-form [name='radii_m.z']", "1e6").await;
        page.click("#body-form [type=submit]").await;
        wait_for_notice(page, "Body mars is saved").await;
        assert!(client.scene().await.unwrap().revision > scene.revision);
        page.click("#bodies li button:last-child").await;
        wait_for_notice(page, "Body mars is removed").await;
        assert!(client.scene().await.unwrap().bodies.is_empty());
    })
}

fn a_change_by_another_client_is_reported_and_kept() -> Result<(), String> {
    with_page(Screen::Desk, async |page, daemon| {
        let mut client = daemon.client().await;
        page.until(&has_picture("window")).await;
        page.click("#tab-scene").await;
        page.fill("#panel-scene [name=magnitude_limit]", "3").await;
        let other = SceneUpdate { magnitude_limit: Some(4.5), ..SceneUpdate::default() };
        client.update_scene(&other, None).await.unwrap();
        page.click("#panel-scene form [type=submit]").await;
        wait_for_notice(page, "another client has changed the scene").await;
        assert_eq!(client.scene().await.unwrap().magnitude_limit, 4.5);
        page.until("document.querySelector('#panel-scene [name=magnitude_limit]').value === '4.5'").await;
        // The user has seen the change and may now overwrite it. An untouched form follows the daemon.
        page.fill("#panel-scene [name=magnitude_limit]", "3").await;
        page.click("#panel-scene form [type=submit]").await;
        wait_for_notice(page, "are set").await;
        assert_eq!(client.scene().await.unwrap().magnitude_limit, 3.0);
        client.update_scene(&other, None).await.unwrap();
        page.until("document.querySelector('#panel-scene [name=magnitude_limit]').value === '4.5'").await;
    })
}

fn stars_time_grids_and_camera_are_set() -> Result<(), String> {
    with_page(Screen::Desk, async |page, daemon| {
        let mut client = daemon.client().await;
        page.until(&has_picture("window")).await;
        page.click("#tab-scene").await;
        page.fill("#panel-scene [name=method]", "no-such-method").await;
        page.click("#panel-scene form [type=submit]").await;
        wait_for_notice(page, "bspline").await;
        page.fill("#panel-scene [name=method]", "tent").await;
        page.click("#panel-scene form [type=submit]").await;
        wait_for_notice(page, "are set").await;
        page.fill("#panel-scene [name=time]", "2030-06-01T12:00:00Z").await;
        page.click("#panel-scene form:nth-of-type(2) [type=submit]").await;
        page.until("document.querySelector('#panel-scene [name=time]').value === '2030-06-01T12:00:00Z'").await;
        page.click("#grid-equatorial").await;
        page.until("document.getElementById('grid-equatorial').checked").await;
        let scene = client.scene().await.unwrap();
        assert_eq!(scene.star_method, "tent");
        // Set the camera by numbers, and follow another client's change.
        page.click("#tab-camera").await;
        page.fill("#panel-camera [name=right_ascension]", "83.5").await;
        page.fill("#panel-camera [name=declination]", "-5.5").await;
        page.click("#panel-camera [type=submit]").await;
        wait_for_notice(page, "The camera is set").await;
        let ahead = client.camera().await.unwrap().world_from_camera * glam::DVec3::NEG_Z;
        let (ra, dec) = (ahead.y.atan2(ahead.x).to_degrees(), ahead.z.asin().to_degrees());
        assert!((ra - 83.5).abs() < 1e-4 && (dec + 5.5).abs() < 1e-4, "{ra} {dec}");
        let north = CameraUpdate { orientation: Some([0.0, 0.0, 0.0, 1.0]), ..CameraUpdate::default() };
        client.set_camera(&north).await.unwrap();
        page.until("document.getElementById('pointing').textContent.includes('declination -90.00')").await;
    })
}

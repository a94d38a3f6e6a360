//! Forms change the daemon, and never overwrite the changes of another client.

use steradian::{
    config::ViewKindSpec,
    plan::settings::StarMethod,
    service::{CameraUpdate, Client, SceneUpdate},
};

use crate::{
    Test,
    browser::{Browser, Screen, with_page},
    pictures::has_picture,
    sky::PLACE,
};

pub const TESTS: &[Test] = &[
    ("forms::bodies_are_added_changed_and_removed", bodies_are_added_changed_and_removed),
    ("forms::a_change_by_another_client_is_reported_and_kept", a_change_by_another_client_is_reported_and_kept),
    ("forms::stars_time_grids_and_camera_are_set", stars_time_grids_and_camera_are_set),
    ("forms::time_runs_and_rests_at_a_rate", time_runs_and_rests_at_a_rate),
    ("forms::snapshots_are_saved_and_loaded", snapshots_are_saved_and_loaded),
    ("forms::views_are_created_and_deleted", views_are_created_and_deleted),
    ("forms::the_place_of_the_observer_is_set", the_place_of_the_observer_is_set),
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
        // If the daemon refuses a change, the page shows its message, and the form keeps its values.
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
        // The user has seen the change of the other client, and may now overwrite it. A form that the user has not
        // touched follows the daemon.
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
        let names =
            "return [...document.querySelector('#panel-scene [name=method]').options].map(({ value }) => value)";
        let methods: Vec<&str> = StarMethod::ALL.iter().map(|method| method.name()).collect();
        assert_eq!(page.run::<Vec<String>>(names).await, methods);
        page.find("#panel-scene [name=method]").await.select_by_value("tent").await.unwrap();
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

fn time_runs_and_rests_at_a_rate() -> Result<(), String> {
    with_page(Screen::Desk, async |page, daemon| {
        let mut client = daemon.client().await;
        page.until(&has_picture("window")).await;
        page.click("#tab-scene").await;
        let begin_s = client.scene().await.unwrap().time_s;
        page.fill("#panel-scene [name=time_rate]", "1200").await;
        page.click("#panel-scene form:nth-of-type(2) [type=submit]").await;
        page.until("document.getElementById('play').textContent === 'Pause'").await;
        // The displayed time advances.
        page.until("document.querySelector('#panel-scene [name=time]').value > '2026-01-01T00:20:00Z'").await;
        let running = client.scene().await.unwrap();
        assert!(running.time_rate == 1200.0 && running.time_s > begin_s + 1000.0, "{running:?}");
        page.click("#play").await;
        page.until("document.getElementById('play').textContent === 'Play'").await;
        let rests = client.scene().await.unwrap();
        assert!(rests.time_rate == 0.0 && rests.time_s > running.time_s);
        page.click("#play").await;
        page.until("document.getElementById('play').textContent === 'Pause'").await;
        assert_eq!(client.scene().await.unwrap().time_rate, 1200.0, "the time continues at the previous rate");
    })
}

fn snapshots_are_saved_and_loaded() -> Result<(), String> {
    with_page(Screen::Desk, async |page, daemon| {
        page.until(&has_picture("window")).await;
        page.click("#tab-scene").await;
        page.until("document.getElementById('snapshots').textContent.includes('keeps no state')").await;
        daemon.restart_with("[server]\nstate = 'state.redb'");
        page.until("document.getElementById('snapshots').textContent.includes('None.')").await;
        let mut client = daemon.client().await;
        page.fill("#panel-scene [name=snapshot]", "evening").await;
        page.click("#panel-scene form:last-of-type [type=submit]").await;
        wait_for_notice(page, "Snapshot evening is saved").await;
        let before = client.scene().await.unwrap();
        client.update_scene(&SceneUpdate { magnitude_limit: Some(4.5), ..SceneUpdate::default() }, None).await.unwrap();
        page.click("#snapshots button").await;
        wait_for_notice(page, "Snapshot evening is loaded").await;
        assert_eq!(client.scene().await.unwrap().magnitude_limit, before.magnitude_limit);
        let others = page.errors_beside_restarts();
        assert!(others.is_empty(), "{others:#?}");
    })
}

fn views_are_created_and_deleted() -> Result<(), String> {
    with_page(Screen::Desk, async |page, daemon| {
        let mut client = daemon.client().await;
        page.until(&has_picture("window")).await;
        let names = async |client: &mut Client| {
            let views = client.views().await.unwrap();
            views.into_iter().map(|view| (view.name, view.kind)).collect::<Vec<_>>()
        };
        let before = names(&mut client).await;
        page.click("#tab-views").await;
        page.fill("#view-form [name=view]", "preview").await;
        page.find("#view-form [name=type]").await.select_by_value("dome_master").await.unwrap();
        page.fill("#view-form [name=width]", "96").await;
        page.fill("#view-form [name=height]", "96").await;
        page.fill("#view-form [name=fov_deg]", "400").await;
        page.click("#view-form [type=submit]").await;
        // The daemon's message names the key; the form keeps its values.
        wait_for_notice(page, "fov_deg").await;
        page.fill("#view-form [name=fov_deg]", "180").await;
        page.fill("#view-form [name=tilt_deg]", "30").await;
        page.click("#view-form [type=submit]").await;
        wait_for_notice(page, "View preview is created").await;
        let created = client.views().await.unwrap().into_iter().find(|view| view.name == "preview").unwrap();
        let ViewKindSpec::DomeMaster(dome) = created.definition.unwrap().geometry.kind else { panic!("no dome") };
        assert_eq!((dome.size, dome.fov_deg, dome.tilt_deg), ([96, 96], 180.0, 30.0));
        page.click("#views input[value=preview]").await;
        page.until(&has_picture("preview")).await;
        // If another client changes the scene first, the view is not deleted, and the list is read again.
        let other = SceneUpdate { magnitude_limit: Some(4.5), ..SceneUpdate::default() };
        page.until("document.querySelectorAll('#view-list li').length === 6").await;
        client.update_scene(&other, None).await.unwrap();
        page.click("[aria-label='Delete the view preview']").await;
        page.until(
            "/another client has changed the scene|is deleted/.test(document.getElementById('notices').textContent)",
        )
        .await;
        if names(&mut client).await != before {
            page.click("[aria-label='Delete the view preview']").await;
        }
        wait_for_notice(page, "View preview is deleted").await;
        assert_eq!(names(&mut client).await, before);
        page.until("!document.querySelector('#views input[value=preview]')").await;
    })
}

fn the_place_of_the_observer_is_set() -> Result<(), String> {
    with_page(Screen::Desk, async |page, daemon| {
        page.until(&has_picture("window")).await;
        page.click("#tab-scene").await;
        page.until("document.getElementById('place-form').textContent.includes('has no observer')").await;
        daemon.restart_at(PLACE);
        page.until("document.querySelector('#place-form [name=latitude_deg]').value === '48.14'").await;
        let mut client = daemon.client().await;
        page.fill("#place-form [name=latitude_deg]", "-91").await;
        page.click("#place-form [type=submit]").await;
        wait_for_notice(page, "latitude_deg").await;
        page.fill("#place-form [name=latitude_deg]", "-33.86").await;
        page.fill("#place-form [name=longitude_deg]", "151.21").await;
        page.fill("#place-form [name=height_m]", "58").await;
        page.click("#place-form [type=submit]").await;
        wait_for_notice(page, "The place is set").await;
        let place = client.scene().await.unwrap().observer;
        assert_eq!((place.latitude_deg, place.longitude_deg, place.height_m), (Some(-33.86), Some(151.21), Some(58.0)));
        page.until("document.getElementById('observer').textContent.includes('33.8600° S, 151.2100° E, 58 m')").await;
        let others = page.errors_beside_restarts();
        assert!(others.is_empty(), "{others:#?}");
    })
}

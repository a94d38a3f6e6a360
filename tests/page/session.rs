//! A daemon that stops and starts again.

use fantoccini::key::Key;
use steradian::service::{CameraUpdate, Lease, digest_of};

use crate::{
    Test,
    browser::{Screen, with_page},
    pictures::has_picture,
};

pub const TESTS: &[Test] = &[
    ("session::a_daemon_that_was_killed_is_told_and_found_again", a_killed_daemon),
    ("session::a_daemon_that_asks_for_a_token_gets_it", a_token),
    ("session::a_daemon_that_is_stopped_is_reported_until_it_goes_on", a_frozen_daemon),
    ("session::without_the_lease_a_drag_moves_nothing_and_names_the_holder", another_client_steers),
];

/// With this token, the page has only the `view` role.
fn a_token() -> Result<(), String> {
    with_page(Screen::Desk, async |page, daemon| {
        page.until(&has_picture("window")).await;
        assert!(!page.find("#login").await.is_displayed().await.unwrap());
        let digest: String = digest_of("look").iter().map(|byte| format!("{byte:02x}")).collect();
        daemon.restart_with(&format!("[[server.tokens]]\nname = 'screen'\nrole = 'view'\nsha256 = '{digest}'\n"));
        let enter = async |token: &str| {
            page.until("!document.getElementById('login').hidden").await;
            page.find("#login-token").await.send_keys(&format!("{token}{}", char::from(Key::Enter))).await.unwrap();
        };
        enter("wrong").await;
        page.until("document.getElementById('login-why').textContent.includes('no longer valid')").await;
        enter("look").await;
        page.until("document.getElementById('age').textContent.startsWith('picture')").await;
        let frame = page.run::<String>(&format!("return {}", has_picture("window"))).await;
        page.until(&format!("{} !== '{frame}'", has_picture("window"))).await;
        // The `view` role cannot steer.
        page.until("[...document.querySelectorAll('.hold')].every(button => button.disabled)").await;
        assert!(page.find("#may-not-steer").await.is_displayed().await.unwrap());
        page.drag(Screen::Desk, [600.0, 400.0], [660.0, 420.0]).await;
        page.until("document.getElementById('notices').textContent.includes('view role may not steer')").await;
        // Other refused actions are reported.
        page.click("#tab-scene").await;
        page.click("#play").await;
        page.until("document.getElementById('notices').textContent.includes('`screen` has the role view')").await;
        page.find("#logout").await.click().await.unwrap();
        page.until("!document.getElementById('login').hidden").await;
        // When a page logs in for the first time, it does not report that the daemon is back.
        enter("look").await;
        page.until("document.getElementById('age').textContent.startsWith('picture')").await;
        assert!(!page.run::<String>("return document.getElementById('notices').textContent").await.contains("is back"));
        let others = page.errors_beside_restarts();
        assert!(others.is_empty(), "{others:#?}");
    })
}

/// Two clients steer. While the other one holds the lease, the page follows it and shows its name; after the release, the page steers.
fn another_client_steers() -> Result<(), String> {
    with_page(Screen::Desk, async |page, daemon| {
        page.until(&has_picture("window")).await;
        let mut client = daemon.client().await;
        let mut steering = client.steer(Lease::Take, "flight desk").await.unwrap();
        assert!(steering.send(&CameraUpdate { position_m: Some([5.0, 0.0, 0.0]), ..CameraUpdate::default() }).await);
        page.until("document.querySelector('[data-view=window]').dataset.camera === '1'").await;
        page.drag(Screen::Desk, [600.0, 400.0], [660.0, 420.0]).await;
        page.until(
            "document.getElementById('notices').textContent.includes('`flight desk` holds the lease of the camera')",
        )
        .await;
        let notices = page.run::<String>("return document.getElementById('notices').textContent").await;
        assert!(!notices.contains("StreamCamera"), "a page cannot make this call, so it must not name it: {notices}");
        let (camera, poses) = steering.end().await.unwrap();
        assert_eq!(
            (camera.position_m.x, camera.revision, poses),
            (5.0, 1, 1),
            "only the lease holder must have moved the camera"
        );
        page.drag(Screen::Desk, [600.0, 400.0], [660.0, 420.0]).await;
        page.until("Number(document.querySelector('[data-view=window]').dataset.camera) > 1").await;
        let after = client.camera().await.unwrap();
        assert_eq!(after.position_m.x, 5.0, "steering continues from the holder's last pose");
        assert!(after.world_from_camera.angle_between(camera.world_from_camera) > 1e-3);
    })
}

/// The daemon is stopped by a signal, so its connections stay open.
fn a_frozen_daemon() -> Result<(), String> {
    with_page(Screen::Desk, async |page, daemon| {
        page.until(&has_picture("window")).await;
        page.until("document.querySelector('figcaption').textContent.includes('frames/s')").await;
        daemon.signal("STOP");
        page.until("!document.getElementById('banner').hidden").await;
        let text = page.find("#banner").await.text().await.unwrap();
        assert!(
            text.contains("No answer from the daemon") && text.contains("Pictures and figures are from before"),
            "{text}"
        );
        page.until("document.getElementById('age').classList.contains('old')").await;
        page.until("document.querySelector('figcaption').textContent.includes('no new picture')").await;
        let caption = page.run::<String>("return document.querySelector('figcaption').textContent").await;
        assert!(!caption.contains("frames/s"), "{caption}");
        daemon.signal("CONT");
        page.until("document.getElementById('banner').hidden").await;
        page.until("document.querySelector('figcaption').textContent.includes('frames/s')").await;
        let others = page.errors_beside_connections();
        assert!(others.is_empty(), "{others:#?}");
    })
}

fn a_killed_daemon() -> Result<(), String> {
    with_page(Screen::Desk, async |page, daemon| {
        page.until(&has_picture("window")).await;
        assert!(!page.find("#banner").await.is_displayed().await.unwrap());
        assert_eq!(page.errors(), [""; 0]);
        daemon.kill();
        page.until("!document.getElementById('banner').hidden").await;
        let text = page.find("#banner").await.text().await.unwrap();
        assert!(text.contains("No connection to the daemon") && text.contains(&daemon.address), "{text}");
        // The displayed picture is marked as outdated.
        page.until("document.getElementById('age').textContent === 'no connection'").await;
        page.until("getComputedStyle(document.getElementById('pictures')).opacity < 0.5").await;
        daemon.restart();
        page.until("document.getElementById('banner').hidden").await;
        page.until("document.getElementById('age').textContent.startsWith('picture')").await;
        let frame = page.run::<String>(&format!("return {}", has_picture("window"))).await;
        page.until(&format!("{} !== '{frame}'", has_picture("window"))).await;
        let (_, codes) = page.brightest("[data-view=window] canvas", None).await;
        assert!(codes > 200, "black: {codes}");
        let others = page.errors_beside_restarts();
        assert!(others.is_empty(), "{others:#?}");
    })
}

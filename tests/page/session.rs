//! A daemon that goes away and comes back.

use crate::{
    Test,
    browser::{Screen, with_page},
    pictures::has_picture,
};

pub const TESTS: &[Test] = &[("session::a_daemon_that_was_killed_is_told_and_found_again", a_killed_daemon)];

fn a_killed_daemon() -> Result<(), String> {
    with_page(Screen::Desk, async |page, daemon| {
        page.until(&has_picture("window")).await;
        assert!(!page.find("#banner").await.is_displayed().await.unwrap());
        assert_eq!(page.errors(), [""; 0]);
        daemon.kill();
        page.until("!document.getElementById('banner').hidden").await;
        let told = page.find("#banner").await.text().await.unwrap();
        assert!(told.contains("No connection to the daemon") && told.contains(&daemon.address), "{told}");
        // What is on the screen is marked as from before.
        page.until("document.getElementById('age').textContent === 'no connection'").await;
        page.until("getComputedStyle(document.getElementById('pictures')).opacity < 0.5").await;
        daemon.restart();
        page.until("document.getElementById('banner').hidden").await;
        page.until("document.getElementById('age').textContent.startsWith('picture')").await;
        let frame = page.run::<String>(&format!("return {}", has_picture("window"))).await;
        page.until(&format!("{} !== '{frame}'", has_picture("window"))).await;
        let (_, codes) = page.brightest("[data-view=window] canvas", None).await;
        assert!(codes > 200, "black: {codes}");
        // The browser itself logs every connection that has failed. Other errors it must not have.
        let others: Vec<String> = page.errors().into_iter().filter(|error| !error.contains("net::ERR_")).collect();
        assert!(others.is_empty(), "{others:#?}");
    })
}

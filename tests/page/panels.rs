//! Tests panels that display data, and the use of the page by keyboard only.

use std::time::Duration;

use fantoccini::{
    actions::{InputSource, KeyAction, KeyActions},
    key::Key,
};

use crate::{
    Test,
    browser::{Browser, Screen, with_page},
    pictures::has_picture,
};

pub const TESTS: &[Test] = &[
    ("panels::everything_can_be_done_by_keyboard", everything_can_be_done_by_keyboard),
    ("panels::statistics_are_plotted_and_checks_have_results", statistics_and_checks),
];

/// Presses Tab until an expression is true for the focused element.
async fn tab_to(page: &Browser, what: &str) {
    for _ in 0..40 {
        page.press(&Key::Tab).await;
        if page.run::<bool>(&format!("const at = document.activeElement; return Boolean({what})")).await {
            // The focus is visible on the element or, for a hidden box, on its label.
            let seen = "const at = document.activeElement; return [at, at.nextElementSibling].some(e => e && \
                        getComputedStyle(e).outlineStyle !== 'none' && getComputedStyle(e).opacity > 0)";
            assert!(page.run::<bool>(seen).await, "the focus is not visible on {what}");
            return;
        }
    }
    panic!("Tab does not reach {what}");
}

fn everything_can_be_done_by_keyboard() -> Result<(), String> {
    with_page(Screen::Desk, async |page, daemon| {
        let mut client = daemon.client().await;
        page.until(&has_picture("window")).await;
        // Select a second view with the space bar.
        tab_to(page, "at.value === 'dome'").await;
        page.press(" ").await;
        page.until(&has_picture("dome")).await;
        // Turn and fly while the picture has the focus.
        tab_to(page, "at.tagName === 'CANVAS'").await;
        let before = client.camera().await.unwrap();
        for key in [char::from(Key::Right), 'w'] {
            hold(page, key).await;
        }
        // The last poses may still be in transit.
        let mut after = client.camera().await.unwrap();
        for _ in 0..100 {
            if after.position_m != before.position_m {
                break;
            }
            tokio::time::sleep(Duration::from_millis(100)).await;
            after = client.camera().await.unwrap();
        }
        assert!(
            after.world_from_camera.angle_between(before.world_from_camera) > 1e-4,
            "the right arrow does not turn"
        );
        assert!(after.position_m.distance(before.position_m) > 0.0, "W does not fly");
        // Switch panels with the arrow keys; the active panel is next in tab order.
        tab_to(page, "at.getAttribute('role') === 'tab'").await;
        page.press(&Key::Right).await;
        page.until("document.activeElement.id === 'tab-exposure' && !document.getElementById('panel-exposure').hidden")
            .await;
        // Enter submits the form.
        tab_to(page, "at.name === 'limiting_magnitude'").await;
        page.press(&format!("{}5.25{}", select_all(), Key::Enter)).await;
        page.until("document.getElementById('notices').textContent.includes('is set')").await;
        let views = client.views().await.unwrap();
        assert_eq!(views[0].exposure.limiting_magnitude, Some(5.25));
        // Every control has an accessible name.
        let nameless = "return [...document.querySelectorAll('button, input, select, canvas')].filter(e => !(e.ariaLabel || \
                        e.textContent.trim() || [...(e.labels ?? [])].some(l => l.textContent.trim()))).map(e => e.outerHTML)";
        assert_eq!(page.run::<Vec<String>>(nameless).await, [""; 0]);
    })
}

fn select_all() -> String {
    format!("{}a{}", Key::Control, Key::Null)
}

/// Holds a key until the picture shows another pose.
async fn hold(page: &Browser, key: char) {
    let camera = "Number(document.querySelector('[data-view=window]').dataset.camera)";
    let before = page.run::<u64>(&format!("return {camera}")).await;
    let down = KeyActions::new("keyboard".to_owned()).then(KeyAction::Down { value: key });
    page.client.perform_actions(down).await.unwrap();
    page.until(&format!("{camera} > {before}")).await;
    page.client.release_actions().await.unwrap();
}

fn statistics_and_checks() -> Result<(), String> {
    with_page(Screen::Desk, async |page, _| {
        page.until(&has_picture("window")).await;
        page.click("#tab-statistics").await;
        page.until("document.querySelector('.plot polyline')?.getAttribute('points').split(' ').length > 2").await;
        page.until("document.querySelector('#panel-statistics dl').textContent.includes('Adapter')").await;
        page.click("#tab-checks").await;
        page.fill("#panel-checks [name=filter]", "two-colours").await;
        page.click("#panel-checks [type=submit]").await;
        page.until("document.getElementById('checks-sum').textContent.includes('Done')").await;
        assert_eq!(page.find("#panel-checks tbody .outcome").await.text().await.unwrap(), "pass");
        // For an unknown name, the page shows the daemon's message.
        page.fill("#panel-checks [name=filter]", "no-such-check").await;
        page.click("#panel-checks [type=submit]").await;
        page.until("document.getElementById('notices').textContent.includes('no-such-check')").await;
        page.click("#tab-headset").await;
        page.until("document.getElementById('panel-headset').textContent.includes('drives no headset')").await;
        // Red light only.
        page.click("#night").await;
        assert_eq!(page.find("#night").await.attr("aria-pressed").await.unwrap().as_deref(), Some("true"));
        page.client.refresh().await.unwrap();
        page.until("document.documentElement.classList.contains('night')").await;
    })
}

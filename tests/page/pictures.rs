//! Pictures: their content, and turning the camera by dragging them with mouse or finger.

use steradian::{catalogue::bright::named_bright_stars, config::ViewSpec, service::ViewUpdate};

use crate::{
    Test,
    browser::{Browser, Screen, with_page},
};

pub const TESTS: &[Test] = &[
    ("pictures::a_dragged_star_stays_under_the_pointer_in_every_view", a_dragged_star_stays_under_the_pointer),
    ("pictures::a_click_names_the_star", a_click_names_the_star),
    ("pictures::several_views_are_shown_at_once_and_the_address_keeps_them", several_views_at_once),
    ("pictures::views_appear_and_disappear_as_other_clients_create_and_delete_them", views_appear_and_disappear),
    ("pictures::a_phone_shows_pictures_and_a_finger_turns_them", a_phone_and_a_finger),
    ("pictures::the_age_of_pictures_is_displayed", the_age_of_pictures_is_displayed),
    ("pictures::video_and_jpeg_show_what_png_shows", video_and_jpeg_show_what_png_shows),
    ("pictures::the_latency_from_camera_to_screen_is_displayed", latency_from_camera_to_screen),
];

/// Largest distance of a dragged star from the pointer, CSS pixels: a pixel of the picture plus the rounding of the
/// pointer's position.
const REACH_PX: f64 = 3.5;

/// Selects one view, and waits for its picture.
pub async fn choose(page: &Browser, view: &str) {
    page.run::<Option<u8>>(&format!("location.hash = '#views={view}'")).await;
    page.until(&format!("document.querySelectorAll('#pictures figure').length === 1 && {}", has_picture(view))).await;
}

/// Returns an expression that is true if the view has a picture.
pub fn has_picture(view: &str) -> String {
    format!("document.querySelector('[data-view={view}]')?.dataset.frame")
}

/// Waits until the page has sent all of its poses, and the picture shows the newest camera.
async fn settle(page: &Browser, view: &str) {
    let camera = format!("document.querySelector('[data-view={view}]').dataset.camera");
    let mut before = String::new();
    // If the camera is the same after two more frames, no pose is in transit.
    for _ in 0..100 {
        let frame = page.run::<String>(&format!("return {}", has_picture(view))).await;
        page.until(&format!("{} - {frame} >= 2", has_picture(view))).await;
        let now = page.run::<String>(&format!("return {camera}")).await;
        if now == before {
            return;
        }
        before = now;
    }
    panic!("{view}: the camera does not stop");
}

/// Drags the brightest star near the middle of the canvas by fractions of the canvas's sides, and finds it at the point
/// of release.
async fn drag_a_star(page: &Browser, screen: Screen, view: &str, canvas: &str, by: [f64; 2]) {
    settle(page, view).await;
    let [x, y, width, height] = page
        .run::<[f64; 4]>(&format!(
            "const box = document.querySelector({canvas:?}).getBoundingClientRect();
             return [box.left, box.top, box.width, box.height]"
        ))
        .await;
    let middle = [x + width / 2.0, y + height / 2.0];
    let (star, codes) = page.brightest(canvas, Some((middle, width.min(height) / 4.0))).await;
    assert!(codes > 200, "{view}: no star found; the largest sum of codes is {codes}");
    let from = star.map(f64::round);
    let to = [from[0] + (by[0] * width).round(), from[1] + (by[1] * height).round()];
    let (_, before) = page.brightest(canvas, Some((to, REACH_PX))).await;
    page.drag(screen, from, to).await;
    settle(page, view).await;
    let (found, after) = page.brightest(canvas, Some((to, 4.0 * REACH_PX))).await;
    assert!(
        after > 100,
        "{view}: the sum of codes at the target of the drag is {after}; before the drag it was {before}"
    );
    let off = (found[0] - to[0] - star[0] + from[0]).hypot(found[1] - to[1] - star[1] + from[1]);
    assert!(off < REACH_PX, "{view}: the star is {off} px from the pointer");
}

fn a_dragged_star_stays_under_the_pointer() -> Result<(), String> {
    with_page(Screen::Desk, async |page, _| {
        for (view, part) in
            [("window", ""), ("dome", ""), ("eyes", "left"), ("eyes", "right"), ("lens", ""), ("around", "")]
        {
            choose(page, view).await;
            let canvas = format!("[data-view={view}] canvas[data-part='{part}']");
            drag_a_star(page, Screen::Desk, view, &canvas, [0.11, -0.07]).await;
        }
    })
}

fn a_click_names_the_star() -> Result<(), String> {
    with_page(Screen::Desk, async |page, daemon| {
        page.until(&has_picture("window")).await;
        let revision = daemon.client().await.camera().await.unwrap().revision;
        let (star, codes) = page.brightest("[data-view=window] canvas", None).await;
        assert!(codes > 200, "black: {codes}");
        page.drag(Screen::Desk, star, star).await;
        let text = "document.querySelector('#notices li')?.dataset.text ?? ''";
        page.until(text).await;
        let text = page.run::<String>(&format!("return {text}")).await;
        let names = named_bright_stars(0.0);
        let named = names.iter().find(|named| !named.name.is_empty() && text.starts_with(named.name.as_ref()));
        let named = named.unwrap_or_else(|| panic!("no star of the catalogue: {text}"));
        assert!(
            named.star.apparent_magnitude() < 1.7 && text.contains("magnitude") && text.contains("light-years"),
            "{text}"
        );
        assert_eq!(
            daemon.client().await.camera().await.unwrap().revision,
            revision,
            "a click does not move the camera"
        );
    })
}

fn several_views_at_once() -> Result<(), String> {
    with_page(Screen::Desk, async |page, daemon| {
        page.until(&has_picture("window")).await;
        page.click("#views label:nth-child(2)").await;
        page.click("#views label:nth-child(5)").await;
        for view in ["window", "dome", "around"] {
            page.until(&has_picture(view)).await;
            let (_, codes) = page.brightest(&format!("[data-view={view}] canvas"), None).await;
            assert!(codes > 200, "{view} is black: {codes}");
        }
        // If the screen shows fewer pixels, smaller images are sent.
        assert!(page.run::<u32>("return document.querySelector('[data-view=around] canvas').width").await < 1024);
        assert_eq!(page.client.current_url().await.unwrap().fragment(), Some("views=window,dome,around"));
        // PNG works as well as JPEG.
        let seen = page.run::<String>(&format!("return {}", has_picture("dome"))).await;
        page.click("#encoding option[value=png]").await;
        page.until(&format!("Number({}) > {seen}", has_picture("dome"))).await;
        // The address of the page contains the selected views.
        page.client.refresh().await.unwrap();
        page.until(&has_picture("around")).await;
        assert_eq!(page.run::<u32>("return document.querySelectorAll('#pictures figure').length").await, 3);
        page.click("#views label:nth-child(1)").await;
        page.until("document.querySelectorAll('#pictures figure').length === 2").await;
        let stats = daemon.client().await.info().await.unwrap();
        assert!(stats.frames_rendered > 0);
    })
}

fn views_appear_and_disappear() -> Result<(), String> {
    with_page(Screen::Desk, async |page, daemon| {
        page.until(&has_picture("window")).await;
        let mut client = daemon.client().await;
        let guest = |name: &str, size: &str| {
            let spec =
                ViewSpec::from_toml(&format!("name = '{name}'\ntype = 'fisheye'\nsize = {size}\nfov_deg = 180.0"));
            spec.unwrap().0
        };
        let chip = |name: &str| format!("document.querySelector('#views input[value={name}]')");
        client.create_view(&guest("guest", "[128, 128]"), None).await.unwrap();
        page.until(&chip("guest")).await;
        page.run::<Option<u8>>("location.hash = '#views=guest,window'").await;
        page.until(&has_picture("guest")).await;
        // A new geometry changes the shape.
        let size = ViewUpdate { geometry: Some(guest("guest", "[160, 80]").geometry), ..ViewUpdate::default() };
        client.update_view("guest", &size, None).await.unwrap();
        let canvas = "document.querySelector('[data-view=guest] canvas')";
        page.until(&format!("{canvas}.width === 2 * {canvas}.height")).await;
        page.until(&format!("{canvas}.style.getPropertyValue('--aspect') === '2'")).await;
        client.delete_view("guest", None).await.unwrap();
        page.until(&format!("!document.querySelector('[data-view=guest]') && !{}", chip("guest"))).await;
        let seen = page.run::<String>(&format!("return {}", has_picture("window"))).await;
        page.until(&format!("Number({}) > {seen}", has_picture("window"))).await;
        // It is allowed to select no view.
        page.run::<Option<u8>>("location.hash = '#views='").await;
        page.until("document.querySelectorAll('#pictures figure').length === 0").await;
        client.create_view(&guest("late", "[64, 64]"), None).await.unwrap();
        page.until(&chip("late")).await;
    })
}

fn a_phone_and_a_finger() -> Result<(), String> {
    with_page(Screen::Phone, async |page, _| {
        page.until(&has_picture("window")).await;
        let [inner, scroll] = page.run::<[f64; 2]>("return [innerWidth, document.documentElement.scrollWidth]").await;
        assert!((inner - 390.0).abs() < 0.5 && scroll <= inner, "{scroll} px wide on a screen of {inner}");
        // Touch targets need space: none is lower than 32 px.
        let low = "return [...document.querySelectorAll('button, select, .chip')].filter(e => e.offsetParent && e.getBoundingClientRect().height < 32)
                   .map(e => e.textContent)";
        assert_eq!(page.run::<Vec<String>>(low).await, [""; 0]);
        drag_a_star(page, Screen::Phone, "window", "[data-view=window] canvas", [0.1, 0.08]).await;
        for panel in ["exposure", "scene", "bodies", "statistics", "checks", "headset", "camera"] {
            page.run::<Option<u8>>(&format!("document.getElementById('tab-{panel}').click()")).await;
            let scroll = page.run::<f64>("return document.documentElement.scrollWidth").await;
            assert!(scroll <= inner, "panel {panel} is {scroll} px wide on a screen of {inner}");
        }
    })
}

fn the_age_of_pictures_is_displayed() -> Result<(), String> {
    with_page(Screen::Desk, async |page, _| {
        page.until("document.getElementById('age').dataset.ms").await;
        let text = page.run::<String>("return document.getElementById('age').textContent").await;
        assert!(text.starts_with("picture ") && text.contains(" old"), "{text}");
        let age_ms = page.run::<f64>("return Number(document.getElementById('age').dataset.ms)").await;
        // Page and daemon use the clock of the same machine. The age itself is not tested, but an offset of minutes
        // would be wrong.
        assert!((-1000.0..60_000.0).contains(&age_ms), "{age_ms} ms");
        drag_a_star(page, Screen::Desk, "window", "[data-view=window] canvas", [0.1, 0.0]).await;
        page.until("document.getElementById('age').textContent.includes('camera to screen')").await;
        page.click("#tab-statistics").await;
        page.until("document.getElementById('panel-statistics').textContent.includes('Camera to screen, last')").await;
    })
}

/// Selects an encoding, and waits for a picture in it.
async fn encode(page: &Browser, encoding: &str) {
    page.click(&format!("#encoding option[value={encoding}]")).await;
    let encoding_of_view = "document.querySelector('[data-view=window]')?.dataset.encoding";
    page.until(&format!("{encoding_of_view} === '{}'", encoding.to_uppercase())).await;
}

/// Returns the pixels of the view's canvas: R, G, B, A.
async fn pixels(page: &Browser) -> Vec<u8> {
    page.run::<Vec<u8>>(
        "const canvas = document.querySelector('[data-view=window] canvas');
         return [...canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data]",
    )
    .await
}

/// Returns root mean squares over the pixels of stars: of luma, of R - B, and of the errors of these two.
fn errors(exact: &[u8], found: &[u8]) -> [f64; 4] {
    assert_eq!(exact.len(), found.len());
    let luma = |pixel: &[u8]| pixel.iter().zip([0.2126, 0.7152, 0.0722]).map(|(c, w)| f64::from(*c) * w).sum::<f64>();
    let colour = |pixel: &[u8]| f64::from(pixel[0]) - f64::from(pixel[2]);
    let pairs = exact.chunks_exact(4).zip(found.chunks_exact(4)).filter(|(exact, _)| luma(exact) > 60.0);
    let (mut sums, mut count) = ([0.0; 4], 0.0);
    for (exact, found) in pairs {
        let values =
            [luma(exact), colour(exact), luma(found) - luma(exact), colour(found) - colour(exact)].map(|v| v * v);
        sums = [0, 1, 2, 3].map(|at| sums[at] + values[at]);
        count += 1.0;
    }
    sums.map(|sum: f64| (sum / count).sqrt())
}

fn video_and_jpeg_show_what_png_shows() -> Result<(), String> {
    with_page(Screen::Desk, async |page, _| {
        page.until(&has_picture("window")).await;
        // If the browser has a decoder, video is the default.
        let first = page.run::<String>("return document.querySelector('[data-view=window]').dataset.encoding").await;
        assert_eq!(first, "H264");
        settle(page, "window").await;
        let video = pixels(page).await;
        encode(page, "png").await;
        let exact = pixels(page).await;
        encode(page, "jpeg").await;
        let jpeg = pixels(page).await;
        for (encoding, found, most) in [("H264", &video, [0.06, 0.6]), ("JPEG", &jpeg, [0.1, 0.2])] {
            let [luma, colour, luma_off, colour_off] = errors(&exact, found);
            println!("{encoding}: luma {luma:.1}, error {luma_off:.2}; R - B {colour:.1}, error {colour_off:.2}");
            assert!(luma_off < most[0] * luma && colour_off < most[1] * colour, "{encoding}");
        }
        // The comparison must fail for a different picture.
        let other: Vec<u8> = exact.iter().rev().copied().collect();
        let [luma, _, luma_off, _] = errors(&exact, &other);
        assert!(video != exact && luma_off > 0.5 * luma);
    })
}

fn latency_from_camera_to_screen() -> Result<(), String> {
    with_page(Screen::Desk, async |page, _| {
        page.until(&has_picture("window")).await;
        page.click("#tab-statistics").await;
        for encoding in ["h264", "jpeg"] {
            encode(page, encoding).await;
            for turn in 0..6 {
                let to = [700.0 - 40.0 * f64::from(turn % 2), 400.0];
                page.drag(Screen::Desk, [660.0 + 40.0 * f64::from(turn % 2), 420.0], to).await;
            }
            settle(page, "window").await;
            let rows = "[...document.querySelectorAll('#panel-statistics dt')].filter(e => /Camera to screen|of it to|coded and|decoded and/.test(e.textContent))";
            page.until(&format!("{rows}.length === 4")).await;
            let text = page
                .run::<Vec<String>>(&format!(
                    "return {rows}.map(e => e.textContent + ': ' + e.nextSibling.textContent)"
                ))
                .await;
            println!("{encoding}: {text:?}");
            assert!(text.iter().all(|row| row.contains("median") && !row.contains("NaN")), "{text:?}");
        }
    })
}

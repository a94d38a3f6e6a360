//! Small pictures of a dome: the sky in a preview is as bright as in the full picture.

use std::path::Path;

use steradian::{
    config::ViewSpec,
    service::{
        Client,
        proto::{
            Encoding, Image, NextFrameRequest, RenderFrameRequest, StreamFramesRequest,
            view_service_client::ViewServiceClient,
        },
    },
};

use crate::daemon::Daemon;

/// Side of the large dome and of the small ones, pixels.
const SIDES: [u32; 2] = [1024, 128];
/// Side of a pixel of the large dome, arcminutes.
const LARGE_PIXEL_ARCMIN: f64 = 54.47 * 180.0 / 1024.0;

/// Starts a daemon with a dome of `size` pixels, which shows the night sky over Frankfurt.
fn dome(folder: &Path, side: u32, reference_arcmin: f64) -> Daemon {
    let set = [
        "scene.time=2026-11-10T18:00:00Z".to_owned(),
        "scene.observer={ latitude_deg = 50.11, longitude_deg = 8.68, azimuth_deg = 180.0 }".to_owned(),
        format!("views=[{{ name = 'dome', type = 'dome_master', size = [{side}, {side}] }}]"),
        format!("exposure.reference_pixel_arcmin={reference_arcmin}"),
    ];
    let arguments: Vec<&str> = set.iter().flat_map(|set| ["--set", set]).collect();
    Daemon::start_with(folder, "builtin:bright", &arguments)
}

/// Returns the median of the codes of G within a third of the radius.
fn sky_code(images: &[Image], side: u32) -> u8 {
    let image = &images[0];
    assert_eq!([image.width, image.height], [side; 2]);
    let half = f64::from(side) / 2.0;
    let near = image.data.chunks_exact(4).enumerate().filter(|(index, _)| {
        let [x, y] = [index % side as usize, index / side as usize].map(|pixel| pixel as f64 + 0.5 - half);
        x.hypot(y) < half / 3.0
    });
    let mut green: Vec<u8> = near.map(|(_, pixel)| pixel[1]).collect();
    green.sort_unstable();
    green[green.len() / 2]
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn previews_of_a_dome_have_its_sky() {
    let folder = tempfile::tempdir().unwrap();
    let [large, small] = SIDES;
    let mut daemon = dome(folder.path(), large, 0.0);
    let address = format!("http://{}", daemon.address());
    let mut views = ViewServiceClient::connect(address.clone()).await.unwrap().max_decoding_message_size(16 << 20);
    let encoding = i32::from(Encoding::Rgba8);
    let rendered = async |views: &mut ViewServiceClient<_>, view: &str, max_size: u32| {
        let request = RenderFrameRequest { view: view.to_owned(), encoding, max_size };
        views.render_frame(request).await.unwrap().into_inner().images
    };
    let whole = sky_code(&rendered(&mut views, "dome", 0).await, large);
    let view = || "dome".to_owned();
    let next = NextFrameRequest { view: view(), encoding, max_size: small, ..NextFrameRequest::default() };
    let stream = StreamFramesRequest { view: view(), encoding, max_size: small, ..StreamFramesRequest::default() };
    let mut streamed = views.stream_frames(stream).await.unwrap().into_inner();
    let mut previews = vec![
        ("RenderFrame", rendered(&mut views, "dome", small).await),
        ("NextFrame", views.next_frame(next).await.unwrap().into_inner().images),
        ("StreamFrames", streamed.message().await.unwrap().unwrap().images),
    ];
    // A smaller view that a client creates shares the exposure of the first view.
    let spec = ViewSpec::from_toml(&format!("name = 'small'\ntype = 'dome_master'\nsize = [{small}, {small}]"));
    Client::connect(&address).await.unwrap().create_view(&spec.unwrap().0, None).await.unwrap();
    previews.push(("CreateView", rendered(&mut views, "small", 0).await));
    for (call, images) in previews {
        let code = sky_code(&images, small);
        println!("{call}: {code} in {small} pixels, {whole} in {large}");
        assert!(code.abs_diff(whole) <= 2, "{call}: {code}, not {whole}");
    }
    drop((streamed, views, daemon));

    // For a daemon or film that has only the small dome, the sky is the same if the pixels of the large dome are the
    // reference, and differs if the dome's own pixels are.
    for (reference_arcmin, is_alike) in [(LARGE_PIXEL_ARCMIN, true), (0.0, false)] {
        let mut daemon = dome(folder.path(), small, reference_arcmin);
        let mut views = ViewServiceClient::connect(format!("http://{}", daemon.address())).await.unwrap();
        let code = sky_code(&rendered(&mut views, "dome", 0).await, small);
        println!("reference {reference_arcmin:.1} arcmin: {code}, {whole} in {large} pixels");
        assert_eq!(code.abs_diff(whole) <= 2, is_alike, "{code} and {whole}");
    }
}

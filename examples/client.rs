//! A client of the daemon: `cargo run --release --example client -- --connect http://127.0.0.1:7143 --out out`.
//!
//! Moves the camera along a short path while it reads the frames of one view, saves the last of them as PNG, then
//! requests every view as PNG and EXR, and prints a summary. Exits with 1 if anything fails.

use std::{
    error::Error,
    io::Write,
    path::{Path, PathBuf},
    process::ExitCode,
    time::{Duration, Instant},
};

use clap::Parser;
use steradian::{
    output::Encoding,
    scene::Camera,
    service::{CameraUpdate, Client, ClientError, FrameReceiver, ReceivedFrame},
};
use tokio::{sync::oneshot, task::JoinHandle, time::timeout};

/// Longest wait for a frame with a new pose.
const PATIENCE: Duration = Duration::from_secs(60);
/// Number of streamed frames to save.
const KEPT_FRAMES: usize = 3;

/// Moves the camera of a running daemon and saves pictures.
#[derive(Debug, Parser)]
struct Arguments {
    /// Address of the daemon, for example http://127.0.0.1:7143.
    #[arg(long)]
    connect: String,
    /// Folder for the pictures; created if it does not exist.
    #[arg(long)]
    out: PathBuf,
    /// View whose frames are streamed. Default: the first one.
    #[arg(long)]
    stream: Option<String>,
    /// Number of poses along the path.
    #[arg(long, default_value_t = 24, value_parser = clap::value_parser!(u32).range(1..))]
    steps: u32,
    /// Angle by which the camera turns to the left along the path, degrees; at the end it returns to its first
    /// direction.
    #[arg(long, default_value_t = 30.0)]
    turn_deg: f64,
}

/// Frames read from the stream.
struct Streamed {
    /// Arrival time of each frame, and the revision of the camera that it shows.
    arrivals: Vec<(Instant, u64)>,
    /// The last frames.
    kept: Vec<ReceivedFrame>,
    frames: u64,
    dropped: u64,
}

/// Reads frames until one shows the camera of revision `last`.
async fn read(mut stream: FrameReceiver, last: oneshot::Receiver<u64>) -> Result<Streamed, ClientError> {
    let mut last = Box::pin(last);
    let mut wanted = None;
    let mut streamed = Streamed { arrivals: Vec::new(), kept: Vec::new(), frames: 0, dropped: 0 };
    loop {
        let frame = tokio::select! {
            // The last revision is known only at the end of the path. If its sender was dropped, reading ends.
            revision = &mut last, if wanted.is_none() => {
                let Ok(revision) = revision else { return Ok(streamed) };
                wanted = Some(revision);
                None
            }
            frame = stream.next() => match frame? {
                Some(frame) => Some(frame),
                None => return Ok(streamed),
            },
        };
        if let Some(frame) = frame {
            streamed.frames += 1;
            streamed.dropped = frame.dropped;
            streamed.arrivals.push((Instant::now(), frame.camera_revision));
            if streamed.kept.len() == KEPT_FRAMES {
                streamed.kept.remove(0);
            }
            streamed.kept.push(frame);
        }
        let newest = streamed.arrivals.last().map_or(0, |arrival| arrival.1);
        if wanted.is_some_and(|wanted| newest >= wanted) {
            return Ok(streamed);
        }
    }
}

/// Turns the camera step by step; returns the time and the revision of each pose.
async fn move_along_path(
    client: &mut Client,
    start: &Camera,
    steps: u32,
    turn_deg: f64,
) -> Result<Vec<(Instant, u64)>, ClientError> {
    let mut sent = Vec::new();
    for step in 1..=steps {
        // Turn smoothly there and back: the share of the turn is sin(pi t), which is 0 at both ends.
        let share = (std::f64::consts::PI * f64::from(step) / f64::from(steps)).sin();
        let turn = glam::DQuat::from_rotation_y((turn_deg * share).to_radians());
        let orientation = (start.world_from_camera * turn).normalize().to_array();
        let begin = Instant::now();
        let camera =
            client.set_camera(&CameraUpdate { orientation: Some(orientation), ..CameraUpdate::default() }).await?;
        sent.push((begin, camera.revision));
        tokio::time::sleep(Duration::from_millis(40)).await;
    }
    Ok(sent)
}

fn save(folder: &Path, name: &str, frame: &ReceivedFrame, extension: &str) -> std::io::Result<()> {
    for image in &frame.images {
        let part = if image.part.is_empty() { String::new() } else { format!(".{}", image.part) };
        std::fs::write(folder.join(format!("{name}{part}.{extension}")), &image.data)?;
    }
    Ok(())
}

/// Returns the value below which a share of the sorted values lies (nearest rank).
fn percentile(sorted: &[f64], share: f64) -> f64 {
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted[rank.clamp(1, sorted.len()) - 1]
}

async fn run(arguments: Arguments) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(&arguments.out)?;
    let mut client = Client::connect(&arguments.connect).await?;
    let info = client.info().await?;
    println!("adapter     {} ({}, {})", info.adapter.adapter, info.adapter.backend, info.adapter.driver);
    println!("stars       {}", info.stars);
    let views = client.views().await?;
    for view in &views {
        let sizes: Vec<String> =
            view.images.iter().map(|image| format!("{} x {}", image.width, image.height)).collect();
        println!("view        {} ({}): {}", view.name, view.kind, sizes.join(", "));
    }
    let streamed_view = match &arguments.stream {
        Some(name) => name.clone(),
        None => views.first().ok_or("the daemon has no views")?.name.clone(),
    };

    let start = client.camera().await?;
    let stream = client.stream_frames(&streamed_view, Encoding::Png, 0.0).await?;
    let (last, is_last) = oneshot::channel();
    let reader: JoinHandle<Result<Streamed, ClientError>> = tokio::spawn(read(stream, is_last));
    let sent = move_along_path(&mut client, &start, arguments.steps, arguments.turn_deg).await?;
    let (_, newest) = *sent.last().ok_or("the path has no poses")?;
    // Ignore a failed send: if the reader has failed already, its error is reported below.
    let _ = last.send(newest);
    let streamed = timeout(PATIENCE, reader).await.map_err(|_| "the frame of the last pose did not arrive")???;
    for (index, frame) in streamed.kept.iter().enumerate() {
        save(&arguments.out, &format!("{streamed_view}.stream{index}"), frame, "png")?;
    }

    // The latency is the time from the call of SetCamera to the arrival of the first frame with its pose. Poses that
    // were skipped have no frame.
    let mut latencies_ms: Vec<f64> = Vec::new();
    for (begin, revision) in &sent {
        if let Some((here, _)) = streamed.arrivals.iter().find(|(_, shown)| shown == revision) {
            latencies_ms.push(here.duration_since(*begin).as_secs_f64() * 1e3);
        }
    }
    latencies_ms.sort_by(f64::total_cmp);
    println!("streamed    {} frames of {streamed_view}, {} dropped", streamed.frames, streamed.dropped);
    if latencies_ms.is_empty() {
        return Err("none of the streamed frames shows one of the poses".into());
    }
    println!(
        "latency     {:.1} ms median, {:.1} ms p99, from SetCamera to the PNG here ({} of {} poses had a separate frame)",
        percentile(&latencies_ms, 0.5),
        percentile(&latencies_ms, 0.99),
        latencies_ms.len(),
        sent.len(),
    );

    for view in &views {
        let begin = Instant::now();
        let frame = client.render_frame(&view.name, Encoding::Png).await?;
        let png_ms = begin.elapsed().as_secs_f64() * 1e3;
        save(&arguments.out, &view.name, &frame, "png")?;
        let begin = Instant::now();
        let luminance = client.render_frame(&view.name, Encoding::Exr).await?;
        let exr_ms = begin.elapsed().as_secs_f64() * 1e3;
        save(&arguments.out, &view.name, &luminance, "exr")?;
        println!(
            "rendered    {}: PNG in {png_ms:.1} ms, EXR in {exr_ms:.1} ms, EV {:.2}",
            view.name, frame.exposure_ev100
        );
    }
    println!("pictures    {}", arguments.out.display());
    Ok(())
}

#[tokio::main]
async fn main() -> ExitCode {
    match run(Arguments::parse()).await {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // If standard error is closed too, the exit code still reports the failure.
            match writeln!(std::io::stderr(), "error: {error}") {
                Ok(()) | Err(_) => ExitCode::FAILURE,
            }
        }
    }
}

//! Tests that windows of several nodes show the same frames, by sky stamps in all windows of one X server.

use std::time::Duration;

use steradian::service::{Client, proto::ClusterStats};
use tokio::runtime::Runtime;

use crate::{
    Test,
    desktop::{Desktop, until},
    program::{Running, Scene},
    stamps::{Line, STAR, Sample, Verdict, samples, turn},
};

pub const TESTS: &[Test] = &[
    ("cluster::stamps_find_frames_that_only_some_windows_show", mistakes_are_found),
    ("cluster::windows_of_three_nodes_show_the_same_frames", three_nodes),
    ("cluster::a_window_that_does_not_wait_for_commit_is_found", without_commit),
    ("cluster::windows_are_black_without_a_director_and_return", without_director),
    ("cluster::nodes_without_their_display_go_on", without_display),
];

/// Frames per second. A stamp is shown for far longer than a software driver and the scheduler can delay a window.
const RATE_HZ: u32 = 5;
/// Turn rate of the camera, more than ten pixels per frame.
const TURN_RAD_S: f64 = 0.25;
/// Angle after which the camera jumps back, so that the star stays in the picture.
const SWEEP_RAD: f64 = 0.9;
const WIDTH: u16 = 320;
const NODES: [&str; 3] = ["n1", "n2", "n3"];
const LINE: Line = Line { width: WIDTH, windows: 3, rows: [8, 8] };

/// Returns a configuration with a view for each window. The windows are next to each other.
fn configuration(views: &[&str], first_x: u16, rest: &str) -> String {
    let mut text = format!(
        "[scene]\ncatalogues = ['star.csv']\ntime = 2026-01-01T00:00:00Z\n[glare]\nmethod = 'none'\n\
         [exposure]\nmode = 'auto'\n{rest}"
    );
    for (index, view) in views.iter().enumerate() {
        let x = first_x + WIDTH * index as u16;
        text += &format!(
            "[[views]]\nname = 'of_{view}'\ntype = 'perspective'\nsize = [{WIDTH}, 24]\nfov_y_deg = 5.0\n\
             [[windows]]\nview = 'of_{view}'\nposition = [{x}, 0]\n"
        );
    }
    text
}

/// A director with nodes that have windows.
struct Theatre {
    scene: Scene,
    director: Running,
    nodes: Vec<Running>,
    runtime: Runtime,
}

impl Theatre {
    fn open(desktop: &Desktop, hold_s: f64) -> Self {
        let port = testkit::free_port();
        let nodes: String =
            NODES.iter().map(|node| format!("[[nodes]]\nname = '{node}'\nviews = ['of_{node}']\n")).collect();
        let cluster = format!(
            "[cluster]\nendpoints = ['tcp/127.0.0.1:{port}']\nrate_hz = {RATE_HZ}\ngather_s = 60\nhold_s = {hold_s}\n{nodes}"
        );
        let scene = Scene::new(&configuration(&NODES, 0, &cluster));
        scene.write("star.csv", STAR);
        desktop.park_pointer([1500, 850]);
        let director = scene.serve_as("director", None, &["--role", "director"]);
        let node = |node: &&str| scene.serve_as(node, Some(&desktop.display), &["--role", "node", "--node", node]);
        let nodes = NODES.iter().map(node).collect();
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let theatre = Self { scene, director, nodes, runtime };
        theatre.all_in();
        theatre
    }

    fn client(&self) -> Client {
        self.runtime.block_on(Client::connect(&format!("http://{}", self.director.address()))).unwrap()
    }

    fn stats(&self) -> ClusterStats {
        self.stats_of(self.client())
    }

    fn stats_of(&self, mut client: Client) -> ClusterStats {
        self.runtime.block_on(async {
            let mut stats = client.watch_stats(None).await.unwrap();
            stats.next().await.unwrap().unwrap().cluster.unwrap()
        })
    }

    /// Waits until the first node's statistics satisfy a condition.
    fn node_when(&self, what: &str, is_it: impl Fn(&ClusterStats) -> bool) {
        let address = format!("http://{}", self.nodes[0].address());
        let stats = || self.stats_of(self.runtime.block_on(Client::connect(&address)).unwrap());
        until(|| is_it(&stats()).then_some(()), || format!("not {what}: {:#?}", stats()));
    }

    fn all_in(&self) {
        let is_in = || {
            let stats = self.stats();
            (stats.state == "running" && stats.nodes.iter().all(|node| node.state == "in")).then_some(())
        };
        until(is_in, || format!("{:#?}\n{}\n{}", self.stats(), self.director.log(), self.nodes[0].log()));
    }

    /// Turns the camera of a daemon from now on, as a function of the time of the machine.
    fn turn(&self, client: Client) {
        // The task ends with the daemon.
        drop(self.runtime.spawn(turn(client, TURN_RAD_S, SWEEP_RAD)));
    }

    fn turn_director(&self) {
        self.turn(self.client());
    }
}

/// Makes samples, ten milliseconds apart, in which the star is in the given columns of the windows.
fn made(columns: &[[Option<f64>; 3]]) -> Vec<Sample> {
    let sample = |(index, columns): (usize, &[Option<f64>; 3])| Sample {
        at: Duration::from_millis(10 * index as u64),
        columns: columns.to_vec(),
    };
    columns.iter().enumerate().map(sample).collect()
}

fn mistakes_are_found() -> Result<(), String> {
    let all = |column: f64| [Some(column); 3];
    let good =
        made(&[all(1.0), [Some(1.0), Some(5.0), Some(1.0)], [Some(5.0), Some(5.0), Some(1.1)], all(5.0), all(9.0)]);
    let verdict = Verdict::of(&good, &[0, 1, 2]);
    assert_eq!((verdict.frames, verdict.transitions, verdict.mixed), (3, 1, 0), "{verdict:?}");
    assert_eq!((verdict.longer_than(5.0), verdict.longer_than(15.0)), (1, 0), "{verdict:?}");
    // Mistakes: a window shows a frame that the others never show; a window is late by a frame; a window stops; a
    // window is black.
    let alone = [all(1.0), [Some(1.0), Some(3.0), Some(1.0)], all(5.0)];
    let behind = [all(1.0), [Some(5.0), Some(1.0), Some(1.0)], [Some(9.0), Some(9.0), Some(5.0)], all(9.0)];
    let stays = [all(1.0), [Some(5.0), Some(5.0), Some(1.0)], [Some(9.0), Some(9.0), Some(1.0)]];
    let black = [all(1.0), [Some(1.0), Some(1.0), None], all(5.0)];
    for wrong in [&alone[..], &behind, &stays, &black] {
        assert_eq!(Verdict::of(&made(wrong), &[0, 1, 2]).mixed, 1, "{wrong:?}");
    }
    // Windows that are not compared have no effect.
    assert_eq!(Verdict::of(&made(&stays), &[0, 1]).mixed, 0);
    Ok(())
}

fn three_nodes() -> Result<(), String> {
    let desktop = Desktop::virtual_frame_buffer()?;
    let mut theatre = Theatre::open(&desktop, 60.0);
    theatre.turn_director();
    let first = |sample: &Sample| sample.columns.iter().all(Option::is_some);
    until(
        || samples(&desktop, LINE, Duration::from_millis(50)).last().is_some_and(first).then_some(()),
        || format!("no star in the windows:\n{}", theatre.nodes[0].log()),
    );
    let seen = samples(&desktop, LINE, Duration::from_secs(8));
    let verdict = Verdict::of(&seen, &[0, 1, 2]);
    assert!(verdict.frames >= 8, "{verdict:?}");
    assert_eq!(verdict.mixed, 0, "{verdict:?}");
    // A node is stopped and resumed. Meanwhile the other nodes show the same frames; afterwards this node shows no old
    // frames.
    theatre.nodes[2].signal("STOP");
    let seen = samples(&desktop, LINE, Duration::from_secs(4));
    let verdict = Verdict::of(&seen, &[0, 1]);
    assert!(verdict.frames >= 4, "{verdict:?}");
    assert_eq!(verdict.mixed, 0, "{verdict:?}");
    theatre.nodes[2].signal("CONT");
    theatre.all_in();
    let seen = samples(&desktop, LINE, Duration::from_secs(4));
    let verdict = Verdict::of(&seen, &[0, 1, 2]);
    assert!(verdict.frames >= 4, "{verdict:?}");
    assert_eq!(verdict.mixed, 0, "{verdict:?}");
    assert!(theatre.director.terminate().success(), "{}", theatre.director.log());
    Ok(())
}

fn without_commit() -> Result<(), String> {
    let desktop = Desktop::virtual_frame_buffer()?;
    let theatre = Theatre::open(&desktop, 60.0);
    // In addition to the nodes, a daemon outside of the cluster shows the same view, each frame as soon as it is drawn.
    let alone = Scene::new(&configuration(&["alone"], WIDTH * NODES.len() as u16, ""));
    alone.write("star.csv", STAR);
    let daemon = alone.serve(Some(&desktop.display));
    let client = theatre.runtime.block_on(Client::connect(&format!("http://{}", daemon.address()))).unwrap();
    theatre.turn_director();
    theatre.turn(client);
    let line = Line { windows: LINE.windows + 1, ..LINE };
    let all = |sample: &Sample| sample.columns.iter().all(Option::is_some);
    until(
        || samples(&desktop, line, Duration::from_millis(50)).last().is_some_and(all).then_some(()),
        || format!("no star in the windows:\n{}", daemon.log()),
    );
    let seen = samples(&desktop, line, Duration::from_secs(5));
    let (nodes, with_it) = (Verdict::of(&seen, &[0, 1, 2]), Verdict::of(&seen, &[0, 1, 2, 3]));
    assert_eq!(nodes.mixed, 0, "{nodes:?}");
    assert!(nodes.frames >= 5, "{nodes:?}");
    assert!(with_it.mixed > 0 || with_it.frames < nodes.frames / 2, "{with_it:?}");
    Ok(())
}

fn without_director() -> Result<(), String> {
    let desktop = Desktop::virtual_frame_buffer()?;
    let mut theatre = Theatre::open(&desktop, 1.0);
    let columns = || samples(&desktop, LINE, Duration::from_millis(20)).pop().unwrap().columns;
    let shows = |is_there: bool, what: &str| {
        until(
            || columns().iter().all(|column| column.is_some() == is_there).then_some(()),
            || format!("{what}: {:?}\n{}", columns(), theatre.nodes[0].log()),
        );
    };
    shows(true, "no star");
    theatre.director.kill();
    shows(false, "not black");
    theatre.node_when("black", |stats| stats.counts["black"] >= 1);
    theatre.director = theatre.scene.serve_as("director2", None, &["--role", "director"]);
    theatre.all_in();
    shows(true, "black for ever");
    Ok(())
}

fn without_display() -> Result<(), String> {
    let desktop = Desktop::virtual_frame_buffer()?;
    let theatre = Theatre::open(&desktop, 60.0);
    drop(desktop);
    // Frames that are waiting for the windows do not block the nodes, so clients still get frames.
    for node in &theatre.nodes {
        node.wait_for_log("panicked");
    }
    theatre.all_in();
    let committed = theatre.stats().counts["committed"];
    until(
        || (theatre.stats().counts["committed"] >= committed + 10).then_some(()),
        || format!("no frames: {:#?}\n{}", theatre.stats(), theatre.nodes[0].log()),
    );
    Ok(())
}

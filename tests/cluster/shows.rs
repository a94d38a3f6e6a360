//! A show continues although nodes and directors are killed and restarted, and when a second director starts.

use std::{collections::HashMap, path::Path, process::Command};

use steradian::{
    output::Encoding,
    service::{CameraUpdate, Client, ReceivedFrame},
};
use testkit::free_port;

use crate::processes::{PATIENCE, Process, configuration};

const NODES: [&str; 2] = ["left", "right"];

fn endpoint() -> String {
    format!("tcp/127.0.0.1:{}", free_port())
}

/// Receives frames of a view; returns them by their numbers.
async fn frames(client: &mut Client, view: &str, count: usize) -> HashMap<u64, ReceivedFrame> {
    let mut stream = client.stream_frames(view, Encoding::Rgba8, 0.0).await.unwrap();
    let mut all = HashMap::new();
    while all.len() < count {
        let frame = stream.next().await.unwrap().unwrap();
        all.insert(frame.number, frame);
    }
    all
}

fn pixels(frame: &ReceivedFrame) -> &[u8] {
    &frame.images[0].data
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nodes_show_the_same_frames_through_kills_and_restarts_of_nodes_and_director() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    configuration(folder, &NODES, &[endpoint()], "");
    let director = Process::director(folder);
    let [left, right] = NODES.map(|name| Process::node(folder, name));
    let stats = director.all_in().await;
    assert!(stats.nodes.iter().all(|node| node.scene_hash == stats.scene_hash), "{stats:#?}");
    assert_eq!(stats.counts["refused"], 0);

    // Both nodes show the same frame numbers.
    let (mut of_left, mut of_right) = (left.client().await, right.client().await);
    let (seen_left, seen_right) =
        tokio::join!(frames(&mut of_left, "of_left", 12), frames(&mut of_right, "of_right", 12));
    let common = seen_left.keys().filter(|number| seen_right.contains_key(number)).count();
    assert!(common >= 6, "{:?} {:?}", seen_left.keys(), seen_right.keys());

    // A node's picture is byte-equal to that of a single daemon for the same view. The light and the exposure are equal too.
    let alone = Process::spawn(folder, "cluster.toml", &[]);
    for (view, seen, node) in [("of_left", &seen_left, &mut of_left), ("of_right", &seen_right, &mut of_right)] {
        let picture = alone.client().await.render_frame(view, Encoding::Rgba8).await.unwrap();
        assert!(seen.values().all(|frame| pixels(frame) == pixels(&picture)), "{view} differs");
        assert!(pixels(&picture).chunks(4).any(|pixel| pixel[..3] != [0; 3]), "{view} is empty");
        let exposure = picture.exposure_ev100.to_bits();
        assert!(seen.values().all(|frame| frame.exposure_ev100.to_bits() == exposure), "{view}: exposure");
        let light = alone.client().await.render_frame(view, Encoding::Rgb32f).await.unwrap();
        let of_node = node.render_frame(view, Encoding::Rgb32f).await.unwrap();
        assert!(pixels(&of_node) == pixels(&light) && of_node.exposure_ev100.to_bits() == exposure, "{view}: light");
    }
    drop(alone);

    // Nodes refuse changes. A change sent to the director arrives at the nodes.
    let turned = CameraUpdate { orientation: Some([0.0, 1.0, 0.0, 0.0]), ..CameraUpdate::default() };
    let refused = of_left.set_camera(&turned).await.unwrap_err().to_string();
    assert!(refused.contains(&director.address) || refused.contains("director"), "{refused}");
    director.client().await.set_camera(&turned).await.unwrap();
    let before = seen_left.values().next().unwrap();
    let mut stream = of_left.stream_frames("of_left", Encoding::Rgba8, 0.0).await.unwrap();
    while pixels(&stream.next().await.unwrap().unwrap()) == pixels(before) {}
    let elsewhere = of_left.render_frame("of_right", Encoding::Rgba8).await.unwrap_err().to_string();
    assert!(elsewhere.contains("left"), "{elsewhere}");

    // A killed node is left out. The remaining one of two nodes is not a majority, so it holds its picture.
    left.kill();
    director.stats_when("left out", |cluster| cluster.nodes[0].state == "absent").await;
    director.stats_when("without majority", |cluster| cluster.counts["skipped_quorum"] > 2).await;
    // After a restart, the node takes part again, with the scene of the director.
    let left = Process::node(folder, "left");
    let stats = director.all_in().await;
    assert!(stats.nodes.iter().all(|node| node.scene_hash == stats.scene_hash), "{stats:#?}");
    assert!(stats.nodes[0].out >= 1, "{stats:#?}");
    director.advances(5).await;

    // Without a director the nodes hold their pictures; another director takes a higher epoch and leads them.
    let epoch = stats.epoch;
    director.kill();
    left.stats_when("looking", |cluster| cluster.state == "looking").await;
    let director = Process::director(folder);
    let stats = director.all_in().await;
    assert!(stats.epoch > epoch);
    director.advances(5).await;
    right.stats_when("led", |cluster| cluster.state == "led" && cluster.epoch == stats.epoch).await;
}

/// Runs `cluster check`, which waits for at most `wait` seconds. Returns its output, and whether it reports that everything is in order.
fn checked(folder: &Path, address: &str, wait: &str) -> (String, bool) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_steradian"));
    command.args(["cluster", "check", "--config", "cluster.toml", "--connect", address, "--wait", wait]);
    command.current_dir(folder);
    let output = command.output().unwrap();
    (String::from_utf8(output.stdout).unwrap(), output.status.success())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_check_finds_an_absent_node_and_a_director_that_does_not_answer() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    configuration(folder, &NODES, &[endpoint()], "");
    let director = Process::director(folder);
    let left = Process::node(folder, "left");
    let (text, is_fine) = checked(folder, &director.address, "2");
    assert!(!is_fine && text.contains("WRONG node right: absent"), "{text}");
    let right = Process::node(folder, "right");
    for address in [director.address.clone(), format!("http://{}", director.address.trim_start_matches("http://"))] {
        let (text, is_fine) = checked(folder, &address, "60");
        assert!(is_fine && text.contains("ok    node right: in"), "{text}");
        assert!(text.contains("clock of this machine"), "{text}");
    }
    // No process listens at the address, so no node is queried, and the output must not report nodes as in order.
    let (text, is_fine) = checked(folder, &format!("127.0.0.1:{}", free_port()), "0.5");
    assert!(!is_fine && text.contains("WRONG director at 127.0.0.1:"), "{text}");
    let (text, is_fine) = checked(folder, "unix:none.socket", "0");
    assert!(!is_fine && text.contains("WRONG director at unix:none.socket"), "{text}");
    drop((left, right));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn of_two_directors_one_leads() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let endpoints = [endpoint(), endpoint()];
    configuration(folder, &NODES, &endpoints, "");
    let first = Process::spawn(folder, "cluster.toml", &["--role", "director", "--endpoint", &endpoints[0]]);
    let _nodes = NODES.map(|name| Process::node(folder, name));
    first.all_in().await;
    let second = Process::spawn(folder, "cluster.toml", &["--role", "director", "--endpoint", &endpoints[1]]);
    // The second one gathers all nodes and takes a higher epoch, which ends the first one.
    second.all_in().await;
    first.stats_when("deposed", |cluster| cluster.state == "deposed").await;
    let committed = first.stats_when("deposed", |_| true).await.counts["committed"];
    second.advances(10).await;
    assert_eq!(first.stats_when("deposed", |_| true).await.counts["committed"], committed);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn streams_are_black_after_hold_s_without_a_director() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    configuration(folder, &NODES, &[endpoint()], "hold_s = 1.0");
    let director = Process::director(folder);
    let [left, _right] = NODES.map(|name| Process::node(folder, name));
    director.all_in().await;
    let mut stream = left.client().await.stream_frames("of_left", Encoding::Rgba8, 0.0).await.unwrap();
    let is_black = |frame: &ReceivedFrame| pixels(frame).chunks(4).all(|pixel| pixel == [0, 0, 0, 255]);
    // On a busy machine the stream may begin with black frames.
    while is_black(&stream.next().await.unwrap().unwrap()) {}
    director.kill();
    let black = async { while !is_black(&stream.next().await.unwrap().unwrap()) {} };
    tokio::time::timeout(PATIENCE, black).await.unwrap();
    left.stats_when("black", |cluster| cluster.counts["black"] >= 1).await;
    // Another director brings the pictures back.
    let director = Process::director(folder);
    let back = async { while is_black(&stream.next().await.unwrap().unwrap()) {} };
    tokio::time::timeout(PATIENCE, back).await.unwrap();
    director.advances(3).await;
}

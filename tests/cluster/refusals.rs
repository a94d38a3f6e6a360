//! Nodes that must not take part: another configuration, another certificate, another authority.

use std::{fs, time::Duration};

use crate::{
    certificates::Authority,
    processes::{Process, configuration, free_port},
};

const NODES: [&str; 2] = ["left", "right"];
const TLS: &str = "tls = { ca = 'ca.pem', certificate = '{name}.pem', key = '{name}.key' }\nreal_time = false";

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn another_configuration_is_refused_with_the_difference() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = configuration(folder, &NODES, &[format!("tcp/127.0.0.1:{}", free_port())], "");
    fs::write(folder.join("other.toml"), text.replace("[64, 48]", "[64, 40]")).unwrap();
    let director = Process::director(folder);
    let _left = Process::node(folder, "left");
    let right = Process::spawn(folder, "other.toml", &["--role", "node", "--node", "right"]);
    let stats = director.stats_when("refused", |cluster| cluster.nodes[1].state == "refused").await;
    assert!(stats.nodes[1].refused > 0 && stats.counts["refused"] > 0);
    assert!(stats.nodes[1].reason.contains("configuration"), "{stats:#?}");
    director.wait_for_log("node `right` is refused: the node has another configuration");
    right.wait_for_log("the director refuses this node: the node has another configuration");
    right.stats_when("refused", |cluster| cluster.state == "refused" && !cluster.reason.is_empty()).await;
    // With the right one it is welcome.
    drop(right);
    let _right = Process::node(folder, "right");
    director.all_in().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn certificates_of_the_authority_lead_and_others_do_not_take_part() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    configuration(folder, &NODES, &[format!("tls/127.0.0.1:{}", free_port())], TLS);
    let (own, foreign) = (Authority::new("dome"), Authority::new("other"));
    own.write(folder);
    for name in ["director", "left", "right"] {
        own.issue(folder, name, name);
    }
    let director = Process::director(folder);
    let left = Process::node(folder, "left");
    director.stats_when("left is known", |cluster| cluster.nodes[0].state == "out").await;
    // Another node's certificate, then one of another authority: `right` never says HELLO.
    for (authority, common_name) in [(&own, "left"), (&foreign, "right")] {
        authority.issue(folder, "right", common_name);
        let wrong = Process::node(folder, "right");
        tokio::time::sleep(Duration::from_secs(3)).await;
        wrong.stats_when("looking", |cluster| cluster.state == "looking").await;
        let stats = director.stats_when("right absent", |_| true).await;
        assert_eq!(stats.nodes[1].state, "absent", "{stats:#?}");
    }
    own.issue(folder, "right", "right");
    let _right = Process::node(folder, "right");
    director.all_in().await;
    drop(left);
}

//! `[cluster]` and `[[nodes]]`.

use steradian::config::{AtDeadline, DIRECTOR};

use super::*;

const VIEWS: &str = "[[views]]\nname = 'a'\ntype = 'perspective'\nsize = [8, 8]\nfov_y_deg = 60\n\
     [[views]]\nname = 'b'\ntype = 'perspective'\nsize = [8, 8]\nfov_y_deg = 60\n\
     [[windows]]\nname = 'of-a'\nview = 'a'\n[[windows]]\nname = 'of-b'\nview = 'b'\n";

fn cluster(keys: &str, nodes: &str) -> String {
    format!("{VIEWS}[cluster]\nendpoints = ['tcp/127.0.0.1:7447']\n{keys}\n{nodes}")
}

#[test]
fn a_cluster_with_its_nodes() {
    let tls = "[cluster.tls]\nca = 'ca.pem'\ncertificate = 'certificates/{name}.pem'\nkey = '/etc/{name}.key'\n";
    let text = cluster(
        &format!("rate_hz = 30\nat_deadline = 'apart'\n{tls}"),
        "[[nodes]]\nname = 'one'\nviews = ['a']\n[[nodes]]\nname = 'two'\nviews = ['b', 'a']\nwindows = ['of-b']\ncertificate = 'second'\n",
    );
    let config = parse(&text.replace("tcp/127.0.0.1", "tls/10.0.0.1")).unwrap();
    let cluster = config.cluster.as_ref().unwrap();
    assert_eq!((cluster.name.as_str(), cluster.rate_hz, cluster.at_deadline), ("steradian", 30.0, AtDeadline::Apart));
    let files = cluster.tls.as_ref().unwrap().files(&config.folder, DIRECTOR);
    let expected = ["/sky/ca.pem", "/sky/certificates/director.pem", "/etc/director.key"];
    assert_eq!(files, expected.map(PathBuf::from));
    let windows = |node: usize| -> Vec<&str> {
        config.nodes[node].windows_of(&config.windows).map(|window| window.name.as_str()).collect()
    };
    assert_eq!((windows(0), windows(1)), (vec!["of-a"], vec!["of-b"]));
    assert_eq!([0, 1].map(|node| config.nodes[node].common_name()), ["one", "second"]);
    // The part that all processes share contains the cluster, but not the server.
    let with = |server: &str| parse(&format!("{}{server}", text.replace("tcp/127.0.0.1", "tls/10.0.0.1"))).unwrap();
    assert_eq!(with("[server]\nlisten = '127.0.0.1:1'\n").shared, config.shared);
    assert_ne!(with("[overlay]\n").shared, config.shared);
    assert!(!config.pictured.contains("cluster"), "pictures do not depend on it");
}

#[test]
fn mistakes_in_a_cluster() {
    let node = "[[nodes]]\nname = 'one'\nviews = ['a']\n";
    parse(&cluster("", node)).unwrap();
    refused(&format!("{VIEWS}{node}"), &["nodes", "[cluster]"]);
    refused(&cluster("", ""), &["nodes", "at least one"]);
    for (wrong, expected) in [
        ("['udp/127.0.0.1:7447']", "tcp/HOST:PORT"),
        ("['tcp/127.0.0.1']", "tcp/HOST:PORT"),
        ("['tcp/10.0.0.1:7447']", "loopback"),
        ("['tls/127.0.0.1:7447']", "[cluster.tls]"),
        ("[]", "at least one"),
    ] {
        refused(&cluster("", node).replace("['tcp/127.0.0.1:7447']", wrong), &["cluster.endpoints", expected]);
    }
    refused(&cluster("rate_hz = 0", node), &["cluster.rate_hz"]);
    refused(&cluster("name = 'a b'", node), &["cluster.name"]);
    for (nodes, key, expected) in [
        ("name = 'one'\nviews = []", "nodes[0].views", "at least one"),
        ("name = 'one'\nviews = ['c']", "nodes[0].views[0]", "no view `c`"),
        ("name = 'one'\nviews = ['a', 'a']", "nodes[0].views[1]", "twice"),
        ("name = 'director'\nviews = ['a']", "nodes[0].name", "director"),
        ("name = 'one'\nviews = ['a']\nwindows = ['of-b']", "nodes[0].windows[0]", "does not draw"),
        ("name = 'one'\nviews = ['a']\n[[nodes]]\nname = 'one'\nviews = ['b']", "nodes[1].name", "unique"),
        (
            "name = 'one'\nviews = ['a']\n[[nodes]]\nname = 'two'\nviews = ['b']\ncertificate = 'one'",
            "nodes[1].certificate",
            "nodes[0]",
        ),
    ] {
        refused(&cluster("", &format!("[[nodes]]\n{nodes}\n")), &[key, expected]);
    }
    for metering in ["mean", "spot"] {
        refused(&format!("{}[exposure]\nmetering = '{metering}'\n", cluster("", node)), &["metering", metering]);
    }
}

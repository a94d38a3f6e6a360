//! Compares figures of simulated clusters with measurements. The delays were measured. All times are simulated.

use steradian_lock::Rules;

use super::sim::{
    delays::{Quantiles, quantile},
    figures::{Cluster, Figures, Load, MEASURED_PER_NODE_NS},
    setup::MS,
};

fn cluster(nodes: u16) -> Cluster {
    Cluster {
        rules: Rules::at_hertz(nodes, 60.0).unwrap(),
        seed: 1,
        load: Load::Idle,
        per_node_ns: MEASURED_PER_NODE_NS,
        loss: 0.0,
        timeout_ns: 200 * MS,
        draw_ms: 4.0,
        clock_error_ns: 200_000,
        seconds: 15,
        kills: 5,
    }
}

fn figures(cluster: Cluster) -> Figures {
    let figures = cluster.figures();
    assert_eq!(figures.violations, 0);
    figures
}

/// The measured runs draw nothing.
#[test]
fn the_model_has_the_measured_times_until_all_are_ready() {
    for (nodes, median_ms, p99_ms) in [(6, 0.46, 0.70), (30, 2.0, 2.6)] {
        let [median_ns, p99_ns, _] = figures(Cluster { draw_ms: 0.0, kills: 0, ..cluster(nodes) }).all_ready_ns;
        for (model_ns, measured_ms) in [(median_ns, median_ms), (p99_ns, p99_ms)] {
            let ratio = model_ns as f64 / 1e6 / measured_ms;
            assert!((0.7..1.3).contains(&ratio), "{nodes} nodes: {model_ns} ns, measured {measured_ms} ms");
        }
    }
}

#[test]
fn clusters_keep_their_rate_and_kills_cost_the_others_one_frame() {
    for nodes in [6, 24, 60] {
        let figures = figures(cluster(nodes));
        assert!(figures.dropped < 0.005 && figures.frames_per_s > 59.7, "{figures:?}");
        assert!(figures.longest_gap_ns < 40 * MS && figures.recovery_ns[1] < 150 * MS, "{figures:?}");
        assert!(figures.director_gap_ns < 600 * MS && figures.skew_ns[2] < 2 * MS, "{figures:?}");
    }
}

#[test]
fn losses_and_load_cost_frames_and_mix_none() {
    let calm = figures(cluster(6));
    let losses = [0.01, 0.05].map(|loss| figures(Cluster { loss, ..cluster(6) }));
    assert!(calm.dropped < losses[0].dropped && losses[0].dropped < losses[1].dropped);
    assert!(losses[0].dropped < 0.01, "{:?}", losses[0]);
    let busy = figures(Cluster { load: Load::Two, ..cluster(6) });
    let real_time = figures(Cluster { load: Load::RealTime, ..cluster(6) });
    let half_busy = figures(Cluster { load: Load::One, ..cluster(6) });
    assert!(busy.dropped > 2.0 * half_busy.dropped, "{busy:?} {half_busy:?}");
    assert!(half_busy.dropped > 2.0 * real_time.dropped, "{half_busy:?} {real_time:?}");
}

#[test]
fn two_hundred_nodes_need_more_time_than_sixty_hertz_has() {
    let short = Cluster { seconds: 8, kills: 0, ..cluster(200) };
    assert!(figures(short).dropped > 0.5);
    let slower = Cluster { rules: Rules::at_hertz(200, 30.0).unwrap(), seconds: 3, ..short };
    assert!(figures(slower).dropped < 0.01);
}

#[test]
fn the_same_cluster_has_the_same_figures() {
    assert_eq!(figures(cluster(6)), figures(cluster(6)));
    assert_ne!(figures(cluster(6)), figures(Cluster { seed: 2, ..cluster(6) }));
}

#[test]
fn delays_have_their_quantiles() {
    let delays = Quantiles::new(&[(0.0, 1e6), (0.5, 2e6), (0.99, 8e6)]);
    for (q, value_ns) in [(0.0, 1_000_000), (0.5, 2_000_000), (0.99, 8_000_000), (0.9999, 8_000_000)] {
        assert!(delays.value_ns(q).abs_diff(value_ns) < 10, "{q}");
    }
    assert!((1_000_000..2_000_000).contains(&delays.value_ns(0.3)));
    assert_eq!(quantile(&mut [3, 1, 2], 0.5), 2);
    assert_eq!((quantile(&mut [3, 1, 2], 1.0), quantile(&mut [], 0.5)), (3, 0));
}

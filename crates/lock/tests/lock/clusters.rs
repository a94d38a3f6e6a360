//! Whole clusters, each with one kind of fault.

use steradian_lock::{Policy, Rules, director::Phase};

use super::sim::{
    delays::Quantiles,
    setup::{Fault, MS, Network, OnLoss, SECOND, Setup},
    world::World,
};

/// Six nodes at 60 Hz on a network without losses.
pub fn calm() -> Setup {
    Setup {
        rules: Rules::at_hertz(6, 60.0).unwrap(),
        seed: 1,
        network: Network {
            delay: Quantiles::uniform_ms(0.05, 0.5),
            per_node_ns: 0,
            loss: 0.0,
            on_loss: OnLoss::Gone,
            duplicates: 0.0,
            in_order: true,
            kept_by_cut: 0.0,
        },
        draw: Quantiles::uniform_ms(3.0, 6.0),
        timer: Quantiles::uniform_ms(0.0, 0.1),
        stall: None,
        clock_error_ns: 200_000,
        noticed_ns: 17 * MS,
        lease_ns: SECOND,
        mutation: None,
    }
}

/// Longest time without a new picture after `from_ns` on a node, ns.
fn longest_gap_ns(world: &World, node: usize, from_ns: u64) -> u64 {
    let shows: Vec<u64> = world.nodes[node].shows.iter().copied().filter(|&at_ns| at_ns >= from_ns).collect();
    assert!(shows.len() > 1, "node {node} has shown nothing");
    shows.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap()
}

fn in_periods(world_ns: u64) -> u64 {
    let period_ns = Rules::at_hertz(6, 60.0).unwrap().period_ns;
    (world_ns + period_ns / 2) / period_ns
}

#[test]
fn a_calm_cluster_shows_every_frame_on_every_node() {
    let mut world = World::new(calm());
    world.finish(20 * SECOND);
    assert_eq!(world.checker.found, [].into());
    // 20 s at 60 Hz, minus half a second of gathering and starting.
    let committed = world.checker.committed.len();
    assert!((1160..1200).contains(&committed), "{committed}");
    // Frames that are due after the end.
    assert!(world.checker.not_shown() <= 18, "{}", world.checker.not_shown());
    for node in 0..6 {
        assert_eq!(in_periods(longest_gap_ns(&world, node, 0)), 1);
    }
    let director = world.director(0).unwrap();
    assert!(director.is_locked() && director.clock_steps() == 0);
    assert_eq!(director.counts().skipped_deadline + director.counts().skipped_quorum + director.counts().out, 0);
}

#[test]
fn one_killed_node_costs_the_others_two_periods_and_comes_back() {
    let mut world = World::new(calm());
    for kill in 0..20 {
        world.at(2 * SECOND + kill * 997 * MS, Fault::KillNode(3, 300 * MS));
    }
    world.finish(24 * SECOND);
    assert_eq!(world.checker.found, [].into());
    assert_eq!(world.recoveries_ns.len(), 20);
    // Time for HELLO and WELCOME, three frames, and the lead.
    assert!(world.recoveries_ns.iter().all(|&ns| ns < 250 * MS), "{:?}", world.recoveries_ns);
    for node in [0, 1, 2, 4, 5] {
        assert!(in_periods(longest_gap_ns(&world, node, SECOND)) <= 3);
    }
    assert_eq!(world.director(0).unwrap().counts().out, 20);
    assert!(world.director(0).unwrap().is_locked());
}

#[test]
fn a_hung_node_is_left_out_after_three_misses_and_shows_no_backlog() {
    let mut world = World::new(calm());
    world.at(2 * SECOND, Fault::HangNode(0, 5 * SECOND));
    world.finish(10 * SECOND);
    assert_eq!(world.checker.found, [].into());
    // Three skipped frames.
    for node in 1..6 {
        assert_eq!(in_periods(longest_gap_ns(&world, node, SECOND)), 4);
    }
    let counts = world.node(0).unwrap().counts();
    assert_eq!((world.director(0).unwrap().counts().out, counts.black), (1, 1));
    // While it hangs it shows nothing, although 300 COMMITs wait in its queue.
    let shows = &world.nodes[0].shows;
    let back_ns = shows.iter().find(|&&at_ns| at_ns > 2 * SECOND + 60 * MS).unwrap();
    assert!((7 * SECOND..7 * SECOND + 200 * MS).contains(back_ns), "{back_ns}");
    assert!(counts.states_replaced > 250);
}

#[test]
fn apart_goes_on_without_a_slow_node() {
    let setup = calm();
    let mut world = World::new(Setup { rules: Rules { policy: Policy::Apart, ..setup.rules }, ..setup });
    world.at(2 * SECOND, Fault::HangNode(0, 5 * SECOND));
    world.finish(10 * SECOND);
    assert_eq!(world.checker.found, [].into());
    for node in 1..6 {
        assert_eq!(in_periods(longest_gap_ns(&world, node, SECOND)), 1);
    }
    assert!(world.director(0).unwrap().is_locked());
}

#[test]
fn half_of_the_nodes_hold_and_more_than_half_go_on() {
    for (lost, goes_on) in [(3, false), (2, true)] {
        let mut world = World::new(calm());
        world.at(2 * SECOND, Fault::Cut(0, (0..lost).collect()));
        world.at(6 * SECOND, Fault::Heal(0, (0..lost).collect()));
        world.run_until(6 * SECOND);
        let during = world.checker.committed.values().filter(|known| known.sent_ns > 2 * SECOND + 100 * MS).count();
        assert_eq!(during > 0, goes_on, "{lost} lost: {during} frames");
        assert_eq!(world.director(0).unwrap().counts().skipped_quorum > 0, !goes_on);
        world.finish(10 * SECOND);
        assert_eq!(world.checker.found, [].into());
        assert!(world.director(0).unwrap().is_locked());
    }
}

#[test]
fn a_partition_of_three_against_three_stops_both_directors() {
    let mut world = World::new(calm());
    // The second director starts with three nodes, and the first one keeps the other three.
    world.at(2 * SECOND, Fault::Cut(0, vec![0, 1, 2]));
    world.at(2 * SECOND, Fault::Cut(1, vec![3, 4, 5]));
    world.at(2 * SECOND, Fault::StartDirector(1));
    world.run_until(12 * SECOND);
    let late = world.checker.committed.values().filter(|known| known.sent_ns > 2 * SECOND + 100 * MS).count();
    assert_eq!(late, 0);
    // The second director has no epoch, so it has not disturbed the first one.
    assert_eq!(world.director(1).unwrap().phase(), Phase::Gathering);
    // After the network is repaired, exactly one of them leads.
    world.at(12 * SECOND, Fault::Heal(0, vec![0, 1, 2]));
    world.at(12 * SECOND, Fault::Heal(1, vec![3, 4, 5]));
    world.finish(20 * SECOND);
    assert_eq!(world.checker.found, [].into());
    let phases = [0, 1].map(|director| world.director(director).unwrap().phase());
    assert!(phases.contains(&Phase::Running) && !phases.iter().all(|phase| *phase == Phase::Running), "{phases:?}");
    assert!(world.checker.committed.values().any(|known| known.sent_ns > 19 * SECOND));
}

#[test]
fn an_old_director_that_wakes_up_is_deposed_and_commits_nothing() {
    let mut world = World::new(calm());
    world.at(3 * SECOND, Fault::HangDirector(0, 10 * SECOND));
    world.at(3 * SECOND, Fault::StartDirector(1));
    world.run_until(12 * SECOND);
    let before = world.directors[0].commits;
    assert!(before > 100 && world.directors[1].commits > 100);
    world.finish(20 * SECOND);
    assert_eq!(world.checker.found, [].into());
    assert_eq!(world.directors[0].commits, before);
    assert_eq!(world.directors[0].deposed_by, Some(world.director(1).unwrap().epoch()));
    assert!(world.director(1).unwrap().is_locked());
}

#[test]
fn a_restarted_director_has_a_higher_epoch_and_goes_on() {
    let mut world = World::new(calm());
    world.run_until(2 * SECOND);
    let first = world.director(0).unwrap().epoch();
    for kill in 0..10 {
        world.at(3 * SECOND + kill * 1_501 * MS, Fault::KillDirector(0, Some(200 * MS)));
    }
    world.finish(20 * SECOND);
    assert_eq!(world.checker.found, [].into());
    let last = world.director(0).unwrap().epoch();
    assert_eq!((first.counter, last.counter), (1, 11));
    for node in 0..6 {
        // Sum of 200 ms of absence, up to 100 ms until the connections are back, the start, and the lead.
        assert!(longest_gap_ns(&world, node, SECOND) < 500 * MS);
        assert_eq!(world.nodes[node].black, 0);
    }
}

#[test]
fn without_a_director_nodes_hold_and_then_go_black_once() {
    let mut world = World::new(calm());
    world.at(2 * SECOND, Fault::KillDirector(0, None));
    world.run_until(6 * SECOND);
    assert!((0..6).all(|node| world.nodes[node].black == 0 && world.node(node).unwrap().shown().is_some()));
    world.run_until(20 * SECOND);
    assert!((0..6).all(|node| world.nodes[node].black == 1 && world.node(node).unwrap().shown().is_none()));
    world.at(20 * SECOND, Fault::StartDirector(0));
    world.finish(22 * SECOND);
    assert!((0..6).all(|node| world.node(node).unwrap().shown().is_some()));
    assert_eq!(world.checker.found, [].into());
}

#[test]
fn a_slow_start_waits_for_all_nodes_and_then_for_more_than_half() {
    // One node needs 20 s for its first picture: the others start without it after 5 s.
    let mut world = World::new(calm());
    world.at(210 * MS, Fault::HangNode(2, 20 * SECOND));
    world.finish(25 * SECOND);
    assert_eq!(world.checker.found, [].into());
    let first_ns = world.checker.committed.values().next().unwrap().sent_ns;
    assert!((5 * SECOND..6 * SECOND).contains(&first_ns), "{first_ns}");
    assert!(world.director(0).unwrap().is_locked());
}

#[test]
fn a_clock_that_is_set_moves_the_cluster_to_presentation_on_receipt() {
    let mut world = World::new(calm());
    world.at(3 * SECOND, Fault::StepNodeClock(4, 3_600 * SECOND as i64));
    world.run_until(6 * SECOND);
    let counts = world.director(0).unwrap().counts();
    // The clock stays an hour off, so the node keeps reporting that it cannot meet any time.
    assert!(counts.committed_on_receipt > 150, "{counts:?}");
    assert!(!world.director(0).unwrap().is_locked());
    assert_eq!(world.node(4).unwrap().clock_steps(), 1);
    // The clock is set back to the right time: after a second of distrust all frames have times again.
    world.at(6 * SECOND, Fault::StepNodeClock(4, -3_600 * SECOND as i64));
    world.finish(12 * SECOND);
    assert_eq!(world.checker.found, [].into());
    assert!(world.director(0).unwrap().is_locked());
    assert_eq!(world.director(0).unwrap().counts().out, 0);
    for node in 0..6 {
        assert!(in_periods(longest_gap_ns(&world, node, SECOND)) <= 5);
    }
}

#[test]
fn a_clock_that_is_not_disciplined_is_used_by_nobody() {
    let mut world = World::new(calm());
    world.at(0, Fault::Discipline(1, false));
    world.finish(5 * SECOND);
    assert_eq!(world.checker.found, [].into());
    let counts = world.director(0).unwrap().counts();
    assert_eq!(counts.committed, counts.committed_on_receipt);
    assert!(counts.committed > 200);
}

#[test]
fn a_director_whose_clock_is_set_goes_on() {
    for step_s in [-3_600, 3_600] {
        let mut world = World::new(calm());
        world.at(3 * SECOND, Fault::StepDirectorClock(0, step_s * SECOND as i64));
        world.finish(10 * SECOND);
        assert_eq!(world.checker.found, [].into());
        let director = world.director(0).unwrap();
        assert_eq!((director.clock_steps(), director.counts().out), (1, 0));
        assert!(director.counts().committed > 500 && director.counts().committed_on_receipt > 300);
        for node in 0..6 {
            assert!(in_periods(longest_gap_ns(&world, node, SECOND)) <= 5, "{step_s}");
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_run() {
    let run = |seed| {
        let mut setup = calm();
        setup.network.loss = 0.05;
        let mut world = World::new(Setup { seed, ..setup });
        world.at(SECOND, Fault::KillNode(1, 300 * MS));
        world.finish(4 * SECOND);
        world.nodes.iter().map(|node| node.shows.clone()).collect::<Vec<_>>()
    };
    assert_eq!(run(5), run(5));
    assert_ne!(run(5), run(6));
}

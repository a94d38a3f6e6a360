//! The checker finds deliberate mistakes.

use std::collections::BTreeSet;

use steradian_lock::{Policy, Rules};

use super::{
    clusters::calm,
    sim::{
        checker::Violation,
        delays::Quantiles,
        setup::{Fault, Mutation, SECOND, Setup},
        world::World,
    },
};

fn found(setup: Setup, faults: Vec<(u64, Fault)>) -> (BTreeSet<Violation>, World) {
    let mut world = World::new(setup);
    for (at_ns, fault) in faults {
        world.at(at_ns, fault);
    }
    world.finish(12 * SECOND);
    (world.checker.found.keys().copied().collect(), world)
}

/// Runs with and without the mutation. Without it, the checker must find nothing.
fn mutated(mutation: Mutation, setup: Setup, faults: &[(u64, Fault)]) -> (BTreeSet<Violation>, World) {
    let (none, _) = found(setup.clone(), faults.to_vec());
    assert_eq!(none, BTreeSet::new());
    found(Setup { mutation: Some(mutation), ..setup }, faults.to_vec())
}

#[test]
fn a_node_that_ignores_commit_is_found() {
    let (violations, _) = mutated(Mutation::CommitIgnored, calm(), &[]);
    assert!(violations.contains(&Violation::ShownWithoutCommit), "{violations:?}");
}

#[test]
fn a_node_that_shows_nothing_is_found() {
    let (_, world) = mutated(Mutation::NothingShown, calm(), &[]);
    assert!(world.checker.not_shown() > 3_000);
}

#[test]
fn ready_before_the_end_of_drawing_is_found() {
    let (violations, _) = mutated(Mutation::ReadyTooEarly, calm(), &[]);
    assert!(violations.contains(&Violation::ReadyBeforeDrawn), "{violations:?}");
    // With drawing that takes longer than the time until presentation, an unfinished picture is shown.
    let setup = Setup { draw: Quantiles::uniform_ms(60.0, 80.0), mutation: Some(Mutation::ReadyTooEarly), ..calm() };
    assert!(found(setup, Vec::new()).0.contains(&Violation::ShownUnfinished));
}

#[test]
fn a_node_that_ignores_the_mask_is_found() {
    let mut setup = calm();
    setup.rules = Rules { policy: Policy::Apart, ..setup.rules };
    setup.network.delay = Quantiles::uniform_ms(0.1, 6.0);
    setup.draw = Quantiles::uniform_ms(3.0, 9.0);
    let (violations, _) = mutated(Mutation::MaskIgnored, setup, &[]);
    assert!(violations.contains(&Violation::ShownOutsideMask), "{violations:?}");
}

#[test]
fn a_node_that_draws_a_backlog_is_found() {
    let hang = [(3 * SECOND, Fault::HangNode(0, 5 * SECOND))];
    let (violations, _) = mutated(Mutation::Backlog, calm(), &hang);
    assert!(violations.contains(&Violation::OldStateDrawn), "{violations:?}");
}

/// The first director is silent for so long that a second one starts.
fn two_directors() -> Vec<(u64, Fault)> {
    vec![(3 * SECOND, Fault::HangDirector(0, 3 * SECOND)), (3 * SECOND, Fault::StartDirector(1))]
}

#[test]
fn nodes_that_vote_for_two_directors_are_found() {
    let (violations, world) = mutated(Mutation::TwoPromises, calm(), &two_directors());
    assert!(violations.contains(&Violation::EpochsInterleave), "{violations:?}");
    assert!(violations.contains(&Violation::VotedBack), "{violations:?}");
    assert!(world.directors.iter().all(|director| director.commits > 300));
}

#[test]
fn directors_without_a_quorum_are_found() {
    let partition = [
        (2 * SECOND, Fault::Cut(0, vec![0, 1, 2])),
        (2 * SECOND, Fault::Cut(1, vec![3, 4, 5])),
        (2 * SECOND, Fault::StartDirector(1)),
    ];
    let (violations, _) = mutated(Mutation::NoQuorum, calm(), &partition);
    for violation in [Violation::EpochsInterleave, Violation::CommitWithoutQuorum, Violation::CommitWithoutVotes] {
        assert!(violations.contains(&violation), "{violation:?}: {violations:?}");
    }
}

//! Random clusters: delays, losses, duplicates, reordering, kills, hangs, restarts, partitions, two directors and undisciplined clocks.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use steradian_lock::{Policy, Rules};

use super::{
    clusters::calm,
    sim::{
        delays::Quantiles,
        setup::{Fault, MS, OnLoss, SECOND, Setup},
        world::World,
    },
};

const RUNS: u64 = 150;
const END_NS: u64 = 12 * SECOND;
/// No faults happen after this time.
const TROUBLE_NS: u64 = 8 * SECOND;

fn random_setup(random: &mut ChaCha8Rng) -> Setup {
    let setup = calm();
    let rules =
        Rules::at_hertz(random.random_range(1..=7), *[30.0, 60.0, 120.0].get(random.random_range(0..3)).unwrap());
    let mut rules = rules.unwrap();
    rules.policy = if random.random_bool(0.5) { Policy::Together } else { Policy::Apart };
    rules.misses_until_out = random.random_range(1..=4);
    rules.lead_ns = random.random_range(1..=60) * MS;
    rules.deadline_ns = rules.period_ns * random.random_range(2..=4) / 4;
    let mut network = setup.network;
    network.loss = random.random_range(0.0..0.1);
    network.duplicates = random.random_range(0.0..0.2);
    network.in_order = random.random_bool(0.5);
    network.kept_by_cut = random.random_range(0.0..0.5);
    if random.random_bool(0.3) {
        network.on_loss = OnLoss::Again { timeout_ns: random.random_range(5..=200) * MS };
    }
    // Most messages are fast, some take up to a second.
    network.delay = Quantiles::new(&[(0.0, 5e4), (0.9, 1e6), (0.97, 1e7), (0.999, random.random_range(1e7..1e9))]);
    let draw_ms = rules.deadline_ns as f64 / 1e6 * random.random_range(0.2..0.9);
    Setup {
        rules,
        seed: random.random(),
        network,
        draw: Quantiles::uniform_ms(draw_ms * 0.5, draw_ms * 1.2),
        timer: Quantiles::new(&[(0.0, 1e4), (0.99, 1e6), (0.999, 2e7)]),
        ..setup
    }
}

fn random_fault(random: &mut ChaCha8Rng, nodes: usize) -> Fault {
    let node = random.random_range(0..nodes);
    let director = usize::from(random.random_bool(0.4));
    let time_ns = random.random_range(1..2_000) * MS;
    let some = |random: &mut ChaCha8Rng| (0..nodes).filter(|_| random.random_bool(0.5)).collect::<Vec<_>>();
    match random.random_range(0..10) {
        0 | 1 => Fault::KillNode(node, time_ns),
        2 | 3 => Fault::HangNode(node, time_ns),
        4 => Fault::KillDirector(director, Some(time_ns)),
        5 => Fault::HangDirector(director, time_ns),
        6 => Fault::StartDirector(director),
        7 => Fault::Cut(director, some(random)),
        8 => Fault::Heal(director, some(random)),
        _ => Fault::Discipline(node, random.random_bool(0.5)),
    }
}

#[test]
fn no_trouble_makes_frames_mix_or_two_directors_commit() {
    let (mut committed, mut shown, mut reigns, mut deposed) = (0, 0, 0, 0);
    for seed in 0..RUNS {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let setup = random_setup(&mut random);
        let nodes = usize::from(setup.rules.nodes);
        let mut world = World::new(setup);
        for _ in 0..random.random_range(0..25) {
            let fault = random_fault(&mut random, nodes);
            world.at(random.random_range(0..TROUBLE_NS), fault);
        }
        world.finish(END_NS);
        assert_eq!(world.checker.found, [].into(), "seed {seed}");
        committed += world.checker.committed.len();
        shown += world.checker.committed.values().map(|known| known.shows.len()).sum::<usize>();
        reigns += world.checker.newest_epoch().map_or(0, |epoch| epoch.counter);
        deposed += world.directors.iter().filter(|director| director.deposed_by.is_some()).count();
    }
    // The runs contain the situations under test.
    assert!(committed > 15_000 && shown > 40_000, "{committed} committed, {shown} shown");
    assert!(reigns > RUNS && deposed > 15, "{reigns} reigns, {deposed} deposed");
}

#[test]
fn after_the_trouble_the_cluster_is_locked_again() {
    for seed in 0..40 {
        let mut random = ChaCha8Rng::seed_from_u64(1_000 + seed);
        let mut setup = random_setup(&mut random);
        let easy = calm();
        setup.rules = Rules { lead_ns: 33 * MS, ..easy.rules };
        (setup.draw, setup.timer) = (easy.draw, easy.timer);
        setup.network = easy.network;
        let mut world = World::new(setup);
        for _ in 0..15 {
            let fault = random_fault(&mut random, 6);
            world.at(random.random_range(SECOND..TROUBLE_NS), fault);
        }
        // The operator repairs everything, and starts one director that replaces all others.
        let end_ns = TROUBLE_NS + 2 * SECOND;
        for node in 0..6 {
            world.at(end_ns, Fault::Discipline(node, true));
        }
        for director in [0, 1] {
            world.at(end_ns, Fault::KillDirector(director, None));
            world.at(end_ns, Fault::Heal(director, (0..6).collect()));
        }
        world.at(end_ns, Fault::StartDirector(0));
        world.finish(end_ns + 4 * SECOND);
        assert_eq!(world.checker.found, [].into(), "seed {seed}");
        let director = world.director(0).unwrap();
        assert!(director.is_locked(), "seed {seed}: {:?} {:?}", director.phase(), director.counts());
    }
}

//! Single steps of both state machines, with hand-written messages.

use steradian_lock::{
    Commit, Cue, Director, Epoch, FrameId, Identity, Mask, Node, NodeId, Now, Policy, Rules, State, director,
    director::{Phase, Place},
    messages::{Hello, Out, OutReason, Ready, Refusal, Report, Skip, SkipReason, ToDirector, ToNode, Welcome},
    node,
};

const MS: u64 = 1_000_000;
/// Random number of the process of the node under test.
const RUN: u64 = 77;

/// Rules with 10 ms per frame, 8 ms until the deadline and 20 ms of lead.
fn rules(nodes: u16) -> Rules {
    let rules = Rules::at_hertz(nodes, 100.0).unwrap();
    Rules { deadline_ns: 8 * MS, lead_ns: 20 * MS, ..rules }
}

/// A time with a disciplined clock; TAI begins a second before the process.
fn at(ms: u64) -> Now {
    Now { monotonic_ns: ms * MS, tai_ns: Some(tai(ms)) }
}

fn tai(ms: u64) -> i64 {
    (ms * MS) as i64 + 1_000_000_000
}

fn epoch(counter: u64) -> Epoch {
    Epoch { counter, run: 5 }
}

fn id(counter: u64, number: u64) -> FrameId {
    FrameId { epoch: epoch(counter), number }
}

fn hello(run: u64, promised: Epoch) -> ToDirector {
    ToDirector::Hello(Hello { run, promised, identity: Identity::default() })
}

fn ready(id: FrameId) -> ToDirector {
    ToDirector::Ready(Ready { id, drawn_ns: 1, has_clock: true, report: Report::default() })
}

fn state(id: FrameId, present_ms: Option<u64>) -> ToNode {
    ToNode::State(State { id, present_at: present_ms.map(tai), commit: None, cue: Cue::default() })
}

fn commit(id: FrameId, present_ms: Option<u64>, nodes: &[u16]) -> ToNode {
    let mask: Mask = nodes.iter().copied().map(NodeId).collect();
    ToNode::Commit(Commit { id, present_at: present_ms.map(tai), mask })
}

/// Node 0 of three, led by epoch 1 since 0 ms.
fn led_node() -> Node {
    let mut node = Node::new(rules(3), NodeId(0), RUN, Epoch::NONE, Identity::default(), at(0));
    node.act(at(0));
    node.hear(at(0), ToNode::Welcome(Welcome { epoch: epoch(1), run: RUN, newest: 0 }));
    assert_eq!(node.act(at(0)), [node::Action::Remember(epoch(1))]);
    node
}

/// Draws a frame from one time to another; returns whether the node reported READY.
fn draw(node: &mut Node, id: FrameId, present_ms: Option<u64>, from_ms: u64, until_ms: u64) -> bool {
    node.hear(at(from_ms), state(id, present_ms));
    let actions = node.act(at(from_ms));
    assert!(actions.iter().any(|action| matches!(action, node::Action::Draw { id: drawn, .. } if *drawn == id)));
    node.drawn(at(until_ms), id, MS, Report::default());
    node.act(at(until_ms)).iter().any(|action| matches!(action, node::Action::Send(ToDirector::Ready(_))))
}

/// A director of three nodes that takes its epoch at 0 ms, with the actions of its start.
fn started(promised: [Epoch; 3]) -> (Director, Vec<director::Action>) {
    let mut director = Director::new(rules(3), 9, Identity::default());
    for (node, promised) in (0..).zip(promised) {
        director.hear(at(0), NodeId(node), hello(u64::from(node), promised));
    }
    let actions = director.act(at(0));
    (director, actions)
}

/// Composes the frame of a tick, passes in READY of some nodes, and returns the actions until the deadline.
fn frame(director: &mut Director, tick_ms: u64, number: u64, nodes: &[u16]) -> Vec<director::Action> {
    let id = FrameId { epoch: director.epoch(), number };
    let mut actions = director.act(at(tick_ms));
    director.composed(at(tick_ms), id, Cue::default());
    actions.extend(director.act(at(tick_ms)));
    for node in nodes {
        director.hear(at(tick_ms + 1), NodeId(*node), ready(id));
    }
    actions.extend(director.act(at(tick_ms + 1)));
    actions.extend(director.act(at(tick_ms + 8)));
    actions
}

/// A director with all three nodes in, whose next tick is frame 4 at 30 ms.
fn running() -> Director {
    let (mut director, _) = started([Epoch::NONE; 3]);
    for number in 1..=3 {
        frame(&mut director, 10 * (number - 1), number, &[0, 1, 2]);
    }
    director
}

fn commits(actions: &[director::Action]) -> Vec<Commit> {
    let commit = |action: &director::Action| match action {
        director::Action::SendAll(ToNode::Commit(commit)) => Some(*commit),
        _ => None,
    };
    actions.iter().filter_map(commit).collect()
}

fn skips(actions: &[director::Action]) -> Vec<SkipReason> {
    let skip = |action: &director::Action| match action {
        director::Action::SendAll(ToNode::Skip(skip)) => Some(skip.why),
        _ => None,
    };
    actions.iter().filter_map(skip).collect()
}

#[test]
fn an_epoch_is_above_all_that_nodes_have_promised() {
    let (director, actions) = started([epoch(4), epoch(7), Epoch::NONE]);
    assert_eq!(director.epoch(), Epoch { counter: 8, run: 9 });
    let welcomes = actions.iter().filter(|action| {
        matches!(action, director::Action::Send { message: ToNode::Welcome(welcome), .. } if welcome.epoch.counter == 8)
    });
    assert_eq!(welcomes.count(), 3);
}

#[test]
fn a_director_without_more_than_half_of_the_nodes_sends_nothing() {
    let mut director = Director::new(rules(4), 9, Identity::default());
    director.act(at(0));
    for node in [0, 1] {
        director.hear(at(1), NodeId(node), hello(1, Epoch::NONE));
    }
    assert_eq!(director.act(at(60_000)), []);
    director.hear(at(60_001), NodeId(2), hello(1, Epoch::NONE));
    assert!(!director.act(at(60_001)).is_empty());
    assert_eq!(director.phase(), Phase::Starting);
}

#[test]
fn nodes_with_other_files_are_refused_with_the_difference() {
    let mut director = running();
    let identity = Identity { version: "2".to_owned(), ..Identity::default() };
    let refusal = Refusal::Version { director: String::new(), node: "2".to_owned() };
    director.hear(at(30), NodeId(1), ToDirector::Hello(Hello { run: 3, promised: Epoch::NONE, identity }));
    director.hear(at(30), NodeId(3), hello(1, Epoch::NONE));
    let actions = director.act(at(29));
    let refused = |to, refusal| director::Action::Send { to: NodeId(to), message: ToNode::Refused(refusal) };
    assert_eq!(actions[0], refused(1, refusal.clone()));
    assert_eq!(actions[1], refused(3, Refusal::UnknownNode(NodeId(3))));
    assert_eq!((director.place(NodeId(1)), director.counts().refused), (Some(&Place::Refused(refusal.clone())), 2));
    // Its READY does not count.
    let actions = frame(&mut director, 30, 4, &[0, 1, 2]);
    assert_eq!(commits(&actions)[0].mask, [0, 2].map(NodeId).into_iter().collect());

    // The refused node asks again after a second instead of a tenth of a second.
    let mut node = led_node();
    node.hear(at(500), ToNode::Refused(refusal));
    assert!(node.refused().is_some() && node.led_by().is_none());
    assert!(matches!(node.act(at(500))[..], [node::Action::Send(ToDirector::Hello(_))]));
    assert_eq!(node.wake_at(), 1_500 * MS);
    node.hear(at(1_500), ToNode::Welcome(Welcome { epoch: epoch(1), run: RUN, newest: 9 }));
    assert!(node.refused().is_none() && node.led_by() == Some(epoch(1)));
}

#[test]
fn all_ready_is_committed_at_once_with_the_time_of_the_state() {
    let mut director = running();
    let actions = frame(&mut director, 30, 4, &[0, 1, 2]);
    let expected = Commit {
        id: FrameId { epoch: director.epoch(), number: 4 },
        present_at: Some(tai(58)),
        mask: [0, 1, 2].map(NodeId).into_iter().collect(),
    };
    // The first COMMIT, and its copy after a third of the lead.
    assert_eq!(commits(&actions), [expected, expected]);
    assert!(director.is_locked());
    // The next STATE repeats the COMMIT.
    director.act(at(40));
    director.composed(at(40), FrameId { epoch: director.epoch(), number: 5 }, Cue::default());
    let actions = director.act(at(40));
    let repeated = actions.iter().any(
        |action| matches!(action, director::Action::SendAll(ToNode::State(state)) if state.commit == Some(expected)),
    );
    assert!(repeated, "{actions:?}");
}

#[test]
fn a_commit_without_a_time_is_repeated_after_one_and_two_milliseconds() {
    let mut director = running();
    let id = FrameId { epoch: director.epoch(), number: 4 };
    director.act(at(30));
    director.composed(at(30), id, Cue::default());
    director.act(at(30));
    // One node has no trusted clock, so all show the frame on receipt.
    for node in 0..3 {
        let ready = Ready { id, drawn_ns: 1, has_clock: node != 1, report: Report::default() };
        director.hear(at(32), NodeId(node), ToDirector::Ready(ready));
    }
    let mask: Mask = [0, 1, 2].map(NodeId).into_iter().collect();
    let expected = Commit { id, present_at: None, mask };
    for ms in [32, 33, 34] {
        assert_eq!(commits(&director.act(at(ms))), [expected], "at {ms} ms");
    }
    assert_eq!(commits(&director.act(at(39))), []);
    assert_eq!(director.counts().committed_on_receipt, 1);
}

#[test]
fn at_the_deadline_together_skips_and_apart_commits_with_a_mask() {
    let mut director = running();
    assert_eq!(skips(&frame(&mut director, 30, 4, &[0, 2])), [SkipReason::Deadline]);
    let (mut director, _) = started([Epoch::NONE; 3]);
    for number in 1..=3 {
        assert_eq!(skips(&frame(&mut director, 10 * (number - 1), number, &[0, 1, 2])), [SkipReason::Starting]);
    }
    assert_eq!(director.counts().taken_in, 0);

    let mut apart = Director::new(Rules { policy: Policy::Apart, ..rules(3) }, 9, Identity::default());
    (0..3).for_each(|node| apart.hear(at(0), NodeId(node), hello(1, Epoch::NONE)));
    apart.act(at(0));
    for number in 1..=3 {
        frame(&mut apart, 10 * (number - 1), number, &[0, 1, 2]);
    }
    let actions = frame(&mut apart, 30, 4, &[0, 2]);
    assert_eq!(commits(&actions)[0].mask, [0, 2].map(NodeId).into_iter().collect());
    // One READY of three is not enough.
    assert_eq!(skips(&frame(&mut apart, 40, 5, &[0])), [SkipReason::Quorum]);
}

#[test]
fn three_misses_put_a_node_out_and_three_ready_take_it_back() {
    let mut director = running();
    for number in 4..=6 {
        assert_eq!(skips(&frame(&mut director, 10 * (number - 1), number, &[0, 2])), [SkipReason::Deadline]);
    }
    let actions = frame(&mut director, 60, 7, &[0, 1, 2]);
    let out = Out { epoch: director.epoch(), node: NodeId(1), why: OutReason::Misses };
    assert!(actions.contains(&director::Action::SendAll(ToNode::Out(out))));
    // Frame 7 was the first of three with READY; the miss of frame 8 restarts the count.
    for (number, nodes, mask_len) in
        [(8, &[0, 2][..], 2), (9, &[0, 1, 2], 2), (10, &[0, 1, 2], 2), (11, &[0, 1, 2], 2), (12, &[0, 1, 2], 3)]
    {
        let actions = frame(&mut director, 10 * (number - 1), number, nodes);
        let committed = commits(&actions);
        assert_eq!(committed.last().unwrap().mask.len(), mask_len, "frame {number}");
    }
}

#[test]
fn with_one_miss_until_out_a_missing_node_costs_one_frame() {
    let mut director = Director::new(Rules { misses_until_out: 1, ..rules(3) }, 9, Identity::default());
    (0..3).for_each(|node| director.hear(at(0), NodeId(node), hello(1, Epoch::NONE)));
    director.act(at(0));
    for number in 1..=3 {
        frame(&mut director, 10 * (number - 1), number, &[0, 1, 2]);
    }
    assert_eq!(skips(&frame(&mut director, 30, 4, &[0, 2])), [SkipReason::Deadline]);
    let committed = commits(&frame(&mut director, 40, 5, &[0, 2]));
    assert_eq!(committed.last().unwrap().mask, [0, 2].map(NodeId).into_iter().collect());
}

#[test]
fn a_node_that_is_always_a_little_late_is_left_out() {
    let mut director = running();
    for number in 4..=6 {
        let tick_ms = 10 * (number - 1);
        frame(&mut director, tick_ms, number, &[0, 2]);
        // After the deadline, before the next frame.
        director.hear(at(tick_ms + 9), NodeId(1), ready(FrameId { epoch: director.epoch(), number }));
    }
    director.act(at(60));
    assert_eq!((director.taking_part().len(), director.counts().ready_late), (2, 3));
}

#[test]
fn a_director_that_was_suspended_commits_nothing_old() {
    let mut director = running();
    let id = FrameId { epoch: director.epoch(), number: 4 };
    director.act(at(30));
    director.composed(at(30), id, Cue::default());
    director.act(at(30));
    // All votes came in time, but the director's process did not run.
    (0..3).for_each(|node| director.hear(at(39), NodeId(node), ready(id)));
    let actions = director.act(at(5_000));
    assert_eq!((commits(&actions).len(), skips(&actions)), (0, vec![SkipReason::Deadline]));
    // Votes that it finds in its queue are too late, and missed ticks are not made up for.
    assert!(actions.iter().any(|action| matches!(action, director::Action::Compose { id, .. } if id.number == 5)));
    director.hear(at(5_000), NodeId(0), ready(id));
    assert_eq!((director.counts().ready_late, director.counts().ticks_lost), (1, 496));
    assert_eq!(director.wake_at(), Some(5_008 * MS));
}

#[test]
fn a_state_is_repeated_to_nodes_that_are_not_ready_and_asks_for_ready_again() {
    let mut director = running();
    let id_4 = FrameId { epoch: director.epoch(), number: 4 };
    director.act(at(30));
    director.composed(at(30), id_4, Cue::default());
    director.act(at(30));
    director.hear(at(31), NodeId(1), ready(id_4));
    director.act(at(31));
    // Copies are sent at thirds of the deadline of 8 ms.
    for due_ns in [32_666_666, 35_333_333] {
        assert_eq!(director.wake_at(), Some(due_ns));
        let now = Now { monotonic_ns: due_ns, tai_ns: None };
        let actions = director.act(now);
        let to = |action: &director::Action| match action {
            director::Action::Send { to, message: ToNode::State(state) } if state.id == id_4 => to.0,
            _ => panic!("{action:?}"),
        };
        assert_eq!(actions.iter().map(to).collect::<Vec<_>>(), [0, 2]);
    }
    assert_eq!(director.wake_at(), Some(38 * MS));

    let mut node = led_node();
    assert!(draw(&mut node, id(1, 1), Some(28), 0, 3));
    node.hear(at(4), state(id(1, 1), Some(28)));
    assert!(matches!(&node.act(at(4))[..], [node::Action::Send(ToDirector::Ready(ready))] if ready.id == id(1, 1)));
    node.hear(at(5), commit(id(1, 1), Some(28), &[0]));
    node.hear(at(6), state(id(1, 1), Some(28)));
    assert_eq!(node.act(at(6)), []);
}

#[test]
fn a_cue_that_comes_too_late_is_not_sent_and_nobody_misses() {
    let mut director = running();
    let id = FrameId { epoch: director.epoch(), number: 4 };
    director.act(at(30));
    director.composed(at(39), id, Cue::default());
    director.composed(at(31), FrameId { number: 3, ..id }, Cue::default());
    let actions = director.act(at(39));
    assert!(!actions.iter().any(|action| matches!(action, director::Action::SendAll(ToNode::State(_)))));
    director.act(at(40));
    assert_eq!((director.counts().not_composed, director.taking_part().len()), (1, 3));
}

#[test]
fn a_higher_epoch_in_any_message_ends_a_director() {
    let higher = Epoch { counter: 2, run: 0 };
    for message in [hello(0, higher), ready(FrameId { epoch: higher, number: 1 })] {
        let mut director = running();
        director.hear(at(30), NodeId(0), message);
        assert_eq!(director.act(at(30)), [director::Action::Deposed { by: higher }]);
        director.hear(at(31), NodeId(0), hello(0, Epoch::NONE));
        director.lost(at(31), NodeId(1));
        assert_eq!((director.act(at(500)), director.wake_at()), (vec![], None));
    }
}

#[test]
fn a_frame_that_cannot_be_drawn_gets_no_vote_and_the_next_one_is_drawn() {
    let mut node = led_node();
    node.hear(at(0), state(id(1, 1), None));
    assert!(matches!(node.act(at(0))[..], [node::Action::Draw { .. }]));
    node.hear(at(10), state(id(1, 2), None));
    node.failed(at(11), id(1, 1));
    assert!(matches!(node.act(at(11))[..], [node::Action::Draw { id: drawn, .. }] if drawn == id(1, 2)));
    assert_eq!(node.counts().failed, 1);
    // A report about another frame changes nothing.
    node.failed(at(12), id(1, 1));
    assert_eq!(node.counts().failed, 1);
}

#[test]
fn an_unknown_node_that_votes_is_asked_for_its_hello() {
    let mut director = running();
    director.act(at(30));
    director.lost(at(30), NodeId(2));
    let own = director.epoch();
    let out = |why| ToNode::Out(Out { epoch: own, node: NodeId(2), why });
    assert_eq!(director.act(at(30)), [director::Action::SendAll(out(OutReason::Lost))]);
    let actions = frame(&mut director, 30, 4, &[0, 1, 2]);
    assert!(actions.contains(&director::Action::Send { to: NodeId(2), message: out(OutReason::Unknown) }));
    assert_eq!(commits(&actions)[0].mask.len(), 2);

    let mut node = led_node();
    let out = Out { epoch: epoch(1), node: NodeId(0), why: OutReason::Unknown };
    node.hear(at(200), ToNode::Out(out));
    assert!(matches!(node.act(at(200))[..], [node::Action::Send(ToDirector::Hello(_))]));
}

#[test]
fn a_repeated_hello_changes_nothing_and_a_new_process_joins_anew() {
    let mut director = running();
    director.act(at(30));
    director.hear(at(31), NodeId(1), hello(1, director.epoch()));
    assert_eq!(director.taking_part().len(), 3);
    director.hear(at(31), NodeId(1), hello(2, director.epoch()));
    assert_eq!(director.place(NodeId(1)), Some(&Place::Out { why: OutReason::Joining, ready: 0 }));
    let newest = director.act(at(31)).into_iter().rev().find_map(|action| match action {
        director::Action::Send { message: ToNode::Welcome(welcome), .. } => Some((welcome.run, welcome.newest)),
        _ => None,
    });
    assert_eq!(newest, Some((2, 4)));
}

#[test]
fn a_node_shows_a_committed_picture_at_its_time_and_no_other() {
    let mut node = led_node();
    assert!(draw(&mut node, id(1, 1), Some(28), 0, 3));
    // Without COMMIT nothing is shown.
    assert_eq!(node.act(at(28)), []);
    node.hear(at(28), commit(id(1, 1), Some(28), &[0, 1]));
    assert_eq!(node.act(at(29)), [node::Action::Show { id: id(1, 1) }]);
    assert!(draw(&mut node, id(1, 2), Some(58), 30, 33));
    node.hear(at(34), commit(id(1, 2), Some(58), &[1, 2]));
    assert_eq!(node.act(at(58)), [node::Action::Discard { id: id(1, 2) }]);
    assert!(draw(&mut node, id(1, 3), Some(88), 60, 63));
    node.hear(at(69), ToNode::Skip(Skip { id: id(1, 3), why: SkipReason::Deadline }));
    assert_eq!(node.act(at(69)), [node::Action::Discard { id: id(1, 3) }]);
    let counts = node.counts();
    assert_eq!((counts.shown, counts.left_out, counts.skipped), (1, 1, 1));
}

#[test]
fn a_late_commit_is_counted_and_not_shown() {
    let mut node = led_node();
    assert!(draw(&mut node, id(1, 1), Some(28), 0, 3));
    // The COMMIT is more than half a period late; a copy is not counted again.
    node.hear(at(34), commit(id(1, 1), Some(28), &[0]));
    node.hear(at(34), commit(id(1, 1), Some(28), &[0]));
    assert_eq!(node.act(at(34)), [node::Action::Discard { id: id(1, 1) }]);
    assert_eq!((node.counts().commit_late, node.counts().commit_without_picture), (1, 0));
    // A frame to be shown on receipt, whose COMMIT comes more than a period after READY.
    assert!(draw(&mut node, id(1, 2), None, 40, 43));
    node.hear(at(54), commit(id(1, 2), None, &[0]));
    assert_eq!(node.act(at(54)), [node::Action::Discard { id: id(1, 2) }]);
    assert!(draw(&mut node, id(1, 3), None, 60, 63));
    node.hear(at(72), commit(id(1, 3), None, &[0]));
    assert_eq!(node.act(at(72)), [node::Action::Show { id: id(1, 3) }]);
    // A COMMIT for a picture that does not exist.
    node.hear(at(80), commit(id(1, 4), Some(100), &[0]));
    assert_eq!((node.act(at(80)), node.counts().commit_without_picture), (vec![], 1));
}

#[test]
fn only_the_newest_state_of_a_queue_is_drawn() {
    let mut node = led_node();
    for number in [3, 1, 5, 4, 5] {
        node.hear(at(10), state(id(1, number), Some(60)));
    }
    let draws = node.act(at(10));
    assert!(matches!(draws[..], [node::Action::Draw { id: drawn, .. }] if drawn == id(1, 5)), "{draws:?}");
    // A newer STATE comes while the node draws: the old picture is not reported.
    node.hear(at(20), state(id(1, 6), Some(70)));
    node.drawn(at(21), id(1, 5), MS, Report::default());
    let actions = node.act(at(21));
    assert_eq!(actions[0], node::Action::Discard { id: id(1, 5) });
    assert!(matches!(actions[1..], [node::Action::Draw { id: drawn, .. }] if drawn == id(1, 6)), "{actions:?}");
    // A picture that was skipped in the meantime is not reported either.
    node.hear(at(22), ToNode::Skip(Skip { id: id(1, 6), why: SkipReason::Quorum }));
    node.drawn(at(23), id(1, 6), MS, Report::default());
    assert_eq!(node.act(at(23)), [node::Action::Discard { id: id(1, 6) }]);
    assert_eq!((node.counts().too_slow, node.counts().states_replaced), (2, 1));
}

#[test]
fn a_node_keeps_its_promise() {
    let mut node = led_node();
    assert!(draw(&mut node, id(1, 1), Some(28), 0, 3));
    node.hear(at(4), commit(id(1, 1), Some(28), &[0]));
    node.hear(at(4), state(id(1, 2), Some(38)));
    // Another director: frames of the first one are neither drawn nor shown.
    node.hear(at(5), ToNode::Welcome(Welcome { epoch: epoch(2), run: RUN, newest: 0 }));
    assert_eq!(node.act(at(5)), [node::Action::Remember(epoch(2)), node::Action::Discard { id: id(1, 1) }]);
    // The first director sends each kind of message again.
    node.hear(at(150), ToNode::Welcome(Welcome { epoch: epoch(1), run: RUN, newest: 2 }));
    node.hear(at(150), state(id(1, 3), Some(178)));
    node.hear(at(150), commit(id(1, 3), Some(178), &[0]));
    let actions = node.act(at(150));
    // The first director learns of the second one.
    let told = |action: &node::Action| matches!(action, node::Action::Send(ToDirector::Hello(hello)) if hello.promised == epoch(2));
    assert!(actions.len() == 1 && told(&actions[0]), "{actions:?}");
    assert_eq!((node.counts().lower_epoch, node.led_by()), (3, Some(epoch(2))));
    // After a restart the promise comes from disk.
    let mut node = Node::new(rules(3), NodeId(0), 78, epoch(2), Identity::default(), at(0));
    assert!(told(&node.act(at(0))[0]));
    node.hear(at(1), ToNode::Welcome(Welcome { epoch: epoch(1), run: 78, newest: 2 }));
    assert_eq!(node.led_by(), None);
}

#[test]
fn answers_to_an_earlier_process_and_frames_before_the_welcome_are_ignored() {
    let mut node = Node::new(rules(3), NodeId(0), RUN, Epoch::NONE, Identity::default(), at(0));
    node.hear(at(0), ToNode::Welcome(Welcome { epoch: epoch(1), run: RUN + 1, newest: 0 }));
    assert_eq!(node.led_by(), None);
    node.act(at(0));
    // A state of a director that has not answered yet is not drawn.
    node.hear(at(1), state(id(1, 8), Some(30)));
    assert_eq!(node.act(at(1)), []);
    node.hear(at(2), ToNode::Welcome(Welcome { epoch: epoch(1), run: RUN, newest: 8 }));
    node.hear(at(2), state(id(1, 8), Some(30)));
    assert_eq!(node.act(at(2)), [node::Action::Remember(epoch(1))]);
    node.hear(at(3), state(id(1, 9), Some(40)));
    assert!(matches!(node.act(at(3))[..], [node::Action::Draw { .. }]));
}

#[test]
fn pictures_in_hand_are_bounded() {
    let mut node = led_node();
    // 28 ms from tick to presentation at 10 ms per frame.
    assert_eq!(rules(3).pictures(), 4);
    for number in 1..=4 {
        assert!(draw(&mut node, id(1, number), None, number, number));
    }
    node.hear(at(5), state(id(1, 5), None));
    assert_eq!(node.act(at(5)), []);
    // Pictures without a verdict expire.
    let expires_ns = node.wake_at();
    assert_eq!(expires_ns, 39 * MS);
    let actions = node.act(at(39));
    assert_eq!(actions[0], node::Action::Discard { id: id(1, 1) });
    assert!(matches!(actions[1..], [node::Action::Draw { .. }]));
    assert_eq!(node.counts().without_verdict, 1);
}

#[test]
fn a_node_looks_for_a_director_after_a_silence() {
    let mut node = led_node();
    node.hear(at(50), state(id(1, 1), None));
    node.act(at(50));
    assert_eq!((node.act(at(1_049)), node.wake_at()), (vec![], 1_050 * MS));
    for ms in [1_050, 1_150, 1_250] {
        assert!(matches!(node.act(at(ms))[..], [node::Action::Send(ToDirector::Hello(_))]), "{ms}");
    }
    node.connected(at(1_260));
    assert!(matches!(node.act(at(1_260))[..], [node::Action::Send(ToDirector::Hello(_))]));
}

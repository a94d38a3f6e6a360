//! The runs of the benchmark. Each run disturbs some processes, and prints how long nodes and directors take to
//! continue.

use std::{error::Error, path::Path, sync::Arc, time::Duration};

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use steradian::service::{SceneUpdate, proto};

use crate::{
    Run,
    desktop::Desktop,
    events::Events,
    machine_clock::Disciplined,
    processes::{self, Cluster, Form, SKY_WIDTH, now_ns},
    report::{self, Spread, row},
    stamps::{self, Line, Verdict},
};

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Turn rate of the camera: it moves by some pixels per frame.
const TURN_RAD_S: f64 = 0.4;
/// Angle after which the camera jumps back.
const SWEEP_RAD: f64 = 0.5;
/// Gaps that begin within this time after a fault are attributed to it, ns.
const EFFECT_NS: u64 = 2_000_000_000;
/// Time for which a director is stopped before another one is started. It is longer than the lease of a connection.
const STOPPED: Duration = Duration::from_millis(2_500);

/// A fault. `host` is empty if it concerns all hosts; `at_ns` is the time at which the host was disturbed, and
/// `until_ns` the time from which it could continue.
struct Fault {
    host: String,
    at_ns: u64,
    until_ns: u64,
}

struct Random(ChaCha8Rng);

impl Random {
    fn seconds(&mut self, from: f64, to: f64) -> Duration {
        Duration::from_secs_f64(self.0.random_range(from..to))
    }

    fn node(&mut self, cluster: &Cluster) -> String {
        cluster.nodes[self.0.random_range(0..cluster.nodes.len())].clone()
    }
}

/// Starts all processes, waits until all take part, and then changes the scene, so that a process that starts again has
/// to fetch it.
async fn begin(cluster: &mut Cluster) -> Outcome<()> {
    cluster.start("d0")?;
    for node in cluster.nodes.clone() {
        cluster.start(&node)?;
    }
    cluster.all_in("d0").await?;
    let revision = change_scene(cluster, "d0").await?;
    cluster.until("d0", "leading the changed scene", |stats| stats.scene_revision >= revision).await?;
    cluster.all_in("d0").await?;
    tokio::time::sleep(Duration::from_secs(1)).await;
    Ok(())
}

/// Gives the director a scene that differs from the configuration; returns the revision of the scene.
async fn change_scene(cluster: &Cluster, director: &str) -> Outcome<u64> {
    let update = SceneUpdate { magnitude_limit: Some(7.25), ..SceneUpdate::default() };
    Ok(cluster.client(director).await?.update_scene(&update, None).await?.revision)
}

/// Carries out a run and prints its figures.
pub async fn run(
    cluster: &mut Cluster,
    form: &Form,
    run: Run,
    (desktop, clock, loss): (Option<Desktop>, Option<&Disciplined>, Option<u32>),
    seed: u64,
) -> Outcome<()> {
    // Keep the display of the windows until the end of the run.
    let desktop = desktop.map(Arc::new);
    let mut random = Random(ChaCha8Rng::seed_from_u64(seed));
    begin(cluster).await?;
    if let Some(loss) = loss {
        cluster.network.lose(loss)?;
        tokio::time::sleep(Duration::from_secs(1)).await;
    }
    let from_ns = now_ns();
    let mut leader = "d0";
    let faults = match run {
        Run::Steady { frames } => steady(cluster, form, frames, desktop.as_ref()).await?,
        Run::Kills { count, one_at_a_time } => kills(cluster, &mut random, count, one_at_a_time).await?,
        Run::Hangs { count } => hangs(cluster, &mut random, count).await?,
        Run::ClockSteps { count } => {
            clock_steps(cluster, &mut random, clock.ok_or("clock-steps needs --disciplined")?, count).await?
        }
        Run::DirectorKills { count } => director_kills(cluster, &mut random, count).await?,
        Run::OldDirector { count } => {
            let faults = old_directors(cluster, &mut random, count).await?;
            leader = if count % 2 == 0 { "d0" } else { "d1" };
            faults
        }
        Run::Report { .. } | Run::Wire(_) | Run::WireProcess(_) => return Ok(()),
        Run::Partition { seconds } => return partition(cluster, Duration::from_secs_f64(seconds)).await,
    };
    let until_ns = now_ns();
    // Wait until all nodes take part with the same scene.
    let stats = cluster.all_in(leader).await?;
    cluster.end();
    let events = Events::read(&cluster.lives)?.within(from_ns, until_ns);
    report::print(&events, &cluster.lives, form.nodes, form.backlog_ns());
    row("nodes with the scene of the director at the end", format!("{} of {}", stats.nodes.len(), form.nodes));
    row("network threads with real-time scheduling", stats.real_time);
    row("frames have presentation times at the end of the run", stats.locked);
    print_faults(cluster, &events, &faults, matches!(run, Run::DirectorKills { .. } | Run::OldDirector { .. }));
    if let Run::OldDirector { .. } = run {
        print_epochs(&events, &faults);
    }
    Ok(())
}

async fn steady(cluster: &Cluster, form: &Form, frames: u64, desktop: Option<&Arc<Desktop>>) -> Outcome<Vec<Fault>> {
    let length = Duration::from_secs_f64(frames as f64 / form.rate_hz);
    let before = cluster.stats("d0").await?;
    match desktop {
        None => tokio::time::sleep(length).await,
        Some(desktop) => read_windows(cluster, Arc::clone(desktop), length).await?,
    }
    let after = cluster.stats("d0").await?;
    let since = |name: &str| after.counts.get(name).unwrap_or(&0) - before.counts.get(name).unwrap_or(&0);
    for name in ["ticks_lost", "ready_late", "out", "unsent"] {
        row(&format!("director: {name}"), since(name));
    }
    Ok(Vec::new())
}

/// Reads all windows for a time while the camera turns, and prints figures about the frames that they showed.
async fn read_windows(cluster: &Cluster, desktop: Arc<Desktop>, length: Duration) -> Outcome<()> {
    desktop.park_pointer([1500, 850]);
    let turning = tokio::spawn(stamps::turn(cluster.client("d0").await?, TURN_RAD_S, SWEEP_RAD));
    tokio::time::sleep(Duration::from_secs(1)).await;
    let windows = u16::try_from(cluster.nodes.len())?;
    let line = Line { width: SKY_WIDTH, windows, rows: [8, 8] };
    let samples = tokio::task::spawn_blocking(move || stamps::samples(&desktop, line, length)).await?;
    let verdict = Verdict::of(&samples, &(0..usize::from(windows)).collect::<Vec<_>>());
    let with_star = samples.iter().filter(|sample| sample.columns.iter().all(Option::is_some)).count();
    row("images of all windows per second", format!("{:.0}", samples.len() as f64 / length.as_secs_f64()));
    row("images with the star in every window", format!("{with_star} of {}", samples.len()));
    row("frames seen in all windows at once", verdict.frames);
    row("changes of frame during which windows differed", verdict.transitions);
    row("of these, changes that lasted 5 ms or longer", verdict.longer_than(5.0));
    row("duration of these changes, ms", Spread::of_ns(verdict.lasted_ms.iter().map(|ms| (ms * 1e6) as u64)));
    row("frames that only some windows showed", verdict.mixed);
    turning.abort();
    Ok(())
}

async fn kills(cluster: &mut Cluster, random: &mut Random, count: u32, one_at_a_time: bool) -> Outcome<Vec<Fault>> {
    let mut faults = Vec::new();
    for _ in 0..count {
        tokio::time::sleep(random.seconds(0.5, 3.0)).await;
        // Wait for enough nodes, because otherwise slow starts could leave fewer than a majority.
        let least = if one_at_a_time { cluster.nodes.len() } else { cluster.nodes.len() / 2 + 2 };
        let is_in = |node: &&proto::ClusterNodeStats| node.state == "in";
        cluster.until("d0", "with a spare node", |stats| stats.nodes.iter().filter(is_in).count() >= least).await?;
        let host = random.node(cluster);
        let at_ns = cluster.kill(&host)?;
        tokio::time::sleep(random.seconds(0.1, 1.0)).await;
        let until_ns = now_ns();
        cluster.start(&host)?;
        faults.push(Fault { host, at_ns, until_ns });
    }
    tokio::time::sleep(Duration::from_secs(3)).await;
    Ok(faults)
}

async fn hangs(cluster: &mut Cluster, random: &mut Random, count: u32) -> Outcome<Vec<Fault>> {
    let mut faults = Vec::new();
    for _ in 0..count {
        tokio::time::sleep(random.seconds(1.0, 3.0)).await;
        let host = random.node(cluster);
        let at_ns = cluster.stop(&host)?;
        tokio::time::sleep(random.seconds(0.2, 5.0)).await;
        let until_ns = cluster.resume(&host)?;
        faults.push(Fault { host, at_ns, until_ns });
    }
    tokio::time::sleep(Duration::from_secs(3)).await;
    Ok(faults)
}

/// Sets the machine's clock, waits, and sets it back; all processes have the same clock.
async fn clock_steps(cluster: &Cluster, random: &mut Random, clock: &Disciplined, count: u32) -> Outcome<Vec<Fault>> {
    let mut hosts = vec!["d0".to_owned()];
    hosts.extend(cluster.nodes.clone());
    let noticed = async |name: &str| -> Outcome<Vec<u64>> {
        let mut counts = Vec::new();
        for host in &hosts {
            counts.push(*cluster.stats(host).await?.counts.get(name).unwrap_or(&0));
        }
        Ok(counts)
    };
    cluster.until("d0", "locked", |stats| stats.locked).await?;
    let (before, receipt) = (noticed("clock_steps").await?, noticed("committed_on_receipt").await?[0]);
    let (mut faults, mut green_ns) = (Vec::new(), Vec::new());
    for _ in 0..count {
        tokio::time::sleep(random.seconds(0.5, 2.0)).await;
        let size_ns = i64::try_from(random.seconds(0.05, 0.5).as_nanos())?;
        let size_ns = if random.0.random::<bool>() { size_ns } else { -size_ns };
        let at_ns = now_ns();
        clock.step(size_ns)?;
        tokio::time::sleep(random.seconds(0.5, 3.0)).await;
        let until_ns = now_ns();
        clock.step(-size_ns)?;
        cluster.until("d0", "not locked", |stats| !stats.locked).await?;
        cluster.until("d0", "locked again", |stats| stats.locked).await?;
        green_ns.push(now_ns() - until_ns);
        faults.push(Fault { host: String::new(), at_ns, until_ns });
    }
    let (after, on_receipt) = (noticed("clock_steps").await?, noticed("committed_on_receipt").await?[0]);
    let least = after.iter().zip(&before).map(|(after, before)| after - before).min().unwrap_or(0);
    row("steps made, and the fewest that a process has noticed", format!("{}, {least}", 2 * count));
    row("frames committed without a time of presentation", on_receipt - receipt);
    row("from the last step until the cluster is locked again, ms", Spread::of_ns(green_ns));
    Ok(faults)
}

async fn director_kills(cluster: &mut Cluster, random: &mut Random, count: u32) -> Outcome<Vec<Fault>> {
    let mut faults = Vec::new();
    for _ in 0..count {
        tokio::time::sleep(random.seconds(1.0, 4.0)).await;
        let at_ns = cluster.kill("d0")?;
        tokio::time::sleep(random.seconds(0.1, 1.0)).await;
        let until_ns = now_ns();
        cluster.start("d0")?;
        cluster.all_in("d0").await?;
        faults.push(Fault { host: "d0".to_owned(), at_ns, until_ns });
    }
    tokio::time::sleep(Duration::from_secs(3)).await;
    Ok(faults)
}

/// Stops the director that leads, starts the other one, and resumes the first, which is ended when it is deposed.
async fn old_directors(cluster: &mut Cluster, random: &mut Random, count: u32) -> Outcome<Vec<Fault>> {
    let mut faults = Vec::new();
    for round in 0..count {
        let (old, new) = if round % 2 == 0 { ("d0", "d1") } else { ("d1", "d0") };
        tokio::time::sleep(random.seconds(1.0, 3.0)).await;
        let at_ns = cluster.stop(old)?;
        tokio::time::sleep(STOPPED).await;
        cluster.start(new)?;
        cluster.all_in(new).await?;
        tokio::time::sleep(random.seconds(0.5, 2.0)).await;
        let until_ns = cluster.resume(old)?;
        cluster.until(old, "deposed", |stats| stats.state == "deposed").await?;
        tokio::time::sleep(random.seconds(1.0, 2.0)).await;
        cluster.kill(old)?;
        faults.push(Fault { host: old.to_owned(), at_ns, until_ns });
    }
    Ok(faults)
}

/// Prints the figures from the logs that a run has kept.
pub fn report_logs(folder: &Path, form: &Form, skip_s: f64, frames: u64) -> Outcome<()> {
    let lives = processes::lives(folder)?;
    let events = Events::read(&lives)?;
    let times = events.frames.iter().filter(|(name, _)| name.number <= frames).filter_map(|(_, frame)| frame.state_ns);
    let times: Vec<u64> = times.collect();
    let first_ns = times.iter().min().ok_or("no frame in the logs")?;
    let events = events.within(first_ns + (skip_s * 1e9) as u64, *times.iter().max().unwrap_or(first_ns));
    report::print(&events, &lives, form.nodes, form.backlog_ns());
    Ok(())
}

fn print_faults(cluster: &Cluster, events: &Events, faults: &[Fault], are_of_directors: bool) {
    if faults.is_empty() {
        return;
    }
    let gaps = report::gaps(events, &cluster.lives);
    let longest = faults.iter().filter_map(|fault| report::longest_after(&gaps, fault.at_ns, EFFECT_NS));
    row(&format!("longest gap of the other nodes after each of {} faults, ms", faults.len()), Spread::of_ns(longest));
    // Print the gaps before the restart separately: a process that starts again competes with the others for the cores
    // of this machine, whereas in a theatre it has its own machine.
    let before =
        faults.iter().filter_map(|fault| report::longest_after(&gaps, fault.at_ns, fault.until_ns - fault.at_ns));
    row("of these, gaps that began before the disturbed process was started or resumed, ms", Spread::of_ns(before));
    if faults.iter().all(|fault| fault.host.is_empty()) {
        return;
    }
    // Recovery from the end of a director is complete when all nodes have shown a frame of the next director.
    let back = faults.iter().map(|fault| {
        let next = |node: &str| {
            let after = if are_of_directors { fault.at_ns + 200_000_000 } else { fault.until_ns };
            events.shown.iter().filter(|shown| shown.node == node && shown.at_ns > after).map(|shown| shown.at_ns).min()
        };
        if are_of_directors {
            cluster.nodes.iter().map(|node| next(node)).max().flatten().map(|at_ns| at_ns - fault.at_ns)
        } else {
            next(&fault.host).map(|at_ns| at_ns - fault.until_ns)
        }
    });
    let back: Vec<Option<u64>> = back.collect();
    let what = if are_of_directors {
        "from the fault until all nodes show frames again"
    } else {
        "from start or resumption to the node's next frame"
    };
    row(&format!("{what}, ms"), Spread::of_ns(back.iter().flatten().copied()));
    row("faults after which the node shows no more frames", back.iter().filter(|back| back.is_none()).count());
}

fn print_epochs(events: &Events, faults: &[Fault]) {
    let epochs = report::epochs(events);
    row("epochs that committed frames", epochs.iter().filter(|(_, committed, _)| *committed > 0).count());
    // After a director was resumed, its epoch must neither commit nor show a frame.
    let mut late = 0;
    for fault in faults {
        let before = events.committed().into_iter().rfind(|(.., at_ns)| *at_ns < fault.at_ns);
        let Some((name, ..)) = before else { continue };
        let is_old = |epoch: (u64, u64)| epoch == name.epoch;
        late += events.committed().iter().filter(|(name, .., at)| is_old(name.epoch) && *at > fault.until_ns).count();
        late += events.shown.iter().filter(|shown| is_old(shown.frame.epoch) && shown.at_ns > fault.until_ns).count();
    }
    row("frames of an old director committed or shown after it was resumed", late);
}

/// Measures four parts. First one director leads all nodes. Then half of the nodes reach each director, then one node
/// more reaches the second director. In the end, all nodes reach both directors.
async fn partition(cluster: &mut Cluster, length: Duration) -> Outcome<()> {
    let half = cluster.nodes.len() / 2;
    let nodes = cluster.nodes.clone();
    let mut parts: Vec<(String, u64, u64)> = Vec::new();
    let mut part = |name: String, from_ns: u64| parts.push((name, from_ns, now_ns()));

    let from_ns = now_ns();
    tokio::time::sleep(length).await;
    part("all nodes reach the first director".to_owned(), from_ns);

    for (index, node) in nodes.iter().enumerate() {
        cluster.network.cut_off(node, &[if index < half { 1 } else { 0 }])?;
    }
    cluster.start("d1")?;
    let from_ns = now_ns();
    tokio::time::sleep(length).await;
    part(format!("{half} reach the first, {} the second", nodes.len() - half), from_ns);

    cluster.network.cut_off(&nodes[half - 1], &[0])?;
    let from_ns = now_ns();
    tokio::time::sleep(length).await;
    part(format!("{} reach the first, {} the second", half - 1, nodes.len() - half + 1), from_ns);

    for node in &nodes {
        cluster.network.cut_off(node, &[])?;
    }
    let from_ns = now_ns();
    tokio::time::sleep(length).await;
    part("all reach both".to_owned(), from_ns);

    let states = [cluster.stats("d0").await?, cluster.stats("d1").await?];
    cluster.end();
    let events = Events::read(&cluster.lives)?;
    let mut known: Vec<(u64, u64)> = report::epochs(&events).iter().map(|(epoch, ..)| *epoch).collect();
    known.sort_unstable();
    println!("| part | seconds | frames committed and shown by epoch |");
    println!("|---|---|---|");
    for (name, from_ns, until_ns) in &parts {
        // The first two seconds are the transition.
        let settled = events.within(from_ns + 2_000_000_000, *until_ns);
        let epochs = report::epochs(&settled);
        let texts: Vec<String> = epochs
            .iter()
            .map(|((counter, _), committed, shown)| format!("{counter}: {committed} committed, {shown} shown"))
            .collect();
        let texts = if texts.is_empty() { "none".to_owned() } else { texts.join("; ") };
        println!("| {name} | {:.1} | {texts} |", (until_ns - from_ns) as f64 * 1e-9 - 2.0);
        row(&format!("{name}: frames shown after one of a later epoch"), report::alternations(&settled.shown));
    }
    row("whole run: frames shown after one of a later epoch", report::alternations(&events.shown));
    row("state of the directors at the end", format!("{}, {}", states[0].state, states[1].state));
    Ok(())
}

//! Runs the checks of `verify` through the daemon.

use std::sync::atomic::Ordering::SeqCst;

use steradian::{
    output::Encoding,
    plan::settings::StarMethod,
    service::{SceneUpdate, proto::verify_result::Outcome},
    verify,
};
use tonic::Code;

use crate::daemon::{Daemon, small_rig, until, within};

#[tokio::test]
async fn results_include_their_values() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let mut results = client.verify("", "").await.unwrap();
    for check in verify::checks() {
        let result = within(results.next()).await.unwrap().expect("a result per check");
        assert_eq!((result.name.as_str(), result.number), (check.name, check.number.map(u32::from)));
        assert_eq!(result.group, check.group);
        match check.number {
            Some(1) => {
                let figure = &result.figures[0];
                assert_eq!((result.outcome(), figure.pass, figure.limit), (Outcome::Fail, false, Some(0.25)));
            }
            Some(2) => assert_eq!(
                (result.outcome(), result.message.as_str(), result.figures.len()),
                (Outcome::NotApplicable, "no stars", 0)
            ),
            _ => {
                assert_eq!((result.outcome(), result.message.as_str()), (Outcome::Pass, ""));
                let figures: Vec<_> =
                    result.figures.iter().map(|f| (f.what.as_str(), f.measured, f.limit, f.unit.as_str())).collect();
                assert_eq!(figures, [("right", 0.125, Some(0.25), "px"), ("seen", 3.0, None, "")]);
            }
        }
    }
    assert!(within(results.next()).await.unwrap().is_none());
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn the_named_or_current_method_is_tested() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let tent = SceneUpdate { star_method: Some(StarMethod::Tent), ..SceneUpdate::default() };
    client.update_scene(&tent, None).await.unwrap();
    for (method, expected) in [("", StarMethod::Tent), ("packed_cas", StarMethod::PackedCas)] {
        // The previous call ends a little later, and until then calls are refused.
        let mut results = within(async {
            loop {
                match client.verify("slow-pan", method).await {
                    Ok(results) => break results,
                    Err(error) => assert_eq!(error.code(), Some(Code::ResourceExhausted), "{error}"),
                }
            }
        })
        .await;
        assert_eq!(within(results.next()).await.unwrap().expect("a result").number, Some(10));
        assert!(within(results.next()).await.unwrap().is_none());
        assert_eq!(daemon.controls.checked.lock().unwrap().last(), Some(&expected));
    }
    client.render_frame("flat", Encoding::Rgba8).await.unwrap();
    assert_eq!(daemon.controls.drawn.lock().unwrap()[0].0, StarMethod::Tent, "frames keep their method");
    for (filter, method, part) in [("nothing", "", "slow-pan-flicker"), ("", "dots", "packed_cas")] {
        let error = client.verify(filter, method).await.unwrap_err();
        assert!(error.code() == Some(Code::InvalidArgument) && error.to_string().contains(part), "{error}");
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn frames_continue_during_a_check_and_runs_are_exclusive() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    daemon.controls.close_checks();
    let mut results = client.verify("", "").await.unwrap();
    until(|| daemon.controls.checks_started.load(SeqCst) == 1).await;
    let second = client.verify("", "").await.unwrap_err();
    assert_eq!(second.code(), Some(Code::ResourceExhausted), "{second}");
    // The first check is still running.
    let mut other = daemon.client().await;
    within(other.render_frame("flat", Encoding::Rgba8)).await.unwrap();
    assert!(daemon.controls.checked.lock().unwrap().is_empty());
    daemon.controls.open_checks();
    let mut count = 0;
    while within(results.next()).await.unwrap().is_some() {
        count += 1;
    }
    assert_eq!(count, verify::checks().len());
    daemon.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_end_of_the_caller_or_the_daemon_ends_the_run() {
    let mut daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    daemon.controls.close_checks();
    let run = client.verify("", "").await.unwrap();
    until(|| daemon.controls.checks_started.load(SeqCst) == 1).await;
    drop(run);
    tokio::time::sleep(std::time::Duration::from_millis(100)).await;
    daemon.controls.open_checks();
    let mut results = within(async {
        loop {
            match client.verify("", "").await {
                Ok(results) => break results,
                Err(error) => assert_eq!(error.code(), Some(Code::ResourceExhausted), "{error}"),
            }
        }
    })
    .await;
    assert!(daemon.controls.checks_started.load(SeqCst) < verify::checks().len() as u64);
    within(results.next()).await.unwrap().expect("a result");
    daemon.controls.close_checks();
    daemon.begin_shutdown();
    let controls = std::sync::Arc::clone(&daemon.controls);
    let end = within(async {
        loop {
            controls.open_checks();
            match results.next().await {
                Ok(Some(_)) => {}
                other => break other,
            }
        }
    })
    .await;
    // All results may already have been in transit.
    if let Err(error) = end {
        assert_eq!(error.code(), Some(Code::Unavailable), "{error}");
    }
    drop((client, results));
    daemon.end().await.unwrap();
}

#[tokio::test]
async fn the_second_device_is_closed_when_it_has_no_work() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let open = || daemon.controls.beside_open.load(SeqCst);
    assert_eq!(open(), 0);
    for _ in 0..2 {
        let mut results = within(async {
            loop {
                // The previous call ends a little later, and until then calls are refused.
                match client.verify("slow-pan", "").await {
                    Ok(results) => break results,
                    Err(error) => assert_eq!(error.code(), Some(Code::ResourceExhausted), "{error}"),
                }
            }
        })
        .await;
        while within(results.next()).await.unwrap().is_some() {
            assert_eq!(open(), 1, "one device must serve all checks of a run");
        }
        until(|| open() == 0).await;
    }
    daemon.shutdown().await.unwrap();
}

//! Messages with information about the daemon and results of failure tests.

use crate::{
    gpu::AdapterReport,
    plan::settings::{ImpostorMethod, StarMethod},
    service::proto,
    verify::{CheckResult, Outcome},
};

pub(crate) fn info_to_pb(
    adapter: &AdapterReport,
    stars: u64,
    scene_revision: u64,
    frames_rendered: u64,
) -> proto::Info {
    proto::Info {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        adapter: adapter.adapter.clone(),
        driver: adapter.driver.clone(),
        backend: adapter.backend.clone(),
        device_type: adapter.device_type.clone(),
        features: adapter.features.clone(),
        limits: adapter.limits.iter().cloned().collect(),
        fallbacks: adapter.fallbacks.clone(),
        stars,
        scene_revision,
        frames_rendered,
        headset: None,
        star_methods: StarMethod::ALL.iter().map(|method| method.name().to_owned()).collect(),
        impostor_methods: ImpostorMethod::ALL.iter().map(|method| method.name().to_owned()).collect(),
        role: String::new(),
    }
}

pub(crate) fn check_to_pb(result: CheckResult) -> proto::VerifyResult {
    use proto::verify_result::Outcome as Wire;
    let outcome = match result.outcome {
        Outcome::Pass => Wire::Pass,
        Outcome::Fail => Wire::Fail,
        Outcome::NotApplicable => Wire::NotApplicable,
    };
    let figure = |figure: crate::verify::Figure| proto::VerifyFigure {
        what: figure.what,
        measured: figure.measured,
        limit: figure.limit,
        unit: figure.unit.to_owned(),
        pass: figure.pass,
    };
    proto::VerifyResult {
        number: result.number.map(u32::from),
        name: result.name.to_owned(),
        group: result.group.to_owned(),
        outcome: outcome.into(),
        figures: result.figures.into_iter().map(figure).collect(),
        message: result.message.unwrap_or_default(),
        seconds: result.seconds,
    }
}

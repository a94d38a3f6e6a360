//! Turns the audits of a command's frames into warnings and a failure.

use super::CliError;
use crate::{
    plan::{
        FramePlan,
        audit::{Audit, ImageAudit},
    },
    render::Frame,
};

/// Returns an error if an audit found an image beyond its error budget; logs a warning for everything that was not
/// audited.
pub(super) fn check(frames: &[Frame]) -> Result<(), CliError> {
    let plans = frames.iter().flat_map(|frame| [Some(&frame.plan), frame.hdr_plan.as_ref()]).flatten();
    check_plans(plans)
}

fn check_plans<'a>(plans: impl Iterator<Item = &'a FramePlan>) -> Result<(), CliError> {
    let audits: Vec<&Audit> = plans.filter_map(|plan| plan.audit.as_ref()).collect();
    for unaudited in audits.iter().flat_map(|audit| &audit.not_audited) {
        tracing::warn!("not audited: {unaudited}");
    }
    let broken: Vec<String> = audits.iter().flat_map(|audit| audit.broken()).map(ImageAudit::in_words).collect();
    if broken.is_empty() { Ok(()) } else { Err(CliError::Audit(broken)) }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed precondition of a test may panic")]
mod tests {
    use super::*;
    use crate::plan::audit::{AuditedOutput, WorstPixel};

    fn plan(within_budget: bool) -> FramePlan {
        let worst = WorstPixel {
            x: 12,
            y: 34,
            place: "in the dark sky",
            towards: [0.0, 0.0, 1.0],
            channel: "G",
            drawn: 9.0,
            exact: 4.25,
        };
        let image = ImageAudit {
            view: "eyes".to_owned(),
            part: Some("left".to_owned()),
            output: AuditedOutput::Display,
            pixels: 300,
            left_out: 2,
            error_999: 4.0,
            largest: 4.25,
            budget: 0.6,
            most: 2.1,
            unit: AuditedOutput::Display.unit(),
            within_budget,
            worst: Some(worst),
        };
        FramePlan { audit: Some(Audit { images: vec![image], not_audited: Vec::new() }), ..FramePlan::default() }
    }

    #[test]
    fn broken_budget_fails_the_job_and_names_image_and_pixel() {
        check_plans([FramePlan::default(), plan(true)].iter()).unwrap();
        let error = check_plans([plan(true), plan(false)].iter()).unwrap_err();
        assert_eq!(error.exit_code(), super::super::error::FAILED);
        let text = error.to_string();
        for part in
            ["eyes.left (display)", "(12, 34), in the dark sky, G", "drawn 9.00, in f64 4.25", "files are written"]
        {
            assert!(text.contains(part), "{text}");
        }
    }
}

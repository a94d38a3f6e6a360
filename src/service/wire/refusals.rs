//! Error statuses with details that programs can read: the text states the problem and the valid values; the details
//! (`google.rpc`) name the field, the revision, the limit, or the holder of the lease.

use std::collections::HashMap;

use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt as _};

/// Domain of the reasons in [`ErrorDetails`].
const DOMAIN: &str = "steradian";

/// A request that is invalid in every state of the daemon. If the text starts with a key and a colon or an equals sign,
/// the details name that key as the field.
pub(crate) fn invalid(problem: impl Into<String>) -> Status {
    let problem = with_short_numbers(problem.into());
    let Some(field) = field_of(&problem) else { return Status::invalid_argument(problem) };
    let details = ErrorDetails::with_bad_request_violation(field, problem.clone());
    Status::with_error_details(Code::InvalidArgument, problem, details)
}

/// Digits of a number that is written in full; longer ones are written with an exponent.
const MOST_DIGITS: usize = 21;

/// Writes very large and very small numbers of a text with an exponent, except within names in backquotes.
fn with_short_numbers(text: String) -> String {
    let is_number = |c: char| c.is_ascii_digit() || c == '.';
    if text.split(|c| !is_number(c)).all(|number| number.len() <= MOST_DIGITS) {
        return text;
    }
    let short = |part: &str| {
        let mut written = String::new();
        let mut rest = part;
        while let Some(start) = rest.find(|c: char| c.is_ascii_digit()) {
            let (before, from) = rest.split_at(start);
            let number = from[..from.find(|c| !is_number(c)).unwrap_or(from.len())].trim_end_matches('.');
            let after = &from[number.len()..];
            let value = number.parse::<f64>().ok().filter(|_| number.len() > MOST_DIGITS);
            written += before;
            written += &value.map_or_else(|| number.to_owned(), |value| format!("{value:e}"));
            rest = after;
        }
        written + rest
    };
    let parts = text.split('`').enumerate();
    let parts: Vec<String> = parts.map(|(i, part)| if i % 2 == 0 { short(part) } else { part.to_owned() }).collect();
    parts.join("`")
}

/// Returns the key at the start of a text.
fn field_of(problem: &str) -> Option<String> {
    let end = problem.find([':', '='])?;
    let key = problem[..end].trim_end();
    let is_key = |c: char| c.is_ascii_alphanumeric() || "_.-[]`".contains(c);
    // Matches `views.dome: ...`, `radius_deg = 3: ...` or ``bodies.`a`: ...``, but no sentence.
    (!key.is_empty() && key.chars().all(is_key)).then(|| key.replace('`', ""))
}

/// An item has another revision than the change was made for.
pub(crate) fn revision(problem: String, of: &str, expected: u64, found: u64) -> Status {
    let metadata = [("of", of.to_owned()), ("expected", expected.to_string()), ("found", found.to_string())];
    let metadata: HashMap<String, String> = metadata.map(|(key, value)| (key.to_owned(), value)).into();
    let details = ErrorDetails::with_error_info("REVISION", DOMAIN, metadata);
    Status::with_error_details(Code::Aborted, problem, details)
}

/// Another client holds the lease of the camera.
pub(crate) fn leased(problem: String, holder: &str) -> Status {
    let details = ErrorDetails::with_precondition_failure_violation("LEASE", holder, problem.clone());
    Status::with_error_details(Code::FailedPrecondition, problem, details)
}

/// A shared resource, or the client's share of it, is exhausted.
pub(crate) fn exhausted(of: &str, problem: impl Into<String>) -> Status {
    let problem = problem.into();
    let details = ErrorDetails::with_quota_failure_violation(of, problem.clone());
    Status::with_error_details(Code::ResourceExhausted, problem, details)
}

/// No item of a kind has this name.
pub(crate) fn absent(kind: &str, name: &str, problem: String) -> Status {
    let details = ErrorDetails::with_resource_info(kind, name, "", problem.clone());
    Status::with_error_details(Code::NotFound, problem, details)
}

/// An item of a kind with this name exists already.
pub(crate) fn present(kind: &str, name: &str, problem: String) -> Status {
    let details = ErrorDetails::with_resource_info(kind, name, "", problem.clone());
    Status::with_error_details(Code::AlreadyExists, problem, details)
}

/// The caller lacks the role that a call requires.
pub(crate) fn denied(problem: String, role: &str, needed: &str) -> Status {
    let metadata = HashMap::from([("role".to_owned(), role.to_owned()), ("needed".to_owned(), needed.to_owned())]);
    let details = ErrorDetails::with_error_info("ROLE", DOMAIN, metadata);
    Status::with_error_details(Code::PermissionDenied, problem, details)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;

    #[test]
    fn details_name_the_field_if_the_text_does() {
        for (problem, field) in [
            ("radius_deg = 11: allowed is up to 10", Some("radius_deg")),
            ("bodies.`mars`.radii_m: needed are three", Some("bodies.mars.radii_m")),
            ("exposure.mode: unknown", Some("exposure.mode")),
            ("the scene cannot be drawn: why", None),
            ("no key at all", None),
            (": nothing", None),
        ] {
            let status = invalid(problem);
            assert_eq!((status.code(), status.message()), (Code::InvalidArgument, problem));
            let found = status.get_details_bad_request().map(|request| request.field_violations[0].field.clone());
            assert_eq!(found.as_deref(), field, "{problem}");
        }
    }

    #[test]
    fn extreme_numbers_are_short_and_names_stay_as_they_are() {
        let digits = "1".repeat(30);
        for (problem, short) in [
            (
                format!("radius_deg = {}: must be at most 180", 1e308),
                "radius_deg = 1e308: must be at most 180".to_owned(),
            ),
            (format!("a: {}: must be above 0", 5e-324), "a: 5e-324: must be above 0".to_owned()),
            (format!("a: [-{}, 0.25]", f64::MAX), "a: [-1.7976931348623157e308, 0.25]".to_owned()),
            (format!("view `{digits}` and {digits}"), format!("view `{digits}` and 1.111111111111111e29")),
            (format!("a: must be below {}.", 1e30), "a: must be below 1e30.".to_owned()),
            ("a: 12345678901234567890".to_owned(), "a: 12345678901234567890".to_owned()),
        ] {
            assert_eq!(invalid(problem).message(), short);
        }
    }

    #[test]
    fn details_state_revisions_leases_limits_and_roles() {
        let status = revision("the scene has revision 4, not 3".to_owned(), "scene", 3, 4);
        let info = status.get_details_error_info().unwrap();
        assert_eq!(
            (status.code(), info.reason.as_str(), info.metadata["found"].as_str()),
            (Code::Aborted, "REVISION", "4")
        );
        let status = leased("`desk` steers".to_owned(), "desk");
        assert_eq!(status.get_details_precondition_failure().unwrap().violations[0].subject, "desk");
        let status = exhausted("streams", "there are 256 streams already");
        assert_eq!(status.get_details_quota_failure().unwrap().violations[0].subject, "streams");
        let status = absent("view", "dome", "no view `dome`".to_owned());
        assert_eq!(status.get_details_resource_info().unwrap().resource_name, "dome");
        let status = denied("`a` has the role view".to_owned(), "view", "steer");
        assert_eq!(status.get_details_error_info().unwrap().metadata["needed"], "steer");
    }
}

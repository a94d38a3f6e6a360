//! Error statuses with details that programs can read: the text states the problem and the valid values; the details
//! (`google.rpc`) name the field, the revision, the limit, or the holder of the lease.
//!
//! A status is sent as headers: the text in one of them, text and details in another. Many clients and proxies accept at most 4 or 8 KiB of headers,
//! and end the whole connection if there are more. [`bounded`] and all functions here keep a status below [`MOST_ENCODED`].

use std::collections::HashMap;

use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt as _};

use crate::service::scene::excerpts::{encoded_length, end_of, excerpt, start_of};

/// Domain of the reasons in [`ErrorDetails`].
const DOMAIN: &str = "steradian";

/// Maximum size of text and details in the headers of an answer, bytes.
pub(crate) const MOST_ENCODED: usize = 3 << 10;
/// Maximum length of the percent-encoded text, bytes. The details repeat the text.
const MOST_TEXT: usize = 960;
/// Maximum length of a quoted name in a shortened text, bytes.
const MOST_QUOTED: usize = 96;
/// Bytes that are kept at the start of a text that is still too long; `END` bytes are kept at its end.
const START: usize = 600;
/// See [`START`].
const END: usize = 320;
/// Maximum length of a description in shortened details, bytes. The status contains the text anyway.
const MOST_DESCRIPTION: usize = 240;
/// Maximum length of a name in details before encoding, bytes. Valid names have at most 64 characters.
const MOST_NAME: usize = 256;

/// Shortens a text: first the quoted names in it, then its middle, because the start states the problem and the end states the valid values.
fn short_text(text: String) -> String {
    if encoded_length(&text) <= MOST_TEXT {
        return text;
    }
    let parts = text.split('`').enumerate();
    let parts: Vec<_> =
        parts.map(|(i, part)| if i % 2 == 0 { part.into() } else { excerpt(part, MOST_QUOTED) }).collect();
    let text = parts.join("`");
    if encoded_length(&text) <= MOST_TEXT {
        return text;
    }
    format!("{} ... {}", start_of(&text, START), end_of(&text, END))
}

/// Shortens a name in details.
fn short_name(name: &str) -> String {
    if name.len() <= MOST_NAME {
        return name.to_owned();
    }
    format!("{}...", &name[..name.floor_char_boundary(MOST_NAME - 3)])
}

/// Returns the bytes of a status in the headers of an answer.
fn encoded_bytes(status: &Status) -> usize {
    encoded_length(status.message()) + status.details().len().div_ceil(3) * 4
}

/// Returns a status with a short text and details, which describe the problem.
fn detailed(code: Code, problem: String, details: impl Fn(String) -> ErrorDetails) -> Status {
    let text = short_text(problem);
    let status = Status::with_error_details(code, text.clone(), details(text.clone()));
    if encoded_bytes(&status) <= MOST_ENCODED {
        return status;
    }
    let description = excerpt(&text, MOST_DESCRIPTION).into_owned();
    Status::with_error_details(code, text, details(description))
}

/// Shortens a status of any origin so that it fits into the headers of an answer. Details that are too long are left out; those that are made in this
/// module are never too long.
pub(crate) fn bounded(status: Status) -> Status {
    if encoded_bytes(&status) <= MOST_ENCODED {
        return status;
    }
    Status::new(status.code(), short_text(status.message().to_owned()))
}

/// Returns the status of a request that is invalid in every state of the daemon. If the text starts with a key and a colon or an equals sign, the
/// details name that key as the field.
pub(crate) fn invalid(problem: impl Into<String>) -> Status {
    let problem = with_short_numbers(problem.into());
    let Some(field) = field_of(&problem) else { return Status::invalid_argument(short_text(problem)) };
    let field = short_name(&field);
    detailed(Code::InvalidArgument, problem, |problem| ErrorDetails::with_bad_request_violation(&field, problem))
}

/// Maximum number of digits of a number that is written in full. Longer numbers are written with an exponent.
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

/// Returns the status if an item has another revision than the change was made for.
pub(crate) fn revision(problem: String, of: &str, expected: u64, found: u64) -> Status {
    let metadata = [("of", of.to_owned()), ("expected", expected.to_string()), ("found", found.to_string())];
    let metadata: HashMap<String, String> = metadata.map(|(key, value)| (key.to_owned(), value)).into();
    detailed(Code::Aborted, problem, |_| ErrorDetails::with_error_info("REVISION", DOMAIN, metadata.clone()))
}

/// Returns the status if another client holds the lease of the camera.
pub(crate) fn leased(problem: String, holder: &str) -> Status {
    let holder = short_name(holder);
    detailed(Code::FailedPrecondition, problem, |problem| {
        ErrorDetails::with_precondition_failure_violation("LEASE", &holder, problem)
    })
}

/// Returns the status if a shared resource, or the client's share of it, is exhausted.
pub(crate) fn exhausted(of: &str, problem: impl Into<String>) -> Status {
    let details = |problem| ErrorDetails::with_quota_failure_violation(of, problem);
    detailed(Code::ResourceExhausted, problem.into(), details)
}

/// Returns the status if no item of a kind has this name.
pub(crate) fn absent(kind: &str, name: &str, problem: String) -> Status {
    let name = short_name(name);
    detailed(Code::NotFound, problem, |problem| ErrorDetails::with_resource_info(kind, &name, "", problem))
}

/// Returns the status if an item of a kind with this name exists already.
pub(crate) fn present(kind: &str, name: &str, problem: String) -> Status {
    let name = short_name(name);
    detailed(Code::AlreadyExists, problem, |problem| ErrorDetails::with_resource_info(kind, &name, "", problem))
}

/// Returns the status if the caller lacks the role that a call requires.
pub(crate) fn denied(problem: String, role: &str, needed: &str) -> Status {
    let metadata = HashMap::from([("role".to_owned(), role.to_owned()), ("needed".to_owned(), needed.to_owned())]);
    detailed(Code::PermissionDenied, problem, |_| ErrorDetails::with_error_info("ROLE", DOMAIN, metadata.clone()))
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

    /// Returns the bytes that a status adds to the headers of an answer.
    fn header_bytes(status: &Status) -> usize {
        let mut headers = http::HeaderMap::new();
        status.add_header(&mut headers).unwrap();
        headers.values().map(http::HeaderValue::len).sum()
    }

    #[test]
    fn every_status_fits_into_the_headers_of_an_answer() {
        for letter in ["y", "`", " ", "ä", "操", "\u{1f30c}", "y`"] {
            for count in [10, 200, 700, 2000, 100_000] {
                let name = letter.repeat(count);
                let text = format!("view: no view `{name}`; the views are: {name}, dome");
                for status in [
                    invalid(text.clone()),
                    invalid(format!("bodies.{name}: {text}")),
                    leased(text.clone(), &name),
                    exhausted("client", text.clone()),
                    absent("view", &name, text.clone()),
                    present("view", &name, text.clone()),
                    denied(text.clone(), "view", "steer"),
                    revision(text.clone(), "scene", u64::MAX, u64::MAX),
                ] {
                    let bytes = header_bytes(&status);
                    assert!(bytes <= MOST_ENCODED + 2, "{count} times {letter}: {bytes} bytes of {status:?}");
                    assert_eq!(encoded_bytes(&bounded(status.clone())), encoded_bytes(&status), "{status:?}");
                    status.check_error_details().unwrap();
                }
                let foreign = Status::with_details(Code::Internal, text.clone(), text.into_bytes().into());
                assert!(header_bytes(&bounded(foreign)) <= MOST_ENCODED + 2);
            }
        }
    }

    #[test]
    fn short_texts_keep_their_start_and_end() {
        let text = short_text(format!("no view `{}`; the views are: flat, eyes", "y".repeat(5000)));
        assert!(text.starts_with("no view `yyy") && text.ends_with("...`; the views are: flat, eyes"), "{text}");
        let text = short_text(format!("a: wrong {} must be b", "y".repeat(5000)));
        assert!(text.starts_with("a: wrong y") && text.ends_with("y must be b") && text.contains(" ... "), "{text}");
        let status = absent("view", &"y".repeat(5000), "no view".to_owned());
        assert!(status.get_details_resource_info().unwrap().resource_name.ends_with("y..."));
        // Names that clients may use must not be shortened.
        let name = "\u{1f30c}".repeat(64);
        assert_eq!(
            leased("held".to_owned(), &name).get_details_precondition_failure().unwrap().violations[0].subject,
            name
        );
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

//! The time in which a certificate is valid.

use std::time::{Duration, SystemTime};

use der::{
    Decode as _, Reader as _, SliceReader, Tag, Tagged as _,
    asn1::{AnyRef, GeneralizedTime, UtcTime},
};

/// Warnings begin this long before the end of a certificate.
const WARNS_BEFORE: Duration = Duration::from_secs(14 * DAY_S);
const DAY_S: u64 = 86_400;

/// The first and the last moment of a certificate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Validity {
    from: SystemTime,
    until: SystemTime,
}

/// Returns the content of the next element, which must have this tag.
fn content<'a>(reader: &mut SliceReader<'a>, tag: Tag) -> der::Result<SliceReader<'a>> {
    let any = AnyRef::decode(reader)?;
    any.tag().assert_eq(tag)?;
    SliceReader::new(any.value())
}

fn time(reader: &mut SliceReader<'_>) -> der::Result<SystemTime> {
    let since_1970 = match reader.peek_tag()? {
        Tag::UtcTime => UtcTime::decode(reader)?.to_unix_duration(),
        _ => GeneralizedTime::decode(reader)?.to_unix_duration(),
    };
    Ok(SystemTime::UNIX_EPOCH + since_1970)
}

fn read(certificate: &[u8]) -> der::Result<Validity> {
    let mut reader = SliceReader::new(certificate)?;
    let mut whole = content(&mut reader, Tag::Sequence)?;
    let mut signed = content(&mut whole, Tag::Sequence)?;
    if matches!(signed.peek_tag()?, Tag::ContextSpecific { .. }) {
        AnyRef::decode(&mut signed)?;
    }
    // Serial number, algorithm and issuer.
    for _ in 0..3 {
        AnyRef::decode(&mut signed)?;
    }
    let mut validity = content(&mut signed, Tag::Sequence)?;
    Ok(Validity { from: time(&mut validity)?, until: time(&mut validity)? })
}

impl Validity {
    /// Reads the times of a certificate in DER (RFC 5280, section 4.1).
    ///
    /// # Errors
    ///
    /// It is no certificate, or its times are before 1970.
    pub(super) fn of(certificate: &[u8]) -> Result<Self, String> {
        read(certificate).map_err(|error| format!("the time in which it is valid cannot be read: {error}"))
    }

    /// Returns the seconds until its end, negative after it.
    pub(crate) fn left_s(&self, now: SystemTime) -> f64 {
        match self.until.duration_since(now) {
            Ok(left) => left.as_secs_f64(),
            Err(gone) => -gone.duration().as_secs_f64(),
        }
    }

    /// Checks that it is valid at a time.
    ///
    /// # Errors
    ///
    /// It is not yet valid, or has expired: says since or until when.
    pub(crate) fn check(&self, now: SystemTime) -> Result<(), String> {
        let days = |time: Duration| time.as_secs().div_ceil(DAY_S);
        if let Ok(wait) = self.from.duration_since(now)
            && !wait.is_zero()
        {
            return Err(format!("it is valid only in {} days", days(wait)));
        }
        match now.duration_since(self.until) {
            Ok(gone) if !gone.is_zero() => Err(format!("it expired {} days ago", days(gone))),
            _ => Ok(()),
        }
    }

    /// Returns what is wrong with it or soon will be.
    pub(crate) fn warning(&self, now: SystemTime) -> Option<String> {
        if let Err(problem) = self.check(now) {
            return Some(format!("server.tls.certificate: {problem}: clients refuse it"));
        }
        let left = self.until.duration_since(now).unwrap_or_default();
        let days = left.as_secs() / DAY_S;
        (left < WARNS_BEFORE).then(|| format!("server.tls.certificate: it expires in {days} days: renew it"))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use rcgen::{CertificateParams, KeyPair, date_time_ymd};

    use super::*;

    /// Seconds from 1970-01-01 to 2020-01-01.
    const S_2020: u64 = 1_577_836_800;

    fn at(days: i64) -> SystemTime {
        SystemTime::UNIX_EPOCH + Duration::from_secs(S_2020.checked_add_signed(days * 86_400).unwrap())
    }

    #[test]
    fn times_are_read_in_both_forms_and_tell_when_a_certificate_serves() {
        // From 2050 on, times have the other form.
        for (year, days) in [(2021, 366), (2052, 11_688)] {
            let mut params = CertificateParams::new(["localhost".to_owned()]).unwrap();
            (params.not_before, params.not_after) = (date_time_ymd(2020, 1, 1), date_time_ymd(year, 1, 1));
            let certificate = params.self_signed(&KeyPair::generate().unwrap()).unwrap();
            let validity = Validity::of(certificate.der()).unwrap();
            assert_eq!(validity, Validity { from: at(0), until: at(days) });
            assert_eq!(validity.left_s(at(days - 1)), 86_400.0);
            assert_eq!(validity.left_s(at(days + 1)), -86_400.0);
            assert_eq!(validity.check(at(-2)).unwrap_err(), "it is valid only in 2 days");
            assert_eq!(validity.check(at(days + 3)).unwrap_err(), "it expired 3 days ago");
            for (day, part) in [
                (-2, Some("valid only in 2 days")),
                (0, None),
                (days - 15, None),
                (days - 13, Some("expires in 13 days")),
                (days + 1, Some("expired 1 days ago")),
            ] {
                let warning = validity.warning(at(day));
                assert_eq!(warning.is_some(), part.is_some(), "{day}: {warning:?}");
                assert!(part.is_none_or(|part| warning.unwrap().contains(part)), "{day}");
            }
        }
        for damaged in [&b""[..], b"\x30\x03\x02\x01\x01", b"no certificate"] {
            assert!(Validity::of(damaged).is_err());
        }
    }
}

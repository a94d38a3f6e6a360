//! The period in which a certificate is valid.

use std::time::{Duration, SystemTime};

use der::{
    Decode as _, Reader as _, SliceReader, Tag, Tagged as _,
    asn1::{AnyRef, GeneralizedTime, UtcTime},
};

/// Warnings begin this long before a certificate expires.
const WARNS_BEFORE: Duration = Duration::from_secs(14 * DAY_S);
const DAY_S: u64 = 86_400;
/// A time that is longer than certificates can last, which is until the year 9999.
const FOREVER: Duration = Duration::from_secs(8000 * 366 * DAY_S);

/// The period in which a certificate, or every certificate of a chain, is valid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Validity {
    from: SystemTime,
    until: SystemTime,
    /// Positions in the chain of the certificate that becomes valid last and of the one that expires first; 0: the owner's own certificate.
    places: [usize; 2],
}

/// Returns a text for the certificate at a position in the chain.
fn named(place: usize) -> String {
    if place == 0 { "it".to_owned() } else { format!("certificate {} of its chain", place + 1) }
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
    Ok(Validity { from: time(&mut validity)?, until: time(&mut validity)?, places: [0; 2] })
}

impl Validity {
    /// Reads the times of a certificate in DER (RFC 5280, section 4.1).
    ///
    /// # Errors
    ///
    /// It is not a certificate, or its times are before 1970.
    pub(super) fn of(certificate: &[u8]) -> Result<Self, String> {
        read(certificate).map_err(|error| format!("its period of validity cannot be read: {error}"))
    }

    /// Reads the period in which all certificates of a chain are valid.
    ///
    /// # Errors
    ///
    /// As [`Self::of`].
    pub(super) fn of_chain(chain: &[impl AsRef<[u8]>]) -> Result<Self, String> {
        let mut all = Self { from: SystemTime::UNIX_EPOCH, until: SystemTime::UNIX_EPOCH + FOREVER, places: [0; 2] };
        for (place, certificate) in chain.iter().enumerate() {
            let Self { from, until, .. } = Self::of(certificate.as_ref())?;
            if from > all.from {
                (all.from, all.places[0]) = (from, place);
            }
            if until < all.until {
                (all.until, all.places[1]) = (until, place);
            }
        }
        Ok(all)
    }

    /// Returns the number of seconds until it expires; negative if it has expired.
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
    /// It is not yet valid, or has expired; the error states since when or until when.
    pub(crate) fn check(&self, now: SystemTime) -> Result<(), String> {
        let days = |time: Duration| time.as_secs().div_ceil(DAY_S);
        if let Ok(wait) = self.from.duration_since(now)
            && !wait.is_zero()
        {
            return Err(format!("{} becomes valid in {} days", named(self.places[0]), days(wait)));
        }
        match now.duration_since(self.until) {
            Ok(gone) if !gone.is_zero() => Err(format!("{} expired {} days ago", named(self.places[1]), days(gone))),
            _ => Ok(()),
        }
    }

    /// Returns a present or imminent problem.
    pub(crate) fn warning(&self, now: SystemTime) -> Option<String> {
        if let Err(problem) = self.check(now) {
            return Some(format!("server.tls.certificate: {problem}: clients refuse it"));
        }
        let left = self.until.duration_since(now).unwrap_or_default();
        let days = left.as_secs() / DAY_S;
        let ending = named(self.places[1]);
        (left < WARNS_BEFORE).then(|| format!("server.tls.certificate: {ending} expires in {days} days: renew it"))
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
            assert_eq!(validity, Validity { from: at(0), until: at(days), places: [0; 2] });
            assert_eq!(validity.left_s(at(days - 1)), 86_400.0);
            assert_eq!(validity.left_s(at(days + 1)), -86_400.0);
            assert_eq!(validity.check(at(-2)).unwrap_err(), "it becomes valid in 2 days");
            assert_eq!(validity.check(at(days + 3)).unwrap_err(), "it expired 3 days ago");
            for (day, part) in [
                (-2, Some("becomes valid in 2 days")),
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
        // A chain is valid from the latest start to the earliest end of its certificates.
        let lasting = |from: i32, until: i32| {
            let mut params = CertificateParams::new(["localhost".to_owned()]).unwrap();
            (params.not_before, params.not_after) = (date_time_ymd(from, 1, 1), date_time_ymd(until, 1, 1));
            params.self_signed(&KeyPair::generate().unwrap()).unwrap().der().to_vec()
        };
        let chain = Validity::of_chain(&[lasting(2020, 2052), lasting(2020, 2021), lasting(2019, 2060)]).unwrap();
        assert_eq!(chain, Validity { from: at(0), until: at(366), places: [0, 1] });
        assert_eq!(chain.check(at(369)).unwrap_err(), "certificate 2 of its chain expired 3 days ago");
        assert_eq!(chain.check(at(-2)).unwrap_err(), "it becomes valid in 2 days");
        assert!(chain.warning(at(360)).unwrap().contains("certificate 2 of its chain expires in 6 days"));
        // A client's certificate.
        let client = Validity::of(&lasting(2020, 2021)).unwrap();
        let access =
            super::super::Access { client_validities: vec![("desk".to_owned(), client)], ..Default::default() };
        assert_eq!(access.warnings(at(10)), Vec::<String>::new());
        let warnings = access.warnings(at(369));
        assert_eq!(warnings, ["server.certificates, `desk`: it expired 3 days ago: this client cannot connect"]);
        for damaged in [&b""[..], b"\x30\x03\x02\x01\x01", b"no certificate"] {
            assert!(Validity::of(damaged).is_err());
        }
    }
}

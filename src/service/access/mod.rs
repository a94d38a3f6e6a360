//! Who may call what: tokens and client certificates, each with a role, and the layer that asks for them.
//!
//! Without either everybody may do everything, which is allowed on the loopback address alone; whoever reaches a Unix socket was let through by its file
//! permissions. With either, every call but those of [`roles::Need::Nothing`] has to come with one of them. Tokens are random, 256 bits, so their SHA-256
//! tells nothing about them: the configuration has no more than that. All of it can be replaced while the daemon runs ([`AccessSource`]): calls in
//! progress whose token or certificate is gone then end.

mod audit;
mod gate;
mod roles;
mod tls;

use std::{net::SocketAddr, sync::Arc};

use http::{HeaderMap, header};
use sha2::{Digest as _, Sha256};
use subtle::ConstantTimeEq as _;

pub(super) use self::{
    audit::{By, Moves},
    gate::{Caller, Gate},
};
use super::clients::ClientInfo;
use crate::config::Role;

/// SHA-256 of a token or of a certificate.
pub type Digest = [u8; 32];

/// What a token begins with, so that one that was lost is found by a search.
const TOKEN_PREFIX: &str = "steradian_";

/// Somebody who is let in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Admitted {
    /// For the log.
    pub name: String,
    /// What they may do.
    pub role: Role,
    /// SHA-256 of the token, or of the certificate in DER.
    pub digest: Digest,
}

/// Who may call the daemon, and how connections are encrypted.
#[derive(Clone, Debug, Default)]
pub struct Access {
    /// By a token.
    pub tokens: Vec<Admitted>,
    /// By a client certificate.
    pub certificates: Vec<Admitted>,
    /// `None`: connections are not encrypted.
    pub tls: Option<Arc<rustls::ServerConfig>>,
}

/// Reads [`Access`] when the daemon starts, and again when it is told to. The error says what was wrong, and where.
pub type AccessSource = Arc<dyn Fn() -> Result<Access, String> + Send + Sync>;

/// Why somebody is not let in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Turned {
    /// Nothing tells who it is.
    Unknown(&'static str),
    /// What they came with is not, or no longer, of use.
    Refused(&'static str),
}

/// How a caller showed who it is; what it shows has to be of use as long as its calls last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shown {
    /// Everybody may call, or the file permissions of a socket have let it through.
    Nothing,
    /// A token with this digest.
    Token(Digest),
    /// A certificate with this digest.
    Certificate(Digest),
}

/// The digest of a token, or of a certificate in DER.
pub fn digest_of(shown: impl AsRef<[u8]>) -> Digest {
    Sha256::digest(shown).into()
}

/// A new token.
///
/// # Errors
///
/// The system has no random numbers.
pub fn new_token() -> Result<String, String> {
    let mut bytes = [0; 32];
    let random = rustls::crypto::ring::default_provider().secure_random;
    random.fill(&mut bytes).map_err(|_| "the system has no random numbers".to_owned())?;
    let text = base64::Engine::encode(&base64::engine::general_purpose::URL_SAFE_NO_PAD, bytes);
    Ok(format!("{TOKEN_PREFIX}{text}"))
}

/// The one of these with a digest. As slow for all digests, whether or not there is one.
fn admitted<'a>(those: &'a [Admitted], digest: &Digest) -> Option<&'a Admitted> {
    let mut found = None;
    for one in those {
        if bool::from(one.digest.ct_eq(digest)) {
            found = Some(one);
        }
    }
    found
}

impl Access {
    /// Whether calls have to come with a token or a certificate.
    pub fn is_guarded(&self) -> bool {
        !self.tokens.is_empty() || !self.certificates.is_empty()
    }

    /// Whether the daemon may listen on an address with this.
    ///
    /// # Errors
    ///
    /// What is missing.
    pub fn check_address(&self, address: SocketAddr) -> Result<(), String> {
        if address.ip().is_loopback() {
            return Ok(());
        }
        let missing: Vec<&str> = [
            (self.tls.is_none(), "[server.tls], so that nobody listens in"),
            (!self.is_guarded(), "[[server.tokens]] or [[server.certificates]], so that not everybody may steer"),
        ]
        .into_iter()
        .filter_map(|(is_missing, what)| is_missing.then_some(what))
        .collect();
        if missing.is_empty() {
            return Ok(());
        }
        Err(format!(
            "others reach {address}, and the configuration has no {}; without these only the loopback address and `unix:PATH` are allowed \
             (docs/access.md)",
            missing.join(" and no ")
        ))
    }

    /// Whether a daemon may go on with another one. A file that is read while it is written may be empty: it must not let everybody in.
    ///
    /// # Errors
    ///
    /// It would let in more than whoever started the daemon has allowed.
    pub(super) fn check_successor(&self, other: &Self) -> Result<(), String> {
        let lost = [
            (self.tls.is_some() && other.tls.is_none(), "[server.tls]"),
            (self.is_guarded() && !other.is_guarded(), "[[server.tokens]] and [[server.certificates]]"),
        ];
        match lost.into_iter().find(|(is_lost, _)| *is_lost) {
            Some((_, what)) => {
                Err(format!("there is no {what} any more: only a daemon that is started anew does without"))
            }
            None => Ok(()),
        }
    }

    /// What a caller shows.
    fn shown(&self, client: &ClientInfo, headers: &HeaderMap) -> Result<Shown, Turned> {
        if !self.is_guarded() || client.is_local_socket() {
            return Ok(Shown::Nothing);
        }
        if let Some(value) = headers.get(header::AUTHORIZATION) {
            let token = value.to_str().ok().and_then(|value| value.split_once(' '));
            return match token {
                Some((scheme, token)) if scheme.eq_ignore_ascii_case("bearer") => {
                    Ok(Shown::Token(digest_of(token.trim())))
                }
                _ => Err(Turned::Refused("the header `authorization` has to be `Bearer TOKEN`")),
            };
        }
        match client.certificate() {
            Some(digest) => Ok(Shown::Certificate(digest)),
            None => Err(Turned::Unknown(
                "this daemon lets nobody in without a token (`authorization: Bearer TOKEN`) or a client certificate",
            )),
        }
    }

    /// Who shows this.
    fn caller(&self, shown: Shown) -> Result<Caller, Turned> {
        let (those, digest, unknown) = match shown {
            Shown::Nothing => return Ok(Caller { name: "local".into(), role: Role::Admin, shown }),
            Shown::Token(digest) => (&self.tokens, digest, "the token is not one of [[server.tokens]], or no longer"),
            Shown::Certificate(digest) => {
                (&self.certificates, digest, "the certificate is not one of [[server.certificates]], or no longer")
            }
        };
        let Admitted { name, role, .. } = admitted(those, &digest).ok_or(Turned::Refused(unknown))?;
        Ok(Caller { name: name.as_str().into(), role: *role, shown })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
mod tests {
    use super::*;
    use crate::service::clients::From;

    fn access(token: &str) -> Access {
        let desk = Admitted { name: "desk".to_owned(), role: Role::Steer, digest: digest_of(token) };
        Access { tokens: vec![desk], ..Access::default() }
    }

    fn headers(authorization: &'static str) -> HeaderMap {
        HeaderMap::from_iter([(header::AUTHORIZATION, http::HeaderValue::from_static(authorization))])
    }

    #[test]
    fn tokens_are_random_and_long() {
        let tokens = [new_token().unwrap(), new_token().unwrap()];
        assert!(tokens[0] != tokens[1] && tokens.iter().all(|token| token.len() == TOKEN_PREFIX.len() + 43));
        // FIPS 180-2, appendix B.1.
        assert!(digest_of("abc").starts_with(&[0xba, 0x78, 0x16, 0xbf, 0x8f, 0x01, 0xcf, 0xea]));
    }

    #[test]
    fn a_caller_is_known_by_its_token_alone() {
        let (access, client) = (access("right"), ClientInfo::new(&Arc::default(), From::Network("test".to_owned())));
        let who = |headers: &HeaderMap| access.shown(&client, headers).and_then(|shown| access.caller(shown));
        for right in ["Bearer right", "bearer  right"] {
            let caller = who(&headers(right)).unwrap();
            assert_eq!((&*caller.name, caller.role), ("desk", Role::Steer));
        }
        for wrong in ["Bearer wrong", "Bearer ", "Bearer right2", "Basic right", "right"] {
            assert!(matches!(who(&headers(wrong)), Err(Turned::Refused(_))), "{wrong}");
        }
        assert!(matches!(who(&HeaderMap::new()), Err(Turned::Unknown(_))));
        // Nobody is asked where nobody is named.
        let open = Access::default();
        let shown = open.shown(&client, &HeaderMap::new()).unwrap();
        assert_eq!(open.caller(shown).unwrap().role, Role::Admin);
    }

    #[test]
    fn others_are_let_in_through_tls_with_names_alone() {
        let others: SocketAddr = "192.0.2.1:7143".parse().unwrap();
        let all: SocketAddr = "[::]:7143".parse().unwrap();
        for local in ["127.0.0.1:7143", "[::1]:7143", "127.8.8.8:1"] {
            Access::default().check_address(local.parse().unwrap()).unwrap();
        }
        for address in [others, all] {
            let problem = Access::default().check_address(address).unwrap_err();
            assert!(problem.contains("[server.tls]") && problem.contains("[[server.tokens]]"), "{problem}");
            let problem = access("right").check_address(address).unwrap_err();
            assert!(problem.contains("[server.tls]") && !problem.contains("[[server.tokens]]"), "{problem}");
        }
        access("a").check_successor(&access("b")).unwrap();
        Access::default().check_successor(&access("b")).unwrap();
        assert!(access("a").check_successor(&Access::default()).unwrap_err().contains("started anew"));
    }
}

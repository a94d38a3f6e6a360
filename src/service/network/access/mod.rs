//! Access control: tokens and client certificates, each with a role, and the layer that checks them.
//!
//! Without tokens and certificates, every client has full access. This is allowed only on the loopback address and on a Unix socket, whose file
//! permissions admit the client. If there are tokens or certificates, each call except those of [`roles::Need::Nothing`] must have a valid one.
//! Tokens are 256 random bits, so their SHA-256 reveals nothing about them; the configuration holds only the hash. The rules can be replaced while
//! the daemon runs ([`AccessSource`]): calls whose token or certificate was removed then end.

mod change_log;
mod gate;
mod roles;
mod tls;
mod validity;

use std::{net::SocketAddr, sync::Arc, time::SystemTime};

use http::{HeaderMap, header};
use sha2::{Digest as _, Sha256};
use subtle::ConstantTimeEq as _;

pub use self::validity::Validity;
pub(crate) use self::{
    change_log::{By, Moves},
    gate::{Caller, Gate},
};
use crate::{config::Role, service::network::clients::ClientInfo};

/// SHA-256 of a token or of a certificate.
pub type Digest = [u8; 32];

/// Prefix of every token, so that a search can find leaked tokens.
const TOKEN_PREFIX: &str = "steradian_";

/// A client with access.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Admitted {
    /// Name for the log.
    pub name: String,
    /// Role of the client.
    pub role: Role,
    /// SHA-256 of the token, or of the certificate in DER.
    pub digest: Digest,
}

/// Clients with access, and the encryption of connections.
#[derive(Clone, Debug, Default)]
pub struct Access {
    /// Clients by token.
    pub tokens: Vec<Admitted>,
    /// Clients by certificate.
    pub certificates: Vec<Admitted>,
    /// `None`: connections are not encrypted.
    pub tls: Option<Arc<rustls::ServerConfig>>,
    /// Period in which the daemon's certificate is valid.
    pub certificate_validity: Option<Validity>,
    /// Names of the clients with certificates, with the periods in which these are valid.
    pub client_validities: Vec<(String, Validity)>,
    /// Names of `server.hosts` that the daemon's certificate has.
    pub certified_hosts: Vec<String>,
    /// Names of `server.hosts` that it lacks: clients that use them refuse the certificate.
    pub uncertified_hosts: Vec<String>,
}

/// Reads [`Access`] at the start of the daemon and on each reload. The error states the problem and its place.
pub type AccessSource = Arc<dyn Fn() -> Result<Access, String> + Send + Sync>;

/// Reasons why a caller is refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Rejection {
    /// The call has no credentials.
    Unknown(&'static str),
    /// The credentials are not, or no longer, valid.
    Refused(&'static str),
}

/// Credentials of a caller, which must stay valid during its calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CallerCredentials {
    /// None: every client has access, or the file permissions of a socket admit the client.
    Nothing,
    /// A token with this digest.
    Token(Digest),
    /// A certificate with this digest.
    Certificate(Digest),
}

/// Returns the digest of a token, or of a certificate in DER.
pub fn digest_of(credentials: impl AsRef<[u8]>) -> Digest {
    Sha256::digest(credentials).into()
}

/// Creates a token.
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

/// Finds a client by digest. The time is the same whether or not the client exists.
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
    /// Whether calls need a token or a certificate.
    pub fn is_guarded(&self) -> bool {
        !self.tokens.is_empty() || !self.certificates.is_empty()
    }

    /// Checks that the daemon may listen on an address with these rules.
    ///
    /// # Errors
    ///
    /// A required part is missing.
    pub fn check_address(&self, address: SocketAddr) -> Result<(), String> {
        if address.ip().is_loopback() {
            return Ok(());
        }
        let missing: Vec<&str> = [
            (self.tls.is_none(), "[server.tls], so that connections are encrypted"),
            (!self.is_guarded(), "[[server.tokens]] or [[server.certificates]], so that not every client may steer"),
        ]
        .into_iter()
        .filter_map(|(is_missing, what)| is_missing.then_some(what))
        .collect();
        if missing.is_empty() {
            return Ok(());
        }
        Err(format!(
            "other machines reach {address}, but the configuration has no {}; without these, only the loopback address and `unix:PATH` are \
             allowed (docs/access.md)",
            missing.join(" and no ")
        ))
    }

    /// Returns present and imminent problems of the certificates.
    pub(crate) fn warnings(&self, now: SystemTime) -> Vec<String> {
        let unnamed = self.uncertified_hosts.iter();
        let unnamed = unnamed.map(|host| {
            format!("server.tls.certificate: it does not name `{host}` of server.hosts: clients that use this name refuse it")
        });
        let clients = self.client_validities.iter().filter_map(|(name, validity)| {
            let problem = validity.check(now).err()?;
            Some(format!("server.certificates, `{name}`: {problem}: this client cannot connect"))
        });
        let own = self.certificate_validity.and_then(|validity| validity.warning(now));
        own.into_iter().chain(unnamed).chain(clients).collect()
    }

    /// Checks that a running daemon may switch to other rules. A file that is read while it is being written may be
    /// empty: it must not open the daemon to every client.
    ///
    /// # Errors
    ///
    /// The new rules would admit more clients than the daemon was started for, or their certificate is not valid now.
    pub(crate) fn check_successor(&self, other: &Self, now: SystemTime) -> Result<(), String> {
        if let Some(validity) = &other.certificate_validity {
            validity.check(now).map_err(|problem| format!("server.tls.certificate: {problem}"))?;
        }
        if let Some(host) = other.uncertified_hosts.iter().find(|host| self.certified_hosts.contains(host)) {
            return Err(format!(
                "server.tls.certificate: it does not name `{host}` of server.hosts, as the present one does"
            ));
        }
        let lost = [
            (self.tls.is_some() && other.tls.is_none(), "[server.tls]"),
            (self.is_guarded() && !other.is_guarded(), "[[server.tokens]] and [[server.certificates]]"),
        ];
        match lost.into_iter().find(|(is_lost, _)| *is_lost) {
            Some((_, what)) => Err(format!("{what} are missing: restart the daemon to run without them")),
            None => Ok(()),
        }
    }

    /// Returns the credentials of a caller.
    fn credentials(&self, client: &ClientInfo, headers: &HeaderMap) -> Result<CallerCredentials, Rejection> {
        if !self.is_guarded() || client.is_local_socket() {
            return Ok(CallerCredentials::Nothing);
        }
        let mut values = headers.get_all(header::AUTHORIZATION).iter();
        if let Some(value) = values.next() {
            if values.next().is_some() {
                return Err(Rejection::Refused("there must be one header `authorization`, not several"));
            }
            let token = value.to_str().ok().and_then(|value| value.split_once(' '));
            return match token {
                Some((scheme, token)) if scheme.eq_ignore_ascii_case("bearer") => {
                    Ok(CallerCredentials::Token(digest_of(token.trim())))
                }
                _ => Err(Rejection::Refused("the header `authorization` must be `Bearer TOKEN`")),
            };
        }
        match client.certificate() {
            Some(digest) => Ok(CallerCredentials::Certificate(digest)),
            None => Err(Rejection::Unknown(
                "this daemon requires a token (`authorization: Bearer TOKEN`) or a client certificate",
            )),
        }
    }

    /// Returns the client with these credentials.
    fn caller(&self, credentials: CallerCredentials) -> Result<Caller, Rejection> {
        let (those, digest, unknown) = match credentials {
            CallerCredentials::Nothing => return Ok(Caller { name: "local".into(), role: Role::Admin, credentials }),
            CallerCredentials::Token(digest) => (
                &self.tokens,
                digest,
                "this token is unknown, or no longer valid: the daemon's configuration has the valid ones ([[server.tokens]])",
            ),
            CallerCredentials::Certificate(digest) => (
                &self.certificates,
                digest,
                "this certificate is unknown, or no longer valid: the daemon's configuration has the valid ones ([[server.certificates]])",
            ),
        };
        let Admitted { name, role, .. } = admitted(those, &digest).ok_or(Rejection::Refused(unknown))?;
        Ok(Caller { name: name.as_str().into(), role: *role, credentials })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;
    use crate::service::network::clients::{From, Shares};

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
    fn only_the_right_token_identifies_a_caller() {
        let (access, client) =
            (access("right"), ClientInfo::new(&Arc::new(Shares::new(16)), From::Network("test".to_owned())));
        let who = |headers: &HeaderMap| {
            access.credentials(&client, headers).and_then(|credentials| access.caller(credentials))
        };
        for right in ["Bearer right", "bearer  right"] {
            let caller = who(&headers(right)).unwrap();
            assert_eq!((&*caller.name, caller.role), ("desk", Role::Steer));
        }
        for wrong in ["Bearer wrong", "Bearer ", "Bearer right2", "Basic right", "right"] {
            assert!(matches!(who(&headers(wrong)), Err(Rejection::Refused(_))), "{wrong}");
        }
        for order in [["Bearer right", "Bearer wrong"], ["Bearer wrong", "Bearer right"], ["Bearer right"; 2]] {
            let mut several = HeaderMap::new();
            for value in order {
                several.append(header::AUTHORIZATION, http::HeaderValue::from_static(value));
            }
            let refusal = who(&several).unwrap_err();
            assert!(
                matches!(refusal, Rejection::Refused(why) if why.contains("not several")),
                "{order:?}: {refusal:?}"
            );
        }
        assert!(matches!(who(&HeaderMap::new()), Err(Rejection::Unknown(_))));
        // Without rules, no credentials are needed.
        let open = Access::default();
        let credentials = open.credentials(&client, &HeaderMap::new()).unwrap();
        assert_eq!(open.caller(credentials).unwrap().role, Role::Admin);
    }

    #[test]
    fn network_addresses_need_tls_and_credentials() {
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
        let now = SystemTime::now();
        access("a").check_successor(&access("b"), now).unwrap();
        Access::default().check_successor(&access("b"), now).unwrap();
        assert!(access("a").check_successor(&Access::default(), now).unwrap_err().contains("restart the daemon"));
    }
}

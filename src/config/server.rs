//! `[server]`: the address of the daemon, and access to it.

mod plain_text;

use std::{fmt, net::IpAddr, path::PathBuf, str::FromStr};

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error as _};

pub(crate) use self::plain_text::hidden_character;
use crate::ranges::KeyError;

/// Prefix of the path of a Unix socket.
pub const UNIX_PREFIX: &str = "unix:";
/// Maximum number of characters in the name of a token or certificate.
const MOST_NAME: usize = 64;

/// `[server]`.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ServerConfig {
    /// Address to listen on: `host:port`, where port 0 selects a free one, or `unix:PATH`. Any address other than a Unix socket or the loopback
    /// address requires `tls`, and either `tokens` or `certificates`.
    #[serde(deserialize_with = "address")]
    pub listen: String,
    /// Host names, without ports, under which clients may reach the daemon, in addition to `localhost` and IP addresses. Requests that use other
    /// names, and requests from web pages of other sites, are refused.
    pub hosts: Vec<String>,
    /// File that keeps the changes made by clients. A change is on disk before it is acknowledged, and after a restart the daemon continues with all
    /// changes. Absent: changes are lost when the daemon ends.
    pub state: Option<PathBuf>,
    /// Encrypts connections.
    pub tls: Option<TlsConfig>,
    /// Tokens that give access. With tokens or `certificates`, access without them is refused, except through a Unix socket.
    pub tokens: Vec<TokenConfig>,
    /// Client certificates that give access.
    pub certificates: Vec<CertificateConfig>,
}

/// `[server.tls]`. Paths start at the folder of the configuration.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TlsConfig {
    /// The daemon's certificate and the intermediate certificates, PEM.
    pub certificate: PathBuf,
    /// The daemon's private key, PEM.
    pub key: PathBuf,
    /// Certificates of the authorities that sign client certificates, PEM. Absent: client certificates are not used.
    pub client_ca: Option<PathBuf>,
}

/// `[[server.tokens]]`.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TokenConfig {
    /// Name of the holder, for the log.
    pub name: String,
    /// Permissions of the holder.
    pub role: Role,
    /// SHA-256 of the token, 64 hexadecimal digits. `steradian token` makes the token and its SHA-256.
    #[schemars(with = "String")]
    pub sha256: Sha256Hex,
}

/// `[[server.certificates]]`.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CertificateConfig {
    /// Name of the holder, for the log.
    pub name: String,
    /// Permissions of the holder.
    pub role: Role,
    /// The client's certificate, PEM; it has to be signed by `tls.client_ca`.
    pub file: PathBuf,
}

/// Permissions of a client; each role includes the permissions of the preceding roles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// May see views, figures and settings.
    View,
    /// May move the camera, and change the scene and the views.
    Steer,
    /// May load snapshots, and run checks.
    Admin,
}

named!(Role { View = "view", Steer = "steer", Admin = "admin" });

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Role {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::from_name(text).ok_or_else(|| format!("`{text}` is not a role: must be view, steer or admin"))
    }
}

/// A SHA-256, 64 hexadecimal digits as text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sha256Hex(pub [u8; 32]);

impl fmt::Display for Sha256Hex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl Serialize for Sha256Hex {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Sha256Hex {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let digits: Option<Vec<u8>> =
            text.chars().map(|digit| digit.to_digit(16).and_then(|digit| u8::try_from(digit).ok())).collect();
        let pairs: Option<Vec<u8>> = digits
            .map(|digits| digits.chunks(2).map(|pair| pair.iter().fold(0, |sum, digit| 16 * sum + digit)).collect());
        let bytes = pairs.filter(|_| text.len() == 64).and_then(|bytes| bytes.try_into().ok());
        bytes.map(Self).ok_or_else(|| {
            D::Error::custom("must be the 64 hexadecimal digits of a SHA-256, as `steradian token` prints them, not the token itself")
        })
    }
}

impl Default for ServerConfig {
    fn default() -> Self {
        Self {
            listen: "127.0.0.1:7143".to_owned(),
            hosts: Vec::new(),
            state: None,
            tls: None,
            tokens: Vec::new(),
            certificates: Vec::new(),
        }
    }
}

fn address<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    let text = String::deserialize(deserializer)?;
    parse_listen(&text).map_err(D::Error::custom)
}

/// Checks that `text` is a host with a port, or the path of a socket; the host itself is looked up when the daemon starts. The error gives
/// valid examples.
pub fn parse_listen(text: &str) -> Result<String, String> {
    if let Some(path) = text.strip_prefix(UNIX_PREFIX) {
        return match path {
            "" => Err(format!("`{text}` has no path: must have the form of \"unix:/run/steradian/socket\"")),
            _ => Ok(text.to_owned()),
        };
    }
    let (host, port) = text.rsplit_once(':').unwrap_or((text, ""));
    // An IPv6 address needs brackets: without them, its last group could be taken for a port.
    let bare_ipv6 = host.contains(':') && !(host.starts_with('[') && host.ends_with(']'));
    if host.is_empty() || bare_ipv6 || port.parse::<u16>().is_err() {
        return Err(format!(
            "`{text}` is not a host with a port: must have the form of \"127.0.0.1:7143\", \"[::]:7143\", \"localhost:0\" or \"unix:PATH\""
        ));
    }
    Ok(text.to_owned())
}

/// Checks the name of a holder; the error states the valid names.
pub(crate) fn check_holder(name: &str) -> Result<(), String> {
    if !name.is_empty() && name.chars().count() <= MOST_NAME && hidden_character(name).is_none() {
        return Ok(());
    }
    let name = name.escape_debug();
    Err(format!("`{name}`: must have between 1 and {MOST_NAME} characters, without control and format characters"))
}

/// Returns the reason why no client can reach the daemon under this name; `None` if the name is possible. Clients write names in other scripts in the
/// form `xn--...`.
fn host_fault(host: &str) -> Option<&'static str> {
    let is_label = |label: &str| {
        let is_known = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        !label.is_empty() && label.len() <= 63 && label.chars().all(is_known)
    };
    if host.is_empty() {
        Some("it is empty")
    } else if host.contains("://") || host.contains('/') {
        Some("it is the address of a page: write only the host name")
    } else if host.parse::<IpAddr>().is_ok() || host.starts_with('[') {
        Some("it is an IP address, which needs no entry")
    } else if host.contains(':') {
        Some("it has a port: write the name without the port")
    } else if host.contains('*') {
        Some("it has a wildcard: write each name")
    } else if !host.is_ascii() {
        Some("clients use the form xn--... of this name: write that form")
    } else if host.len() > 253 || !host.split('.').all(is_label) {
        Some("must consist of letters, digits and hyphens, with parts separated by dots")
    } else {
        None
    }
}

/// Checks the names under which clients reach the daemon. The log identifies holders by their names, so they must be unique.
pub(super) fn check(server: &ServerConfig) -> Result<(), KeyError> {
    for (index, host) in server.hosts.iter().enumerate() {
        if let Some(problem) = host_fault(host) {
            return Err(KeyError::new(format!("hosts[{index}]"), format!("`{}`: {problem}", host.escape_debug())));
        }
    }
    let tokens = server.tokens.iter().enumerate().map(|(index, token)| (format!("tokens[{index}].name"), &token.name));
    let certificates = server.certificates.iter().enumerate();
    let certificates =
        certificates.map(|(index, certificate)| (format!("certificates[{index}].name"), &certificate.name));
    let mut known: Vec<&String> = Vec::new();
    for (key, name) in tokens.chain(certificates) {
        check_holder(name).map_err(|problem| KeyError::new(&key, problem))?;
        if known.contains(&name) {
            return Err(KeyError::new(&key, format!("another entry has the name `{name}`: names must be unique")));
        }
        known.push(name);
    }
    let tokens = &server.tokens;
    let twin =
        (1..tokens.len()).find(|index| tokens[..*index].iter().any(|other| other.sha256 == tokens[*index].sha256));
    if let Some(index) = twin {
        return Err(KeyError::new(
            format!("tokens[{index}].sha256"),
            "another entry has the same token: each entry needs its own".to_owned(),
        ));
    }
    Ok(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;

    #[test]
    fn hosts_that_no_client_can_name_are_refused() {
        let checked = |host: &str| {
            let server = ServerConfig { hosts: vec!["dome.local".to_owned(), host.to_owned()], ..Default::default() };
            check(&server).map_err(|error| error.to_string())
        };
        for host in ["desk", "dome-2.example.org", "xn--bcher-kva.example", "_dome.lan"] {
            assert_eq!(checked(host), Ok(()), "{host}");
        }
        for (host, part) in [
            ("dome.local:17200", "it has a port"),
            ("http://dome.local", "it is the address of a page"),
            ("*.example.org", "it has a wildcard"),
            ("dome.local.", "letters, digits and hyphens"),
            ("b\u{fc}cher.example", "xn--"),
            ("10.0.0.7", "it is an IP address"),
            ("[::1]", "it is an IP address"),
            ("a b", "letters, digits and hyphens"),
            ("", "it is empty"),
        ] {
            let problem = checked(host).unwrap_err();
            assert!(problem.starts_with("hosts[1]") && problem.contains(part), "{host}: {problem}");
        }
    }
}

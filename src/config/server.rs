//! `[server]`: where the daemon listens.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

/// `[server]`.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ServerConfig {
    /// Address to listen on, `host:port`; port 0 selects a free port.
    #[serde(deserialize_with = "address")]
    pub listen: String,
    /// Names by which clients may call the daemon, without ports, besides `localhost` and addresses: others are refused, and so are pages of
    /// other sites.
    pub hosts: Vec<String>,
    /// File in which changes by clients are kept, on disk before they are acknowledged: the daemon goes on with them when it is started again. Absent:
    /// they are lost at its end.
    pub state: Option<PathBuf>,
}

impl Default for ServerConfig {
    fn default() -> Self {
        Self { listen: "127.0.0.1:7143".to_owned(), hosts: Vec::new(), state: None }
    }
}

fn address<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    let text = String::deserialize(deserializer)?;
    parse_listen(&text).map_err(serde::de::Error::custom)
}

/// Checks that `text` is a host with a port; the host itself is looked up when the daemon starts. The error says what is
/// allowed.
pub fn parse_listen(text: &str) -> Result<String, String> {
    let (host, port) = text.rsplit_once(':').unwrap_or((text, ""));
    // An IPv6 address stands in brackets: without them its last group would pass for a port.
    let bare_ipv6 = host.contains(':') && !(host.starts_with('[') && host.ends_with(']'));
    if host.is_empty() || bare_ipv6 || port.parse::<u16>().is_err() {
        return Err(format!(
            "`{text}` is no host with a port: allowed are such as \"127.0.0.1:7143\", \"[::]:7143\" and \"localhost:0\""
        ));
    }
    Ok(text.to_owned())
}

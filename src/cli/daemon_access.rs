//! The address of a running daemon, and the credentials for it.

use std::path::{Path, PathBuf};

use clap::Args;

use super::CliError;
use crate::{
    config::{UNIX_PREFIX, parse_listen},
    files,
    service::Credentials,
};

/// Maximum size of a token or certificate file, bytes.
const MOST_BYTES: u64 = 1 << 20;

/// Credentials for a daemon.
#[derive(Debug, Args)]
pub(super) struct DaemonAccess {
    /// File with the token that the daemon requires.
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// Certificates of trusted authorities, PEM; for https.
    #[arg(long, value_name = "FILE")]
    authorities: Option<PathBuf>,
}

impl DaemonAccess {
    /// Reads the files for a daemon at an address.
    pub(super) fn credentials(&self, address: &str) -> Result<Credentials, CliError> {
        if self.authorities.is_some() && !address.starts_with("https://") {
            return Err(CliError::Usage(format!(
                "--authorities: has no effect with {address}: only https uses certificates"
            )));
        }
        let read = |file: &Option<PathBuf>, key: &str| {
            let text = file.as_ref().map(|file| files::read_text_bounded(file, MOST_BYTES));
            let file = file.as_deref().unwrap_or(Path::new(""));
            text.transpose().map_err(|error| CliError::Usage(format!("--{key} {}: {error}", file.display())))
        };
        let token = read(&self.token_file, "token-file")?.map(|token| token.trim().to_owned());
        Ok(Credentials { token, authorities: read(&self.authorities, "authorities")?, certificate: None })
    }
}

/// Checks an address. A port is required: the default port of HTTP would be used otherwise, and no daemon listens on it by default.
pub(super) fn address(text: &str) -> Result<String, String> {
    let rest = ["http://", "https://"].iter().find_map(|scheme| text.strip_prefix(scheme));
    let place = rest.map_or(text, |rest| rest.strip_suffix('/').unwrap_or(rest));
    let is_path = place.starts_with(UNIX_PREFIX);
    // A socket path may contain anything; a host must not contain another scheme or port 0.
    let is_valid = if is_path { rest.is_none() } else { !place.contains('/') && !place.ends_with(":0") };
    if is_valid && parse_listen(place).is_ok() {
        return Ok(text.to_owned());
    }
    Err(format!(
        "`{text}` is not the address of a daemon: must be HOST:PORT, http://HOST:PORT, https://HOST:PORT or unix:PATH, such as \
         127.0.0.1:7143"
    ))
}

/// Returns the address as a URI: adds a scheme if there is none, as in the address that a daemon prints.
pub(super) fn uri(address: &str) -> String {
    let has_scheme = address.contains("://") || address.starts_with(UNIX_PREFIX);
    if has_scheme { address.to_owned() } else { format!("http://{address}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_of_daemons_have_a_port_or_a_path() {
        for text in ["127.0.0.1:7143", "http://[::1]:7143", "https://dome:7143/", "unix:/run/steradian", "localhost:1"]
        {
            assert_eq!(address(text).as_deref(), Ok(text));
        }
        for text in ["foo:bar", "dome", "http://dome", "ftp://dome:7143", "http://unix:/run/x", "dome:0", ""] {
            assert!(address(text).is_err(), "{text}");
        }
        assert_eq!(
            ["127.0.0.1:1", "unix:/x", "https://dome:1"].map(uri),
            ["http://127.0.0.1:1", "unix:/x", "https://dome:1"]
        );
    }

    #[test]
    fn authorities_need_https() {
        let access = DaemonAccess { token_file: None, authorities: Some("none.pem".into()) };
        let problem =
            |address: &str| access.credentials(address).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(problem("dome:7143").contains("has no effect with dome:7143"));
        assert!(problem("https://dome:7143").starts_with("--authorities none.pem: "));
    }
}

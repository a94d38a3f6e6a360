//! Certificates, and the configuration that they come from.

use std::{path::Path, sync::Arc};

use rustls::{
    RootCertStore, ServerConfig,
    client::verify_server_name,
    pki_types::{CertificateDer, PrivateKeyDer, ServerName, pem::PemObject},
    server::{ParsedCertificate, WebPkiClientVerifier},
};

use super::{Access, Admitted, Validity, digest_of};
use crate::{
    config::{self, TlsConfig},
    files,
};

/// Maximum size of a certificate or key file.
const MOST_BYTES: u64 = 1 << 20;
/// Application protocols (ALPN).
const PROTOCOLS: [&[u8]; 2] = [b"h2", b"http/1.1"];

fn read(key: &str, path: &Path) -> Result<Vec<u8>, String> {
    let text = files::read_bounded(path, MOST_BYTES).map_err(|error| format!("{key} = {}: {error}", path.display()))?;
    // Some editors begin a file with this mark, which PEM does not have.
    Ok(text.strip_prefix(b"\xef\xbb\xbf").map(<[u8]>::to_vec).unwrap_or(text))
}

/// Describes the reason why a PEM file with a private key cannot be read.
fn key_fault(text: &[u8], error: &dyn std::fmt::Display) -> String {
    let has = |word: &str| text.windows(word.len()).any(|part| part == word.as_bytes());
    if has("ENCRYPTED") {
        return "the private key is encrypted: store it without a passphrase, readable for the daemon alone".to_owned();
    }
    format!("{error}; it must contain a private key in PEM")
}

fn certificates(key: &str, path: &Path) -> Result<Vec<CertificateDer<'static>>, String> {
    let wrong = |problem: String| format!("{key} = {}: {problem}; it must contain certificates in PEM", path.display());
    let all: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(&read(key, path)?).collect();
    let all = all.map_err(|error| wrong(error.to_string()))?;
    if all.is_empty() { Err(wrong("it contains none".to_owned())) } else { Ok(all) }
}

/// Splits host names into those that a certificate contains and the others.
fn split_hosts(certificate: &CertificateDer<'_>, hosts: &[String]) -> Result<[Vec<String>; 2], String> {
    let parsed = ParsedCertificate::try_from(certificate).map_err(|error| error.to_string())?;
    let is_named = |host: &&String| {
        let name = ServerName::try_from(host.as_str());
        name.is_ok_and(|name| verify_server_name(&parsed, &name).is_ok())
    };
    let (named, unnamed): (Vec<_>, Vec<_>) = hosts.iter().partition(is_named);
    Ok([named, unnamed].map(|hosts| hosts.into_iter().cloned().collect()))
}

fn server(
    of: &TlsConfig,
    folder: &Path,
    hosts: &[String],
) -> Result<(ServerConfig, Validity, [Vec<String>; 2]), String> {
    let chain = certificates("server.tls.certificate", &folder.join(&of.certificate))?;
    let wrong = |problem: String| format!("server.tls.certificate = {}: {problem}", of.certificate.display());
    let validity = Validity::of_chain(&chain).map_err(wrong)?;
    let hosts = split_hosts(&chain[0], hosts).map_err(wrong)?;
    let path = folder.join(&of.key);
    let text = read("server.tls.key", &path)?;
    let key = PrivateKeyDer::from_pem_slice(&text)
        .map_err(|error| format!("server.tls.key = {}: {}", path.display(), key_fault(&text, &error)))?;
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let builder = ServerConfig::builder_with_provider(Arc::clone(&provider)).with_safe_default_protocol_versions();
    let builder = builder.map_err(|error| format!("[server.tls]: {error}"))?;
    let builder = match &of.client_ca {
        None => builder.with_no_client_auth(),
        Some(path) => {
            let mut roots = RootCertStore::empty();
            let wrong = |problem: String| format!("server.tls.client_ca = {}: {problem}", path.display());
            for certificate in certificates("server.tls.client_ca", &folder.join(path))? {
                roots.add(certificate).map_err(|error| wrong(error.to_string()))?;
            }
            // Accept a client without a certificate, because it may have a token.
            let verifier =
                WebPkiClientVerifier::builder_with_provider(Arc::new(roots), provider).allow_unauthenticated();
            builder.with_client_cert_verifier(verifier.build().map_err(|error| wrong(error.to_string()))?)
        }
    };
    let mut server = builder.with_single_cert(chain, key).map_err(|error| match error {
        rustls::Error::InconsistentKeys(_) => format!(
            "server.tls.key = {}: it does not belong to server.tls.certificate = {}",
            of.key.display(),
            of.certificate.display()
        ),
        error => format!("server.tls.certificate and server.tls.key: {error}"),
    })?;
    server.alpn_protocols = PROTOCOLS.map(<[u8]>::to_vec).to_vec();
    Ok((server, validity, hosts))
}

impl Access {
    /// Reads the access rules of a configuration; relative paths start from `folder`.
    ///
    /// # Errors
    ///
    /// A file cannot be read or is invalid: names the file and the reason.
    pub fn from_config(config: &config::ServerConfig, folder: &Path) -> Result<Self, String> {
        let tls = config.tls.as_ref().map(|tls| server(tls, folder, &config.hosts)).transpose()?;
        let (tls, certificate_validity, hosts) = match tls {
            Some((server, validity, hosts)) => (Some(Arc::new(server)), Some(validity), hosts),
            None => (None, None, [Vec::new(), Vec::new()]),
        };
        let [certified_hosts, uncertified_hosts] = hosts;
        if !config.certificates.is_empty() && config.tls.as_ref().is_none_or(|tls| tls.client_ca.is_none()) {
            return Err(
                "[[server.certificates]] need server.tls.client_ca, the certificate that has signed them".to_owned()
            );
        }
        let tokens = config.tokens.iter().map(|token| Admitted {
            name: token.name.clone(),
            role: token.role,
            digest: token.sha256.0,
        });
        let certificates = config.certificates.iter().map(|certificate| {
            let all = certificates("server.certificates.file", &folder.join(&certificate.file))?;
            let file = certificate.file.display();
            let validity =
                Validity::of(&all[0]).map_err(|problem| format!("server.certificates.file = {file}: {problem}"))?;
            let digest = digest_of(&all[0]);
            let client = Admitted { name: certificate.name.clone(), role: certificate.role, digest };
            Ok((client, (certificate.name.clone(), validity)))
        });
        let certificates = certificates.collect::<Result<Vec<_>, String>>()?;
        let (certificates, client_validities) = certificates.into_iter().unzip();
        Ok(Self {
            tokens: tokens.collect(),
            certificates,
            tls,
            certificate_validity,
            client_validities,
            certified_hosts,
            uncertified_hosts,
        })
    }
}

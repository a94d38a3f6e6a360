//! How a client shows who it is.

use std::fmt;

use tonic::{
    Request, Status,
    metadata::{Ascii, MetadataValue},
    service::{Interceptor, interceptor::InterceptedService},
    transport::{Certificate, Channel, ClientTlsConfig, Identity},
};

use super::client::ClientError;

/// What calls go through.
pub(super) type Transport = InterceptedService<Channel, Bearer>;

/// What a client shows of itself, and whom it trusts.
#[derive(Clone, Default)]
pub struct Credentials {
    /// A token; it is sent with every call.
    pub token: Option<String>,
    /// Certificates of authorities whose daemons are trusted, PEM.
    pub authorities: Option<String>,
    /// The client's certificate with those between it and its authority, and its private key, PEM.
    pub certificate: Option<[String; 2]>,
}

impl fmt::Debug for Credentials {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // No secrets.
        f.debug_struct("Credentials")
            .field("token", &self.token.is_some())
            .field("certificate", &self.certificate.is_some())
            .finish_non_exhaustive()
    }
}

impl Credentials {
    pub(super) fn tls(&self) -> ClientTlsConfig {
        let mut tls = ClientTlsConfig::new();
        if let Some(authorities) = &self.authorities {
            tls = tls.ca_certificate(Certificate::from_pem(authorities));
        }
        if let Some([certificate, key]) = &self.certificate {
            tls = tls.identity(Identity::from_pem(certificate, key));
        }
        tls
    }

    pub(super) fn bearer(&self) -> Result<Bearer, ClientError> {
        let header = self.token.as_ref().map(|token| format!("Bearer {token}").parse());
        // The text of the error has no secret either.
        let header = header.transpose().map_err(|_| ClientError::Token)?;
        Ok(Bearer(header.map(|mut header: MetadataValue<Ascii>| {
            header.set_sensitive(true);
            header
        })))
    }
}

/// Puts a token into every call.
#[derive(Clone, Debug)]
pub(super) struct Bearer(Option<MetadataValue<Ascii>>);

impl Interceptor for Bearer {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(header) = &self.0 {
            request.metadata_mut().insert("authorization", header.clone());
        }
        Ok(request)
    }
}

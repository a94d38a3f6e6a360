//! Credentials of a client.

use std::fmt;

use tonic::{
    Request, Status,
    metadata::{Ascii, MetadataValue},
    service::{Interceptor, interceptor::InterceptedService},
    transport::{Certificate, Channel, ClientTlsConfig, Identity},
};

use super::connection::ClientError;

/// Channel that adds the token to every call.
pub(crate) type Transport = InterceptedService<Channel, Bearer>;

/// Credentials of a client, and the authorities that it trusts.
#[derive(Clone, Default)]
pub struct Credentials {
    /// A token, which is sent with every call.
    pub token: Option<String>,
    /// Certificates of trusted authorities, PEM.
    pub authorities: Option<String>,
    /// Certificate chain and private key of the client, PEM.
    pub certificate: Option<[String; 2]>,
}

impl fmt::Debug for Credentials {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Print no secrets.
        f.debug_struct("Credentials")
            .field("token", &self.token.is_some())
            .field("certificate", &self.certificate.is_some())
            .finish_non_exhaustive()
    }
}

impl Credentials {
    pub(crate) fn tls(&self) -> ClientTlsConfig {
        let mut tls = ClientTlsConfig::new();
        if let Some(authorities) = &self.authorities {
            tls = tls.ca_certificate(Certificate::from_pem(authorities));
        }
        if let Some([certificate, key]) = &self.certificate {
            tls = tls.identity(Identity::from_pem(certificate, key));
        }
        tls
    }

    pub(crate) fn bearer(&self) -> Result<Bearer, ClientError> {
        let header = self.token.as_ref().map(|token| format!("Bearer {token}").parse());
        // The text of this error does not contain the token.
        let header = header.transpose().map_err(|_| ClientError::Token)?;
        Ok(Bearer(header.map(|mut header: MetadataValue<Ascii>| {
            header.set_sensitive(true);
            header
        })))
    }
}

/// Adds the token to every call.
#[derive(Clone, Debug)]
pub(crate) struct Bearer(Option<MetadataValue<Ascii>>);

impl Interceptor for Bearer {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(header) = &self.0 {
            request.metadata_mut().insert("authorization", header.clone());
        }
        Ok(request)
    }
}

//! The gRPC server: its layers from the connection to the service, and their limits.

use std::{sync::Arc, time::Duration};

use tokio::sync::{oneshot, watch};
use tonic::transport::Server;
use tonic_health::pb::health_server::{Health, HealthServer};
use tonic_web::GrpcWebLayer;

use super::ServeError;
use crate::service::{
    handlers::{metrics::Metrics, service::Service},
    network::{
        access::{Access, Gate},
        connections::{Bounds, Incoming},
        http_handler::HandleFirst,
        page::Page,
        statuses::CorrectStatuses,
    },
    proto::{
        self, camera_service_server::CameraServiceServer, diagnostics_service_server::DiagnosticsServiceServer,
        scene_service_server::SceneServiceServer, view_service_server::ViewServiceServer,
    },
};

/// A client that has been silent for this long is pinged.
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(20);
/// A client that does not answer a ping within this time is disconnected.
const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(10);
/// Concurrent calls of one connection; further calls wait.
const CALLS: u32 = 128;
/// Maximum bytes of the headers of a call.
const HEADER_BYTES: u32 = 16 << 10;
/// Maximum bytes of a message, except for changes of the scene.
const SMALL_REQUEST_BYTES: usize = 64 << 10;

/// Parts of the server in front of the service.
pub(super) struct Front {
    /// Names under which clients may address the daemon.
    pub hosts: Vec<String>,
    /// Current access rules.
    pub access: watch::Receiver<Arc<Access>>,
    /// Reason for which a node of a cluster refuses changes.
    pub refusal: Option<Arc<str>>,
    pub incoming: Incoming,
    /// Resolves when no further connection is accepted.
    pub closed: oneshot::Receiver<()>,
}

/// Builder of the reflection services, for the protocol and the health service.
fn reflection<'a>() -> tonic_reflection::server::Builder<'a> {
    tonic_reflection::server::Builder::configure()
        .register_encoded_file_descriptor_set(proto::DESCRIPTORS)
        .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
}

/// Serves connections until `closed` resolves and all calls have ended.
pub(super) fn serve(
    service: Service,
    health: HealthServer<impl Health>,
    front: Front,
) -> Result<impl Future<Output = Result<(), tonic::transport::Error>>, ServeError> {
    let Front { hosts, access, refusal, incoming, closed } = front;
    let (reflection_v1, reflection_v1alpha) = (reflection().build_v1()?, reflection().build_v1alpha()?);
    Ok(Server::builder()
        .accept_http1(true)
        .http2_keepalive_interval(Some(KEEPALIVE_INTERVAL))
        .http2_keepalive_timeout(Some(KEEPALIVE_TIMEOUT))
        .max_concurrent_streams(CALLS)
        .http2_max_header_list_size(HEADER_BYTES)
        .layer(Bounds::new(hosts))
        .layer(Gate::new(access.clone(), refusal))
        .layer(HandleFirst(Metrics { service: service.clone(), access }))
        .layer(HandleFirst(Page::new()))
        .layer(GrpcWebLayer::new())
        .layer(CorrectStatuses)
        .add_service(SceneServiceServer::new(service.clone()))
        .add_service(CameraServiceServer::new(service.clone()).max_decoding_message_size(SMALL_REQUEST_BYTES))
        .add_service(ViewServiceServer::new(service.clone()).max_decoding_message_size(SMALL_REQUEST_BYTES))
        .add_service(DiagnosticsServiceServer::new(service).max_decoding_message_size(SMALL_REQUEST_BYTES))
        .add_service(health)
        .add_service(reflection_v1)
        .add_service(reflection_v1alpha)
        .serve_with_incoming_shutdown(incoming, async move {
            // A dropped sender has the same meaning.
            let _ = closed.await;
        }))
}

//! The role that each call needs.

use crate::{
    config::Role,
    service::network::{http_handler::HEALTH, page::is_page},
};

/// Requirement of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Need {
    /// No role: calls that only reveal that the daemon runs, and the page for the login.
    Nothing,
    /// At least this role.
    Role(Role),
}

/// Calls that move the camera or change the displayed scene.
const STEER: [&str; 7] = [
    "CameraService/SetCamera",
    "CameraService/StreamCamera",
    "SceneService/UpdateScene",
    "ViewService/CreateView",
    "ViewService/UpdateView",
    "ViewService/DeleteView",
    "SceneService/SaveSnapshot",
];
/// Calls that replace the whole state, or take much of the machine.
const ADMIN: [&str; 2] = ["SceneService/LoadSnapshot", "DiagnosticsService/Verify"];

/// Returns the requirement of a path.
pub(super) fn need(path: &str) -> Need {
    if path.starts_with("/grpc.health.v1.Health/") || is_page(path) || path == HEALTH {
        return Need::Nothing;
    }
    let call = path.strip_prefix("/steradian.v1.").unwrap_or_default();
    // The router refuses unknown paths.
    Need::Role(match call {
        call if ADMIN.contains(&call) => Role::Admin,
        call if STEER.contains(&call) => Role::Steer,
        _ => Role::View,
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use prost::Message as _;

    use super::*;
    use crate::service::proto::DESCRIPTORS;

    /// Every call needs a higher role than `view`, unless the verb in its name is one of those that only read.
    #[test]
    fn every_call_of_the_protocol_has_a_role() {
        const LOOKS: [&str; 9] =
            ["Get", "List", "Watch", "Render", "Stream", "Next", "Acknowledge", "Identify", "Find"];
        let files = prost_types::FileDescriptorSet::decode(DESCRIPTORS).unwrap();
        let services = files.file.iter().filter(|file| file.package() == "steradian.v1").flat_map(|file| &file.service);
        let calls: Vec<String> = services
            .flat_map(|service| service.method.iter().map(|method| format!("{}/{}", service.name(), method.name())))
            .collect();
        assert!(calls.len() > 20);
        for call in &calls {
            let (_, method) = call.split_once('/').unwrap();
            let is_named = STEER.contains(&call.as_str()) || ADMIN.contains(&call.as_str());
            assert!(is_named || LOOKS.iter().any(|verb| method.starts_with(verb)), "{call} has no role");
            assert!(
                matches!(need(&format!("/steradian.v1.{call}")), Need::Role(role) if is_named == (role > Role::View))
            );
        }
        for named in STEER.iter().chain(&ADMIN) {
            assert!(calls.iter().any(|call| call == named), "{named} is not a call");
        }
        for path in ["/grpc.health.v1.Health/Check", HEALTH] {
            assert_eq!(need(path), Need::Nothing, "{path}");
        }
        for path in ["/metrics", "/grpc.reflection.v1.ServerReflection/ServerReflectionInfo", "/elsewhere"] {
            assert_eq!(need(path), Need::Role(Role::View), "{path}");
        }
    }
}

//! What each call needs.

use crate::config::Role;

/// What a caller has to be to make a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Need {
    /// Nobody in particular: what tells no more than that there is a daemon, and the page by which one logs in.
    Nothing,
    /// One with this role at least.
    Role(Role),
}

/// Calls that move the camera and change what is seen.
const STEER: [&str; 7] = [
    "CameraService/SetCamera",
    "CameraService/StreamCamera",
    "SceneService/UpdateScene",
    "ViewService/CreateView",
    "ViewService/UpdateView",
    "ViewService/DeleteView",
    "SceneService/SaveSnapshot",
];
/// Calls that put something else in the place of all that is there, or take much of the machine.
const ADMIN: [&str; 2] = ["SceneService/LoadSnapshot", "DiagnosticsService/Verify"];

/// What a path needs.
pub(super) fn need(path: &str) -> Need {
    if path.starts_with("/grpc.health.v1.Health/") || super::super::page::is_page(path) {
        return Need::Nothing;
    }
    let call = path.strip_prefix("/steradian.v1.").unwrap_or_default();
    // What is not known is refused by what stands behind.
    Need::Role(match call {
        call if ADMIN.contains(&call) => Role::Admin,
        call if STEER.contains(&call) => Role::Steer,
        _ => Role::View,
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
mod tests {
    use prost::Message as _;

    use super::*;
    use crate::service::proto::DESCRIPTORS;

    /// A new call whose name does not say that it only looks has to be given a role.
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
            assert!(calls.iter().any(|call| call == named), "{named} is no call");
        }
        assert_eq!(need("/grpc.health.v1.Health/Check"), Need::Nothing);
        for path in ["/metrics", "/grpc.reflection.v1.ServerReflection/ServerReflectionInfo", "/elsewhere"] {
            assert_eq!(need(path), Need::Role(Role::View), "{path}");
        }
    }
}

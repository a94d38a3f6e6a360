//! Refusals that the network reports in its log only: TLS handshakes that failed, messages that an access list denied, connections that could not be
//! opened. Zenoh has no other interface for them, so [`watch`] reads its log, whatever the program's own log shows.
//!
//! | target of Zenoh | level | message | counted as |
//! |---|---|---|---|
//! | `zenoh_link_tls` | warning | reason, and a hint about open files | handshake |
//! | `...::interceptor::access_control` | trace | `ZID on ...CertCommonName(NAME)... is unauthorized to Put (ingress) on KEY` | denied |
//! | `...::runtime::orchestrator` | debug | `Unable to connect to configured peer ENDPOINT! REASON` | connection |
//!
//! The whole process shares one log, and therefore one set of counts. The exact version of Zenoh is pinned, and a test with processes checks each
//! message.

use std::{
    collections::BTreeMap,
    sync::{Mutex, MutexGuard, PoisonError},
};

use steradian_lock::messages::MAX_NODES;

/// Messages of a node that an access list denied.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Denied {
    pub(super) count: u64,
    /// Common name of the certificate with which it was connected.
    pub(super) common_name: String,
}

/// Refusals since the start of the process.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Refusals {
    /// TLS handshakes that failed on this side.
    pub(super) handshakes: u64,
    /// Reason of the last one.
    pub(super) handshake: String,
    /// Denied messages by the name of the node that sent them.
    pub(super) denied: BTreeMap<String, Denied>,
    /// Connections that could not be opened.
    pub(super) connections: u64,
    /// Reason of the last one.
    pub(super) connection: String,
}

static REFUSALS: Mutex<Refusals> = Mutex::new(Refusals {
    handshakes: 0,
    handshake: String::new(),
    denied: BTreeMap::new(),
    connections: 0,
    connection: String::new(),
});

fn all() -> MutexGuard<'static, Refusals> {
    // Nothing can panic while the lock is held, so a poisoned value is consistent.
    REFUSALS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the refusals so far.
pub(super) fn refusals() -> Refusals {
    all().clone()
}

/// Returns a reason without hints and without the location in Zenoh's sources.
fn reason(text: &str) -> &str {
    let text = text.split_once(". Hint:").map_or(text, |(reason, _)| reason);
    text.split_once(" at /").map_or(text, |(reason, _)| reason).trim_end_matches(['.', ' '])
}

#[cfg_attr(not(feature = "cluster"), allow(dead_code, reason = "only the network has this log"))]
impl Refusals {
    /// Notes a message of Zenoh's log.
    fn note(&mut self, target: &str, message: &str) {
        if target.starts_with("zenoh_link_tls") {
            self.handshakes += 1;
            reason(message).clone_into(&mut self.handshake);
        } else if target.ends_with("orchestrator") {
            if let Some((_, why)) = message.split_once("Unable to connect to configured peer ") {
                self.connections += 1;
                reason(why).clone_into(&mut self.connection);
            }
        } else if let Some((subject, key)) = message.split_once(" is unauthorized to Put (ingress) on ")
            && let Some((_, node)) = key.rsplit_once("/up/")
            && (self.denied.contains_key(node) || self.denied.len() < usize::from(MAX_NODES))
        {
            let denied = self.denied.entry(node.to_owned()).or_default();
            denied.count += 1;
            // Later messages use a cached decision and do not name the certificate.
            if let Some((_, name)) = subject.split_once("CertCommonName(") {
                name.split_once(')').map_or(name, |(name, _)| name).clone_into(&mut denied.common_name);
            }
        }
    }
}

/// Returns a layer for a log that counts refusals of the network.
#[cfg(feature = "cluster")]
pub fn watch<S>() -> impl tracing_subscriber::Layer<S>
where
    S: tracing::Subscriber + for<'span> tracing_subscriber::registry::LookupSpan<'span>,
{
    use tracing::level_filters::LevelFilter;
    use tracing_subscriber::{Layer as _, filter::Targets};
    let targets = Targets::new()
        .with_target("zenoh_link_tls", LevelFilter::WARN)
        .with_target("zenoh::net::routing::interceptor::access_control", LevelFilter::TRACE)
        .with_target("zenoh::net::runtime::orchestrator", LevelFilter::DEBUG);
    Watch.with_filter(targets)
}

#[cfg(feature = "cluster")]
struct Watch;

#[cfg(feature = "cluster")]
impl<S: tracing::Subscriber> tracing_subscriber::Layer<S> for Watch {
    fn on_event(&self, event: &tracing::Event<'_>, _: tracing_subscriber::layer::Context<'_, S>) {
        /// The text of an event.
        struct Text(String);
        impl tracing::field::Visit for Text {
            fn record_debug(&mut self, field: &tracing::field::Field, value: &dyn std::fmt::Debug) {
                if field.name() == "message" {
                    self.0 = format!("{value:?}");
                }
            }
        }
        let mut text = Text(String::new());
        event.record(&mut text);
        all().note(event.metadata().target(), &text.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ACCESS: &str = "zenoh::net::routing::interceptor::access_control";

    #[test]
    fn messages_of_the_network_are_counted_with_their_reasons() {
        let mut refusals = Refusals::default();
        let (tls, dial) = ("zenoh_link_tls::unicast", "zenoh::net::runtime::orchestrator");
        refusals.note(tls, "peer sent no certificates. Hint: increase the system open file limit.");
        let alert = "Unable to connect to configured peer tls/127.0.0.1:7447! received fatal alert: UnknownCA at /a/unicast.rs:225.. Retry in 100ms.";
        refusals.note(dial, alert);
        refusals.note(dial, "Already connected");
        let subject = "952f on Interface(lo)+CertCommonName(left)+Transport(Tls)+952f";
        refusals.note(ACCESS, &format!("{subject} is unauthorized to Put (ingress) on steradian/dome/up/right"));
        refusals.note(ACCESS, "Using cached result: 952f is unauthorized to Put (ingress) on steradian/dome/up/right");
        assert_eq!((refusals.handshakes, refusals.connections), (1, 1));
        assert_eq!(refusals.handshake, "peer sent no certificates");
        assert_eq!(refusals.connection, "tls/127.0.0.1:7447! received fatal alert: UnknownCA");
        let denied = Denied { count: 2, common_name: "left".to_owned() };
        assert_eq!(refusals.denied, BTreeMap::from([("right".to_owned(), denied)]));
    }

    #[test]
    fn what_every_connection_causes_is_not_counted() {
        let mut refusals = Refusals::default();
        for message in [
            "952f on CertCommonName(left) is authorized to Put (ingress) on steradian/dome/up/left",
            "952f on CertCommonName(left) is unauthorized to Put (egress) on steradian/dome/up/left",
            "952f on CertCommonName(left) is unauthorized to Query (ingress) on steradian/dome/up/left",
            "952f on CertCommonName(left) is unauthorized to Put (ingress) on steradian/dome/up",
            "952f on CertCommonName(left) is unauthorized to Put (ingress) on steradian/dome/down/all",
        ] {
            refusals.note(ACCESS, message);
        }
        assert_eq!(refusals, Refusals::default());
        // Names that an unknown process invents do not fill the memory.
        (0..1000)
            .for_each(|node| refusals.note(ACCESS, &format!("a is unauthorized to Put (ingress) on s/d/up/{node}")));
        assert_eq!(refusals.denied.len(), usize::from(MAX_NODES));
    }
}

//! The wire over Zenoh: a star of explicit addresses. Nodes connect, directors listen; processes are not discovered by multicast or gossip.
//!
//! | key, below `steradian/NAME` | from | content |
//! |---|---|---|
//! | `down/all`, `down/to/NODE` | director | messages to all nodes, to one |
//! | `up/NODE` | node | messages to all directors |
//! | `node/NODE`, `director/ID` | all | liveliness tokens: they reveal the end of a connection |
//! | `scene` | director | answers requests for the scene |
//!
//! Messages of the lock are express, of real-time priority, and dropped if a connection cannot take them, so that a process that hangs delays no
//! other process. With TLS both sides have certificates, and access lists by common name determine which messages, including tokens, each process may
//! send. Callbacks run on Zenoh's threads and only push into a queue.

use std::{
    path::PathBuf,
    sync::{Arc, Mutex, PoisonError},
};

use serde_json::{Value, json};
use steradian_lock::messages::NodeId;
use zenoh::{
    Config, Session, Wait,
    key_expr::KeyExpr,
    liveliness::LivelinessToken,
    pubsub::Publisher,
    qos::{CongestionControl, Priority},
    query::{Queryable, Reply},
    sample::{Sample, SampleKind},
};

use super::wire::{Hear, Heard, OpenWire, To, Wire};

/// Time after which a silent connection ends, ms. The deadline of READY is shorter; this timeout only frees the resources of a process that hangs.
const LEASE_MS: u32 = 1000;
/// Maximum number of messages that wait for an encrypted connection, for each priority except that of frames. It is the largest value that Zenoh
/// allows.
const MOST_QUEUED: u32 = 16;
/// Time between two attempts to connect, ms.
const RETRY_MS: u32 = 100;

/// Variable for the threads of Zenoh, and its value under TLS: one thread reads and writes all connections. By default several threads do, even for
/// the same encrypted connection at the same time. This corrupts memory and ends the process (eclipse-zenoh/zenoh, issue 2557).
pub const ZENOH_THREADS: (&str, &str) = ("ZENOH_RUNTIME", "(rx: (worker_threads: 1), tx: (handover: rx))");

/// A process's place in the network.
#[derive(Clone, Debug)]
pub struct ZenohOptions {
    /// Name of the cluster.
    pub cluster: String,
    /// Names of the nodes, and the common names of their certificates.
    pub nodes: Vec<(String, String)>,
    /// The number of this node; `None`: a director.
    pub node: Option<NodeId>,
    /// Addresses: for a director the one to listen on, for a node those to connect to.
    pub endpoints: Vec<String>,
    /// Random number of the process.
    pub run: u64,
    /// Certificates; `None`: connections are not encrypted.
    pub tls: Option<ZenohTls>,
}

/// Certificates of a process.
#[derive(Clone, Debug)]
pub struct ZenohTls {
    /// Authority, certificate and key, PEM.
    pub files: [PathBuf; 3],
    /// Common name of directors.
    pub director: String,
}

impl ZenohOptions {
    fn base(&self) -> String {
        format!("steradian/{}", self.cluster)
    }

    fn access(&self, tls: &ZenohTls) -> Value {
        let base = self.base();
        let rule = |id: &str, messages: &[&str], flow: &str, keys: &[String]| json!({ "id": id, "messages": messages, "flows": [flow], "permission": "allow", "key_exprs": keys });
        let key = |rest: &str| format!("{base}/{rest}");
        let mut rules = vec![json!({
            "id": "declare",
            "messages": ["declare_subscriber", "declare_liveliness_subscriber", "liveliness_query"],
            "flows": ["ingress", "egress"],
            "permission": "allow",
            "key_exprs": [key("**")],
        })];
        let mut subjects = Vec::new();
        let mut policies = Vec::new();
        match self.node {
            None => {
                rules.push(rule("down", &["put"], "egress", &[key("down/**")]));
                rules.push(rule("alive", &["liveliness_token"], "egress", &[key("director/**")]));
                rules.push(rule("asked", &["query"], "ingress", &[key("scene")]));
                rules.push(rule("answer", &["reply", "declare_queryable"], "egress", &[key("scene")]));
                let mut all = Vec::new();
                for (index, (name, common_name)) in self.nodes.iter().enumerate() {
                    let (id, subject) = (format!("from{index}"), format!("node{index}"));
                    let keys = [key(&format!("up/{name}")), key(&format!("node/{name}"))];
                    rules.push(rule(&id, &["put", "liveliness_token"], "ingress", &keys));
                    subjects.push(json!({ "id": subject, "cert_common_names": [common_name] }));
                    policies.push(json!({ "rules": [id], "subjects": [subject] }));
                    all.push(subject);
                }
                policies.push(json!({ "rules": ["declare", "down", "alive", "asked", "answer"], "subjects": all }));
            }
            Some(node) => {
                let name = self.nodes.get(usize::from(node.0)).map(|(name, _)| name.as_str()).unwrap_or_default();
                let up = [key(&format!("up/{name}")), key(&format!("node/{name}"))];
                rules.push(rule("up", &["put", "liveliness_token"], "egress", &up));
                rules.push(rule(
                    "down",
                    &["put", "liveliness_token"],
                    "ingress",
                    &[key("down/**"), key("director/**")],
                ));
                rules.push(rule("ask", &["query"], "egress", &[key("scene")]));
                rules.push(rule("answer", &["reply", "declare_queryable"], "ingress", &[key("scene")]));
                subjects.push(json!({ "id": "director", "cert_common_names": [tls.director] }));
                policies.push(json!({ "rules": ["declare", "up", "down", "ask", "answer"], "subjects": ["director"] }));
            }
        }
        json!({
            "enabled": true,
            "default_permission": "deny",
            "rules": rules,
            "subjects": subjects,
            "policies": policies,
        })
    }

    fn config(&self) -> Result<Config, String> {
        let retry = json!({ "period_init_ms": RETRY_MS, "period_max_ms": RETRY_MS, "period_increase_factor": 1.0 });
        let (listen, connect) = match self.node {
            None => (self.endpoints.clone(), Vec::new()),
            Some(_) => (Vec::new(), self.endpoints.clone()),
        };
        let mut values = vec![
            ("mode", json!("peer")),
            ("listen/endpoints", json!(listen)),
            ("connect/endpoints", json!(connect)),
            // -1 means that it tries to connect in the background, without a time limit.
            ("connect/timeout_ms", json!(-1)),
            ("connect/exit_on_failure", json!(false)),
            ("connect/retry", retry),
            ("scouting/multicast/enabled", json!(false)),
            ("scouting/gossip/enabled", json!(false)),
            ("open/return_conditions", json!({ "connect_scouted": false, "declares": false })),
            ("transport/link/tx/lease", json!(LEASE_MS)),
            ("transport/link/tx/queue/batching/enabled", json!(false)),
        ];
        if let Some(tls) = &self.tls {
            let [ca, certificate, key] = &tls.files;
            values.push((
                "transport/link/tls",
                json!({
                    "root_ca_certificate": ca,
                    "enable_mtls": true,
                    "listen_certificate": certificate,
                    "listen_private_key": key,
                    "connect_certificate": certificate,
                    "connect_private_key": key,
                    "verify_name_on_connect": true,
                }),
            ));
            // One thread both reads and writes. If it filled a queue while it reads, it would wait for itself to write messages, so the queues are
            // long. The queue of frames keeps Zenoh's default size, because it has no backlog.
            let queues = json!({
                "control": MOST_QUEUED, "real_time": 2, "interactive_high": MOST_QUEUED, "interactive_low": MOST_QUEUED,
                "data_high": MOST_QUEUED, "data": MOST_QUEUED, "data_low": MOST_QUEUED, "background": MOST_QUEUED,
            });
            values.push(("transport/link/tx/queue/size", queues));
            values.push(("access_control", self.access(tls)));
        }
        let mut config = Config::default();
        for (key, value) in values {
            config.insert_json5(key, &value.to_string()).map_err(|error| format!("{key}: {error}"))?;
        }
        Ok(config)
    }

    /// Returns the function that opens the network.
    pub fn open(self) -> OpenWire {
        Box::new(move |hear| {
            let wire = ZenohWire::open(&self, &hear).map_err(|error| format!("{}: {error}", self.endpoints.join(", ")));
            wire.map(|wire| Box::new(wire) as Box<dyn Wire>)
        })
    }
}

type Opened<T> = Result<T, Box<dyn std::error::Error + Send + Sync>>;

/// An open session. Subscribers live in the background until it is dropped.
struct ZenohWire {
    session: Session,
    scene_key: String,
    /// Publisher to all nodes or directors, and to each node.
    to_all: Publisher<'static>,
    to_each: Vec<Publisher<'static>>,
    scene: Arc<Mutex<Option<Arc<[u8]>>>>,
    hear: Hear,
    _token: LivelinessToken,
    _answers: Option<Queryable<()>>,
}

/// Returns the last part of a key.
fn last<'a>(key: &'a KeyExpr<'_>) -> &'a str {
    key.as_str().rsplit('/').next().unwrap_or_default()
}

impl ZenohWire {
    fn open(options: &ZenohOptions, hear: &Hear) -> Opened<Self> {
        let (name, value) = ZENOH_THREADS;
        if options.tls.is_some() && std::env::var(name).as_deref() != Ok(value) {
            return Err(format!("with TLS the variable {name} must be `{value}`").into());
        }
        let session = zenoh::open(options.config()?).wait()?;
        let base = options.base();
        let publisher = |key: String| -> Opened<Publisher<'static>> {
            let publisher = session.declare_publisher(key).express(true).priority(Priority::RealTime);
            publisher.congestion_control(CongestionControl::Drop).wait()
        };
        let scene: Arc<Mutex<Option<Arc<[u8]>>>> = Arc::default();
        let scene_key = format!("{base}/scene");
        let (to_all, to_each, token, answers) = match options.node {
            None => {
                let names: Vec<String> = options.nodes.iter().map(|(name, _)| name.clone()).collect();
                let number_of = move |key: &KeyExpr<'_>| {
                    let index = names.iter().position(|name| name == last(key))?;
                    u16::try_from(index).ok().map(NodeId)
                };
                let (heard, number) = (Arc::clone(hear), number_of.clone());
                let up = move |sample: Sample| {
                    if let Some(node) = number(sample.key_expr()) {
                        heard(Heard::FromNode(node, sample.payload().to_bytes().into_owned()));
                    }
                };
                session.declare_subscriber(format!("{base}/up/*")).callback(up).background().wait()?;
                let heard = Arc::clone(hear);
                let alive = move |sample: Sample| {
                    if let Some(node) = number_of(sample.key_expr()) {
                        heard(Heard::Node(node, sample.kind() == SampleKind::Put));
                    }
                };
                let nodes = session.liveliness().declare_subscriber(format!("{base}/node/*")).history(true);
                nodes.callback(alive).background().wait()?;
                let (offered, answer_key) = (Arc::clone(&scene), scene_key.clone());
                let answers = session.declare_queryable(scene_key.clone()).callback(move |query| {
                    let bytes = offered.lock().unwrap_or_else(PoisonError::into_inner).clone();
                    if let Some(bytes) = bytes
                        && let Err(error) = query.reply(answer_key.as_str(), bytes.to_vec()).wait()
                    {
                        tracing::debug!("cluster: {error}");
                    }
                });
                let to_each = options.nodes.iter().map(|(name, _)| publisher(format!("{base}/down/to/{name}")));
                let to_each = to_each.collect::<Opened<Vec<_>>>()?;
                let token =
                    session.liveliness().declare_token(format!("{base}/director/{:016x}", options.run)).wait()?;
                (publisher(format!("{base}/down/all"))?, to_each, token, Some(answers.wait()?))
            }
            Some(node) => {
                let (name, _) = options.nodes.get(usize::from(node.0)).ok_or("no such node")?;
                for key in [format!("{base}/down/all"), format!("{base}/down/to/{name}")] {
                    let heard = Arc::clone(hear);
                    let down =
                        move |sample: Sample| heard(Heard::FromDirector(sample.payload().to_bytes().into_owned()));
                    session.declare_subscriber(key).callback(down).background().wait()?;
                }
                let heard = Arc::clone(hear);
                let alive = move |sample: Sample| heard(Heard::Director(sample.kind() == SampleKind::Put));
                let directors = session.liveliness().declare_subscriber(format!("{base}/director/*")).history(true);
                directors.callback(alive).background().wait()?;
                let token = session.liveliness().declare_token(format!("{base}/node/{name}")).wait()?;
                (publisher(format!("{base}/up/{name}"))?, Vec::new(), token, None)
            }
        };
        Ok(Self {
            session,
            scene_key,
            to_all,
            to_each,
            scene,
            hear: Arc::clone(hear),
            _token: token,
            _answers: answers,
        })
    }
}

impl Wire for ZenohWire {
    fn send(&mut self, to: To, bytes: &[u8]) -> Result<(), String> {
        let publisher = match to {
            To::Directors | To::Nodes => &self.to_all,
            To::Node(node) => self.to_each.get(usize::from(node.0)).ok_or("no such node")?,
        };
        publisher.put(bytes).wait().map_err(|error| error.to_string())
    }

    fn offer_scene(&mut self, bytes: Arc<[u8]>) {
        *self.scene.lock().unwrap_or_else(PoisonError::into_inner) = Some(bytes);
    }

    fn ask_scene(&mut self) -> Result<(), String> {
        let hear = Arc::clone(&self.hear);
        let answer = move |reply: Reply| {
            if let Ok(sample) = reply.result() {
                hear(Heard::Scene(sample.payload().to_bytes().into_owned()));
            }
        };
        self.session.get(self.scene_key.as_str()).callback(answer).wait().map_err(|error| error.to_string())
    }
}

//! The messages of the lock as protobuf. Numbers are fixed: director and nodes of one version of [`PROTOCOL`](steradian_lock::messages::PROTOCOL)
//! understand each other.

use prost::Message;
use steradian_lock::messages::{
    Commit, Cue, Epoch, FrameId, Hash, Hello, Identity, Mask, NodeId, Out, OutReason, Ready, Refusal, Report, Skip,
    SkipReason, State, ToDirector, ToNode, Welcome,
};

/// A message that cannot be read: damaged, or of another version.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a message of the cluster cannot be read: {0}")]
pub struct Unreadable(String);

impl From<prost::DecodeError> for Unreadable {
    fn from(error: prost::DecodeError) -> Self {
        Self(error.to_string())
    }
}

fn missing(field: &str) -> Unreadable {
    Unreadable(format!("it lacks {field}"))
}

#[derive(Clone, Copy, PartialEq, Message)]
struct EpochPb {
    #[prost(uint64, tag = "1")]
    counter: u64,
    #[prost(fixed64, tag = "2")]
    run: u64,
}

#[derive(Clone, Copy, PartialEq, Message)]
struct FramePb {
    #[prost(message, optional, tag = "1")]
    epoch: Option<EpochPb>,
    #[prost(uint64, tag = "2")]
    number: u64,
}

#[derive(Clone, PartialEq, Message)]
struct CommitPb {
    #[prost(message, optional, tag = "1")]
    id: Option<FramePb>,
    #[prost(sint64, optional, tag = "2")]
    present_at: Option<i64>,
    #[prost(uint32, repeated, tag = "3")]
    nodes: Vec<u32>,
}

#[derive(Clone, PartialEq, Message)]
struct StatePb {
    #[prost(message, optional, tag = "1")]
    id: Option<FramePb>,
    #[prost(sint64, optional, tag = "2")]
    present_at: Option<i64>,
    #[prost(message, optional, tag = "3")]
    commit: Option<CommitPb>,
    #[prost(bytes = "vec", tag = "4")]
    cue: Vec<u8>,
}

#[derive(Clone, PartialEq, Message)]
struct CataloguePb {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(bytes = "vec", tag = "2")]
    hash: Vec<u8>,
}

#[derive(Clone, PartialEq, Message)]
struct HelloPb {
    #[prost(fixed64, tag = "1")]
    run: u64,
    #[prost(message, optional, tag = "2")]
    promised: Option<EpochPb>,
    #[prost(string, tag = "3")]
    version: String,
    #[prost(uint32, tag = "4")]
    protocol: u32,
    #[prost(bytes = "vec", tag = "5")]
    configuration: Vec<u8>,
    #[prost(message, repeated, tag = "6")]
    catalogues: Vec<CataloguePb>,
    #[prost(string, tag = "7")]
    adapter: String,
    #[prost(string, tag = "8")]
    driver: String,
    #[prost(string, repeated, tag = "9")]
    views: Vec<String>,
    #[prost(string, repeated, tag = "10")]
    windows: Vec<String>,
}

#[derive(Clone, PartialEq, Message)]
struct WelcomePb {
    #[prost(message, optional, tag = "1")]
    epoch: Option<EpochPb>,
    #[prost(fixed64, tag = "2")]
    run: u64,
    #[prost(uint64, tag = "3")]
    newest: u64,
}

/// Exactly one of the fields is set.
#[derive(Clone, PartialEq, Message)]
struct RefusedPb {
    #[prost(uint32, repeated, tag = "1")]
    protocols: Vec<u32>,
    #[prost(string, repeated, tag = "2")]
    versions: Vec<String>,
    #[prost(bool, tag = "3")]
    configuration: bool,
    #[prost(string, optional, tag = "4")]
    catalogue: Option<String>,
    #[prost(uint32, optional, tag = "5")]
    unknown_node: Option<u32>,
}

#[derive(Clone, PartialEq, Message)]
struct ReadyPb {
    #[prost(message, optional, tag = "1")]
    id: Option<FramePb>,
    #[prost(uint64, tag = "2")]
    drawn_ns: u64,
    #[prost(bool, tag = "3")]
    has_clock: bool,
    #[prost(bytes = "vec", tag = "4")]
    report: Vec<u8>,
}

#[derive(Clone, Copy, PartialEq, Message)]
struct SkipPb {
    #[prost(message, optional, tag = "1")]
    id: Option<FramePb>,
    #[prost(uint32, tag = "2")]
    why: u32,
}

#[derive(Clone, Copy, PartialEq, Message)]
struct OutPb {
    #[prost(message, optional, tag = "1")]
    epoch: Option<EpochPb>,
    #[prost(uint32, tag = "2")]
    node: u32,
    #[prost(uint32, tag = "3")]
    why: u32,
}

#[derive(Clone, PartialEq, prost::Oneof)]
enum Body {
    #[prost(message, tag = "1")]
    Hello(HelloPb),
    #[prost(message, tag = "2")]
    Ready(ReadyPb),
    #[prost(message, tag = "3")]
    Welcome(WelcomePb),
    #[prost(message, tag = "4")]
    Refused(RefusedPb),
    #[prost(message, tag = "5")]
    State(StatePb),
    #[prost(message, tag = "6")]
    Commit(CommitPb),
    #[prost(message, tag = "7")]
    Skip(SkipPb),
    #[prost(message, tag = "8")]
    Out(OutPb),
}

#[derive(Clone, PartialEq, Message)]
struct Envelope {
    #[prost(oneof = "Body", tags = "1, 2, 3, 4, 5, 6, 7, 8")]
    body: Option<Body>,
}

const SKIP_REASONS: [SkipReason; 3] = [SkipReason::Starting, SkipReason::Quorum, SkipReason::Deadline];
const OUT_REASONS: [OutReason; 4] = [OutReason::Joining, OutReason::Misses, OutReason::Lost, OutReason::Unknown];

fn index_of<T: PartialEq>(all: &[T], one: &T) -> u32 {
    all.iter().position(|other| other == one).and_then(|index| u32::try_from(index).ok()).unwrap_or(u32::MAX)
}

fn from_index<T: Copy>(all: &[T], index: u32, field: &str) -> Result<T, Unreadable> {
    all.get(index as usize).copied().ok_or_else(|| missing(field))
}

fn epoch_to_pb(epoch: Epoch) -> Option<EpochPb> {
    Some(EpochPb { counter: epoch.counter, run: epoch.run })
}

fn epoch_from_pb(epoch: Option<EpochPb>) -> Result<Epoch, Unreadable> {
    let EpochPb { counter, run } = epoch.ok_or_else(|| missing("an epoch"))?;
    Ok(Epoch { counter, run })
}

fn frame_to_pb(id: FrameId) -> Option<FramePb> {
    Some(FramePb { epoch: epoch_to_pb(id.epoch), number: id.number })
}

fn frame_from_pb(id: Option<FramePb>) -> Result<FrameId, Unreadable> {
    let FramePb { epoch, number } = id.ok_or_else(|| missing("a frame"))?;
    Ok(FrameId { epoch: epoch_from_pb(epoch)?, number })
}

fn node_from_pb(node: u32) -> Result<NodeId, Unreadable> {
    u16::try_from(node).map(NodeId).map_err(|_| missing("a node"))
}

fn hash_from_pb(bytes: Vec<u8>) -> Result<Hash, Unreadable> {
    bytes.try_into().map(Hash).map_err(|_| missing("a hash of 32 bytes"))
}

fn commit_to_pb(commit: &Commit) -> CommitPb {
    let nodes = commit.mask.nodes().map(|node| u32::from(node.0)).collect();
    CommitPb { id: frame_to_pb(commit.id), present_at: commit.present_at, nodes }
}

fn commit_from_pb(commit: CommitPb) -> Result<Commit, Unreadable> {
    let nodes = commit.nodes.into_iter().map(node_from_pb).collect::<Result<Vec<NodeId>, Unreadable>>()?;
    let mask: Mask = nodes.into_iter().collect();
    Ok(Commit { id: frame_from_pb(commit.id)?, present_at: commit.present_at, mask })
}

fn hello_to_pb(hello: &Hello) -> HelloPb {
    let Identity { version, protocol, configuration, catalogues, adapter, driver, views, windows } = &hello.identity;
    let catalogue = |(name, hash): &(String, Hash)| CataloguePb { name: name.clone(), hash: hash.0.to_vec() };
    HelloPb {
        run: hello.run,
        promised: epoch_to_pb(hello.promised),
        version: version.clone(),
        protocol: *protocol,
        configuration: configuration.0.to_vec(),
        catalogues: catalogues.iter().map(catalogue).collect(),
        adapter: adapter.clone(),
        driver: driver.clone(),
        views: views.clone(),
        windows: windows.clone(),
    }
}

fn hello_from_pb(hello: HelloPb) -> Result<Hello, Unreadable> {
    let catalogue = |one: CataloguePb| Ok((one.name, hash_from_pb(one.hash)?));
    let identity = Identity {
        version: hello.version,
        protocol: hello.protocol,
        configuration: hash_from_pb(hello.configuration)?,
        catalogues: hello.catalogues.into_iter().map(catalogue).collect::<Result<_, Unreadable>>()?,
        adapter: hello.adapter,
        driver: hello.driver,
        views: hello.views,
        windows: hello.windows,
    };
    Ok(Hello { run: hello.run, promised: epoch_from_pb(hello.promised)?, identity })
}

fn refused_to_pb(refusal: &Refusal) -> RefusedPb {
    let nothing = RefusedPb::default();
    match refusal {
        Refusal::Protocol { director, node } => RefusedPb { protocols: vec![*director, *node], ..nothing },
        Refusal::Version { director, node } => RefusedPb { versions: vec![director.clone(), node.clone()], ..nothing },
        Refusal::Configuration => RefusedPb { configuration: true, ..nothing },
        Refusal::Catalogue(name) => RefusedPb { catalogue: Some(name.clone()), ..nothing },
        Refusal::UnknownNode(node) => RefusedPb { unknown_node: Some(node.0.into()), ..nothing },
    }
}

fn refused_from_pb(refused: RefusedPb) -> Result<Refusal, Unreadable> {
    let RefusedPb { protocols, versions, configuration, catalogue, unknown_node } = refused;
    if let [director, node] = protocols[..] {
        return Ok(Refusal::Protocol { director, node });
    }
    if let Ok([director, node]) = <[String; 2]>::try_from(versions) {
        return Ok(Refusal::Version { director, node });
    }
    match (configuration, catalogue, unknown_node) {
        (true, ..) => Ok(Refusal::Configuration),
        (_, Some(name), _) => Ok(Refusal::Catalogue(name)),
        (.., Some(node)) => Ok(Refusal::UnknownNode(node_from_pb(node)?)),
        _ => Err(missing("a reason")),
    }
}

fn encoded(body: Body) -> Vec<u8> {
    Envelope { body: Some(body) }.encode_to_vec()
}

fn body_of(bytes: &[u8]) -> Result<Body, Unreadable> {
    Envelope::decode(bytes)?.body.ok_or_else(|| missing("a known content"))
}

/// Encodes a message of a node.
pub fn encode_to_director(message: &ToDirector) -> Vec<u8> {
    encoded(match message {
        ToDirector::Hello(hello) => Body::Hello(hello_to_pb(hello)),
        ToDirector::Ready(Ready { id, drawn_ns, has_clock, report }) => Body::Ready(ReadyPb {
            id: frame_to_pb(*id),
            drawn_ns: *drawn_ns,
            has_clock: *has_clock,
            report: report.0.to_vec(),
        }),
    })
}

/// Decodes a message of a node.
///
/// # Errors
///
/// It is damaged, of another version, or of the other side.
pub fn decode_to_director(bytes: &[u8]) -> Result<ToDirector, Unreadable> {
    match body_of(bytes)? {
        Body::Hello(hello) => Ok(ToDirector::Hello(hello_from_pb(hello)?)),
        Body::Ready(ReadyPb { id, drawn_ns, has_clock, report }) => {
            let report = Report(report.into());
            Ok(ToDirector::Ready(Ready { id: frame_from_pb(id)?, drawn_ns, has_clock, report }))
        }
        _ => Err(missing("a message of a node")),
    }
}

/// Encodes a message of a director.
pub fn encode_to_node(message: &ToNode) -> Vec<u8> {
    encoded(match message {
        ToNode::Welcome(Welcome { epoch, run, newest }) => {
            Body::Welcome(WelcomePb { epoch: epoch_to_pb(*epoch), run: *run, newest: *newest })
        }
        ToNode::Refused(refusal) => Body::Refused(refused_to_pb(refusal)),
        ToNode::State(State { id, present_at, commit, cue }) => Body::State(StatePb {
            id: frame_to_pb(*id),
            present_at: *present_at,
            commit: commit.as_ref().map(commit_to_pb),
            cue: cue.bytes().to_vec(),
        }),
        ToNode::Commit(commit) => Body::Commit(commit_to_pb(commit)),
        ToNode::Skip(Skip { id, why }) => {
            Body::Skip(SkipPb { id: frame_to_pb(*id), why: index_of(&SKIP_REASONS, why) })
        }
        ToNode::Out(Out { epoch, node, why }) => {
            Body::Out(OutPb { epoch: epoch_to_pb(*epoch), node: node.0.into(), why: index_of(&OUT_REASONS, why) })
        }
    })
}

/// Decodes a message of a director.
///
/// # Errors
///
/// It is damaged, of another version, or of the other side.
pub fn decode_to_node(bytes: &[u8]) -> Result<ToNode, Unreadable> {
    Ok(match body_of(bytes)? {
        Body::Welcome(WelcomePb { epoch, run, newest }) => {
            ToNode::Welcome(Welcome { epoch: epoch_from_pb(epoch)?, run, newest })
        }
        Body::Refused(refused) => ToNode::Refused(refused_from_pb(refused)?),
        Body::State(StatePb { id, present_at, commit, cue }) => ToNode::State(State {
            id: frame_from_pb(id)?,
            present_at,
            commit: commit.map(commit_from_pb).transpose()?,
            cue: Cue::new(&cue).map_err(|error| Unreadable(error.to_string()))?,
        }),
        Body::Commit(commit) => ToNode::Commit(commit_from_pb(commit)?),
        Body::Skip(SkipPb { id, why }) => {
            ToNode::Skip(Skip { id: frame_from_pb(id)?, why: from_index(&SKIP_REASONS, why, "a reason")? })
        }
        Body::Out(OutPb { epoch, node, why }) => ToNode::Out(Out {
            epoch: epoch_from_pb(epoch)?,
            node: node_from_pb(node)?,
            why: from_index(&OUT_REASONS, why, "a reason")?,
        }),
        Body::Hello(_) | Body::Ready(_) => return Err(missing("a message of a director")),
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;

    fn id() -> FrameId {
        FrameId { epoch: Epoch { counter: 3, run: u64::MAX }, number: 77 }
    }

    #[test]
    fn every_message_survives_the_wire() {
        let commit = Commit { id: id(), present_at: Some(-5), mask: [0, 64, 255].map(NodeId).into_iter().collect() };
        let state = State { id: id(), present_at: None, commit: Some(commit), cue: Cue::new(&[1, 2]).unwrap() };
        let refusals = [
            Refusal::Protocol { director: 1, node: 2 },
            Refusal::Version { director: "a".to_owned(), node: String::new() },
            Refusal::Configuration,
            Refusal::Catalogue(String::new()),
            Refusal::UnknownNode(NodeId(0)),
        ];
        let to_node = refusals
            .map(ToNode::Refused)
            .into_iter()
            .chain(SKIP_REASONS.map(|why| ToNode::Skip(Skip { id: id(), why })))
            .chain(OUT_REASONS.map(|why| ToNode::Out(Out { epoch: id().epoch, node: NodeId(9), why })))
            .chain([
                ToNode::Welcome(Welcome { epoch: id().epoch, run: 5, newest: 6 }),
                ToNode::State(state),
                ToNode::Commit(commit),
            ]);
        for message in to_node {
            let bytes = encode_to_node(&message);
            assert_eq!(decode_to_node(&bytes), Ok(message));
            assert!(decode_to_director(&bytes).is_err() && decode_to_node(&bytes[..bytes.len() - 1]).is_err());
        }
        let identity = Identity {
            version: "1".to_owned(),
            protocol: 4,
            configuration: Hash([7; 32]),
            catalogues: vec![("stars".to_owned(), Hash([8; 32]))],
            adapter: "adapter".to_owned(),
            driver: "driver".to_owned(),
            views: vec!["a".to_owned(), "b".to_owned()],
            windows: vec!["w".to_owned()],
        };
        let to_director = [
            ToDirector::Hello(Hello { run: 1, promised: id().epoch, identity }),
            ToDirector::Ready(Ready { id: id(), drawn_ns: 8, has_clock: true, report: Report(vec![1].into()) }),
        ];
        for message in to_director {
            let bytes = encode_to_director(&message);
            assert_eq!(decode_to_director(&bytes), Ok(message));
            assert!(decode_to_node(&bytes).is_err());
        }
    }

    #[test]
    fn a_state_with_the_longest_cue_has_at_most_4_kb() {
        let commit = Commit { id: id(), present_at: Some(i64::MIN), mask: (0..12).map(NodeId).collect() };
        let cue = Cue::new(&vec![7; Cue::MAX_BYTES]).unwrap();
        let state = State { id: id(), present_at: Some(i64::MIN), commit: Some(commit), cue };
        assert!(encode_to_node(&ToNode::State(state)).len() <= 4096);
    }
}

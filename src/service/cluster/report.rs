//! The report in a READY message: data of a node that the director displays.

use prost::Message;

#[derive(Clone, PartialEq, Message)]
struct ReportPb {
    #[prost(bytes = "vec", tag = "1")]
    scene_hash: Vec<u8>,
    #[prost(uint64, tag = "2")]
    shown: u64,
}

/// State of a node.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Report {
    /// Hash of the scene that it has drawn.
    pub(super) scene_hash: Option<[u8; 32]>,
    /// Number of the last frame that it has shown; 0: none.
    pub(super) shown: u64,
}

/// Encodes a report.
pub(super) fn encode(report: &Report) -> Vec<u8> {
    let scene_hash = report.scene_hash.map(Vec::from).unwrap_or_default();
    ReportPb { scene_hash, shown: report.shown }.encode_to_vec()
}

/// Decodes a report; `None` if it cannot be read.
pub(super) fn decode(bytes: &[u8]) -> Option<Report> {
    let ReportPb { scene_hash, shown } = ReportPb::decode(bytes).ok()?;
    Some(Report { scene_hash: scene_hash.try_into().ok(), shown })
}

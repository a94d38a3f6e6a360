//! The client's calls about statistics.

use tonic::Streaming;

use super::connection::{Client, ClientError};
use crate::service::proto;

/// Statistics at intervals. Dropping it ends the stream.
#[derive(Debug)]
pub struct StatsReceiver {
    stream: Streaming<proto::Stats>,
}

impl StatsReceiver {
    /// Waits for the next statistics; `None` when the daemon has ended the stream without an error.
    pub async fn next(&mut self) -> Result<Option<proto::Stats>, ClientError> {
        Ok(self.stream.message().await?)
    }
}

impl Client {
    /// Streams the statistics of the daemon and of its headset every `interval_s` seconds (0.1 to 60; `None`: 1), and at each change of the headset's
    /// status.
    pub async fn watch_stats(&mut self, interval_s: Option<f64>) -> Result<StatsReceiver, ClientError> {
        let request = proto::WatchStatsRequest { interval_s };
        Ok(StatsReceiver { stream: self.diagnostics.watch_stats(request).await?.into_inner() })
    }
}

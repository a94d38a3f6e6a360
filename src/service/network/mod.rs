//! Everything between the socket and the gRPC methods: connections and their limits, access control, plain HTTP requests and the web page.

pub(crate) mod access;
pub(crate) mod clients;
pub(crate) mod connections;
pub(crate) mod http_handler;
pub(crate) mod log_summary;
pub(crate) mod page;
pub(crate) mod statuses;

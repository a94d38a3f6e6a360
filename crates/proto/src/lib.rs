//! The protocol of Steradian: messages, clients and servers, generated from `proto/steradian/v1`.
//!
//! For Rust programs that call the daemon without linking the renderer. The comments of the `.proto` files are the documentation of
//! the types. `steradian::service::Client` is the same with plain Rust types.

#![allow(clippy::all, missing_docs, reason = "generated code follows the rules of its generator")]

#[doc(hidden)]
pub mod lists;

/// Version 1 of the protocol.
pub mod v1 {
    tonic::include_proto!("steradian.v1");

    /// Serialised `FileDescriptorSet` of all messages and calls, for server reflection.
    pub const DESCRIPTORS: &[u8] = tonic::include_file_descriptor_set!("steradian_descriptors");
}

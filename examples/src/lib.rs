//! Examples of Steradian, next to this folder: `cargo run --release --example client -- --help`.

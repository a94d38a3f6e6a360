//! The daemon's service over a real socket, with a small engine in place of the renderer.

mod calls;
mod daemon;
mod lifecycle;
mod protocol;
mod streams;

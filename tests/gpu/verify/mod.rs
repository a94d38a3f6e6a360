//! The checks of `verify`: what is right passes, and each fault fails.

mod checks;
mod glare;
mod objects;

//! The checks of `verify`: correct methods pass, and each fault fails.

mod checks;
mod glare;
mod objects;

//! Configuration files: valid and invalid ones.

mod objects;
mod sections;

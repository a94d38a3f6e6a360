//! Configuration files, read and refused.

mod objects;
mod sections;

//! Parsers with mutated inputs: each entry point of `fuzz/targets.rs` for a few inputs, and for a minute where long tests run.
//!
//! `driver` says how, docs/fuzzing.md which parser is where. The messages of the service are private to it: `src/service/fuzz_tests.rs`.
#![allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
#![allow(clippy::print_stderr, reason = "the process that reads tells why it ends")]

mod driver;
mod formats;
mod seeds;
#[path = "../../fuzz/targets.rs"]
mod targets;

use driver::{Run, Target, as_it_is, check};

/// What any parser of small files may take of memory, bytes.
const SMALL: u64 = 512 << 20;

macro_rules! fuzz {
    ($($name:ident: $seeds:expr, $tokens:expr, $repair:expr, $most_bytes:expr;)*) => {
        $(mod $name {
            use super::*;

            const TARGET: Target = Target {
                name: stringify!($name),
                read: targets::$name,
                seeds: $seeds,
                tokens: $tokens,
                repair: $repair,
                most_bytes: $most_bytes,
            };

            #[test]
            fn few() {
                check(&TARGET, Run::Short, concat!(module_path!(), "::few"));
            }

            #[test]
            #[ignore = "long: make test-all"]
            fn for_a_minute() {
                check(&TARGET, Run::Long, concat!(module_path!(), "::for_a_minute"));
            }
        })*
    };
}

fuzz! {
    configuration: seeds::configurations, seeds::KEYS, as_it_is, SMALL;
    csv: seeds::csv, seeds::COLUMNS, as_it_is, SMALL;
    json: seeds::json, seeds::JSON, as_it_is, SMALL;
    star_store: seeds::star_store, &[], formats::repair_store, SMALL;
    gltf: seeds::gltf, seeds::GLTF, formats::repair_glb, SMALL;
    // The largest point-spread function has 4096 x 4096 pixels, decoded in f64.
    point_spread: seeds::point_spread, seeds::PSF, as_it_is, 3 << 30;
    // The largest texture has 2^27 texels: 400 MB as they are in the file, 1.6 GB as numbers.
    texture: seeds::textures, seeds::PNG, formats::repair_png, 3 << 30;
    glare_table: seeds::glare_table, seeds::TABLE, as_it_is, SMALL;
}

//! Sets a `cfg` for each kind of optional test data that the environment names, so that tests whose data are missing
//! are shown as ignored.

fn main() {
    // tests/cpu/stars/bright_stars.rs, tests/gpu/stars/whole_sky.rs
    println!("cargo::rustc-check-cfg=cfg(has_bsc_csv)");
    println!("cargo::rerun-if-env-changed=STERADIAN_BSC_CSV");
    if std::env::var_os("STERADIAN_BSC_CSV").is_some_and(|path| !path.is_empty()) {
        println!("cargo::rustc-cfg=has_bsc_csv");
    }
}

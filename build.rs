//! Tells the compiler which optional test data the environment offers, so that tests without it are shown as ignored.

fn main() {
    // tests/cpu/stars/bright_stars.rs, tests/gpu/stars/whole_sky.rs
    println!("cargo::rustc-check-cfg=cfg(has_bsc_csv)");
    println!("cargo::rerun-if-env-changed=STERADIAN_BSC_CSV");
    if std::env::var_os("STERADIAN_BSC_CSV").is_some_and(|path| !path.is_empty()) {
        println!("cargo::rustc-cfg=has_bsc_csv");
    }
}

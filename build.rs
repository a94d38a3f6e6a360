//! Tells the compiler which optional test data the environment offers, so that tests without it show as ignored.

fn main() {
    // tests/bright_stars.rs
    println!("cargo::rustc-check-cfg=cfg(has_bsc_csv)");
    println!("cargo::rerun-if-env-changed=STERADIAN_BSC_CSV");
    if std::env::var_os("STERADIAN_BSC_CSV").is_some_and(|path| !path.is_empty()) {
        println!("cargo::rustc-cfg=has_bsc_csv");
    }
}

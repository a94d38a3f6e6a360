//! The folder in which the program keeps baked atlases of asteroids.

use std::{
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

const CONFIGURATION: &str = "[scene]\ncatalogues = []\n[asteroids]\ntiles = 4\ntile_px = 8\n\
     [[asteroid_fields]]\nname = 'f'\nposition_m = [0, 0, -1e4]\ninstances = 3\nradius_m = [10, 20]\ngeometric_albedo = 0.1\n\
     shape = 'box'\nsize_m = [1e3, 1e3, 1e3]\n\
     [[views]]\nname = 'v'\ntype = 'perspective'\nsize = [16, 16]\nfov_y_deg = 40\n";

/// Renders into the folder `out` with more arguments and a cache folder, and returns the log.
fn render_to(out: &str, folder: &Path, cache: &Path, more: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_steradian"))
        .args(["render", "--config", "c.toml", "--out", out, "--files", "png"])
        .args(more)
        .current_dir(folder)
        .env("STERADIAN_CACHE_DIR", cache)
        .env_remove("STERADIAN_LOG")
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let log = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{log}");
    log
}

fn render(folder: &Path, cache: &Path, more: &[&str]) -> String {
    render_to("out", folder, cache, more)
}

fn atlases(cache: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(cache.join("atlases")) else { return Vec::new() };
    entries.map(|entry| entry.unwrap().path()).collect()
}

#[test]
fn atlases_are_kept_in_the_cache_folder_mended_and_switched_off() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("c.toml"), CONFIGURATION).unwrap();
    let cache = folder.path().join("cache");
    render(folder.path(), &cache, &["--set", "asteroids.cache=''"]);
    render(folder.path(), Path::new(""), &[]);
    assert!(!cache.exists(), "switched off by the key and by the variable");

    render(folder.path(), &cache, &[]);
    let [kept] = &atlases(&cache)[..] else { panic!("{:?}", atlases(&cache)) };
    let valid = fs::read(kept).unwrap();
    let picture = fs::read(folder.path().join("out/v.png")).unwrap();
    let modified = || fs::metadata(kept).unwrap().modified().unwrap();
    let written = modified();
    let log = render(folder.path(), &cache, &[]);
    assert!(!log.contains("atlas") && modified() == written, "the second run reads it: {log}");

    fs::write(kept, &valid[..valid.len() - 1]).unwrap();
    let log = render(folder.path(), &cache, &[]);
    assert!(log.contains("cannot use the cached impostor atlas; baking it again"), "{log}");
    assert!(fs::read(kept).unwrap() == valid);
    assert!(fs::read(folder.path().join("out/v.png")).unwrap() == picture);

    // Two programs at once, with a damaged file.
    fs::write(kept, b"damaged").unwrap();
    std::thread::scope(|scope| {
        (0..2).for_each(|copy| {
            let (folder, cache, name) = (folder.path(), &cache, format!("out{copy}"));
            scope.spawn(move || render_to(&name, folder, cache, &[]));
        });
    });
    assert!(fs::read(kept).unwrap() == valid && atlases(&cache).len() == 1);
}

#[test]
fn tests_keep_their_caches_out_of_the_users_folder() {
    let folder = std::env::var_os("STERADIAN_CACHE_DIR").filter(|folder| *folder != OsString::new());
    let folder = PathBuf::from(folder.expect(".cargo/config.toml sets it"));
    assert!(folder.starts_with(Path::new(env!("CARGO_MANIFEST_DIR")).join("target")), "{}", folder.display());
}

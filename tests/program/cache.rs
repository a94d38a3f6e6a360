//! Tests the data that the program keeps between runs.

use std::{
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
};

const STARS: &str = "[scene]\ncatalogues = [{ galaxy = { stars = 500, unresolved_light = false } }]\n\
     [[views]]\nname = 'v'\ntype = 'perspective'\nsize = [16, 16]\nfov_y_deg = 40\n";
const ASTEROIDS: &str = "[asteroids]\ntiles = 4\ntile_px = 8\n\
     [[asteroid_fields]]\nname = 'f'\nposition_m = [0, 0, -1e4]\ninstances = 3\nradius_m = [10, 20]\ngeometric_albedo = 0.1\n\
     shape = 'box'\nsize_m = [1e3, 1e3, 1e3]\n";

/// Runs the program in a folder with a cache folder.
fn run(folder: &Path, cache: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_steradian"))
        .args(arguments)
        .current_dir(folder)
        .env("STERADIAN_CACHE_DIR", cache)
        .env_remove("STERADIAN_CACHE_MIB")
        .env_remove("STERADIAN_LOG")
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

/// Renders into the folder `out` with additional arguments, and returns the log.
fn render_to(out: &str, folder: &Path, cache: &Path, more: &[&str]) -> String {
    let arguments = [&["render", "--config", "c.toml", "--out", out, "--files", "png"], more].concat();
    let output = run(folder, cache, &arguments);
    let log = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{log}");
    log
}

fn render(folder: &Path, cache: &Path, more: &[&str]) -> String {
    render_to("out", folder, cache, more)
}

/// Returns all files of a cache, in the order of their names.
fn files(cache: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(cache) else { return Vec::new() };
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

/// Returns the notes of compiled shaders. They exist only for drivers that keep compiled shaders.
fn shaders(cache: &Path) -> Vec<PathBuf> {
    files(cache).into_iter().filter(|path| path.to_string_lossy().contains("compiled-shader-")).collect()
}

/// Returns all files except notes of compiled shaders, in the order of their names.
fn entries(cache: &Path) -> Vec<PathBuf> {
    let shaders = shaders(cache);
    files(cache).into_iter().filter(|path| !shaders.contains(path)).collect()
}

/// Returns the name of the part of the program that made an entry.
fn part(path: &Path) -> String {
    path.file_name().unwrap().to_str().unwrap().rsplit_once('-').unwrap().0.to_owned()
}

#[test]
fn stars_are_kept_mended_and_switched_off() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("c.toml"), STARS).unwrap();
    let cache = folder.path().join("cache");
    render(folder.path(), &cache, &["--no-cache"]);
    render(folder.path(), Path::new(""), &[]);
    assert!(!cache.exists(), "switched off by the argument and by the variable");
    let picture = fs::read(folder.path().join("out/v.png")).unwrap();

    render(folder.path(), &cache, &[]);
    let [kept] = &entries(&cache)[..] else { panic!("{:?}", entries(&cache)) };
    assert_eq!(part(kept), "galaxy");
    let shaders_of_first = shaders(&cache);
    let valid = fs::read(kept).unwrap();
    let written = || fs::metadata(kept).unwrap().modified().unwrap();
    let first = written();
    let log = render(folder.path(), &cache, &[]);
    assert!(written() == first && !log.contains("cached"), "the second run must read the entry: {log}");
    assert_eq!(shaders(&cache), shaders_of_first, "the second run must compile the same shaders");
    assert!(fs::read(folder.path().join("out/v.png")).unwrap() == picture);

    // Other inputs give other stars. The entry of the first stars is kept.
    let other = "scene.catalogues=[{ galaxy = { stars = 501, unresolved_light = false } }]";
    render(folder.path(), &cache, &["--set", other]);
    assert_eq!(entries(&cache).len(), 2);

    fs::write(kept, &valid[..valid.len() - 1]).unwrap();
    let log = render(folder.path(), &cache, &[]);
    assert!(log.contains("cannot use the cached galaxy; making it again"), "{log}");
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
    assert!(fs::read(kept).unwrap() == valid);
    assert_eq!(entries(&cache).len(), 2);
}

#[test]
fn the_cache_is_shown_limited_and_cleared() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("c.toml"), format!("{STARS}{ASTEROIDS}")).unwrap();
    let cache = folder.path().join("cache");
    let printed = |arguments: &[&str]| {
        let output = run(folder.path(), &cache, arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    assert!(printed(&["cache", "info"]).contains("size:   0.0 MiB of at most 2048.0 MiB"), "the folder does not exist");
    render(folder.path(), &cache, &[]);
    let info: serde_json::Value = serde_json::from_str(&printed(&["cache", "info", "--json"])).unwrap();
    let bytes: u64 = files(&cache).iter().map(|path| fs::metadata(path).unwrap().len()).sum();
    assert_eq!(info["bytes"], bytes);
    assert_eq!(
        (&info["parts"]["galaxy"]["entries"], &info["parts"]["asteroid-atlas"]["entries"]),
        (&1.into(), &1.into())
    );
    let text = printed(&["cache", "info"]);
    assert!(text.contains("galaxy: 1 entries, ") && text.contains(cache.to_str().unwrap()), "{text}");

    fs::write(cache.join("notes.txt"), "mine").unwrap();
    let removed = format!("removed {} entries, ", 2 + shaders(&cache).len());
    assert!(printed(&["cache", "clear"]).starts_with(&removed));
    assert_eq!(files(&cache), [cache.join("notes.txt")]);

    // If there is no folder, or the limit is wrong, the message names the problem.
    for (variable, value, problem) in [
        ("STERADIAN_CACHE_DIR", "", "there is no cache folder"),
        ("STERADIAN_CACHE_MIB", "much", "STERADIAN_CACHE_MIB=much: must be a whole number of MiB"),
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_steradian"))
            .args(["cache", "info"])
            .env(variable, value)
            .stdin(Stdio::null())
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(64));
        let log = String::from_utf8(output.stderr).unwrap();
        assert!(log.contains(problem), "{log}");
    }
}

#[test]
fn tests_keep_their_caches_out_of_the_users_folder() {
    let folder = std::env::var_os("STERADIAN_CACHE_DIR").filter(|folder| *folder != OsString::new());
    let folder = PathBuf::from(folder.expect(".cargo/config.toml sets it"));
    assert!(folder.starts_with(Path::new(env!("CARGO_MANIFEST_DIR")).join("target")), "{}", folder.display());
}

#[test]
fn a_file_at_the_place_of_the_folder_is_reported_once_and_nothing_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("c.toml"), STARS).unwrap();
    let cache = folder.path().join("cache");
    fs::write(&cache, "a file").unwrap();
    let log = render(folder.path(), &cache, &[]);
    assert_eq!(log.matches("WARN").count(), 1, "{log}");
    assert!(log.contains("cannot be used, so nothing is kept: it is a file"), "{log}");
    assert_eq!(fs::read(&cache).unwrap(), b"a file");
}

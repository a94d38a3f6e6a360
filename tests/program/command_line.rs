//! The program's interface to scripts: output streams and exit codes.

mod deep_stores;
mod refusals;
mod serve;

use std::path::Path;
use std::process::{Command, Output, Stdio};

const CSV: &str = "ra_deg,dec_deg,v_mag,parallax_mas\n10,20,3.0,100\n11,oops,3.0,\n12,22,4.0,\n";

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_steradian"));
    command.args(arguments).current_dir(folder).stdin(Stdio::null());
    command.env_remove("STERADIAN_LOG").env_remove("STERADIAN_SHADERS");
    command
}

fn steradian(folder: &Path, arguments: &[&str]) -> Output {
    command(folder, arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Runs the program, checks the exit code, and returns standard output and standard error.
#[track_caller]
fn run(folder: &Path, arguments: &[&str], code: i32) -> (String, String) {
    let output = steradian(folder, arguments);
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(code), "{arguments:?}\nstdout: {out}\nstderr: {err}");
    (out, err)
}

#[test]
fn help_with_examples_and_version_go_to_standard_output() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [
        &["--help"][..],
        &["render", "--help"],
        &["serve", "--help"],
        &["info", "--help"],
        &["chart", "--help"],
        &["verify", "--help"],
        &["catalogue", "import", "--help"],
        &["catalogue", "info", "--help"],
        &["catalogue", "synth", "--help"],
        &["catalogue", "check", "--help"],
        &["catalogue", "slice", "--help"],
        &["catalogue", "export", "--help"],
    ] {
        let (out, err) = run(folder.path(), arguments, 0);
        assert!(out.contains("Example") && out.contains("\n  steradian "), "{out}");
        assert!(err.is_empty(), "{err}");
    }
    let (out, _) = run(folder.path(), &["--version"], 0);
    assert_eq!(out.trim(), format!("steradian {}", env!("CARGO_PKG_VERSION")));
}

#[test]
fn bad_usage_exits_64() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [
        &[][..],
        &["dance"],
        &["catalogue"],
        &["catalogue", "import", "--out", "x.stars"],
        &["catalogue", "import", "x.csv"],
        &["catalogue", "synth", "--stars", "0", "--seed", "1", "--out", "x.stars"],
        &["catalogue", "synth", "--stars", "many", "--seed", "1", "--out", "x.stars"],
        &["catalogue", "synth", "--stars", "9", "--seed", "1", "--fainter-than", "nan", "--out", "x.stars"],
        &["catalogue", "synth", "--stars", "9", "--seed", "1", "--memory", "1MiB", "--out", "x"],
        &["catalogue", "slice", "x.stars", "--cone", "1,2", "--out", "y.stars"],
        &["catalogue", "export", "x.stars", "--magnitudes", "9..8", "--out", "y.csv"],
        &["--log", "steradian=loudly", "catalogue", "info", "x.stars"],
    ] {
        let (out, err) = run(folder.path(), arguments, 64);
        assert!(out.is_empty(), "{arguments:?}: {out}");
        assert!(!err.is_empty(), "{arguments:?}");
    }
    let (_, err) = run(folder.path(), &["catalogue", "synth", "--stars", "0", "--seed", "1", "--out", "x"], 64);
    assert!(err.contains("--stars") && err.contains("between 1 and"), "{err}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "no file is written");
}

#[test]
fn bad_data_exits_65_with_one_error() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, content: &str| std::fs::write(folder.path().join(name), content).unwrap();
    file("broken.csv", "ra_deg,dec_deg,v_mag\nx,y,z\n1,2,\n");
    file("columns.csv", "a,b\n1,2\n");
    file("broken.stars", "STERSTAR and no more");
    file("text.stars", "no store at all");
    for (arguments, parts) in [
        (&["catalogue", "import", "missing.csv", "--out", "o.stars"][..], &["missing.csv"][..]),
        (&["catalogue", "import", "broken.csv", "--out", "o.stars"], &["broken.csv", "line 2", "2 rows"]),
        (&["catalogue", "import", "columns.csv", "--out", "o.stars"], &["columns.csv", "ra_deg"]),
        (&["catalogue", "import", "broken.stars", "--out", "o.stars"], &["broken.stars", "damaged"]),
        (&["catalogue", "info", "broken.stars"], &["broken.stars", "damaged"]),
        (&["catalogue", "info", "text.stars"], &["text.stars", "not a star store"]),
        (&["catalogue", "info", "missing.stars"], &["missing.stars"]),
    ] {
        let (out, err) = run(folder.path(), arguments, 65);
        assert!(out.is_empty(), "{out}");
        for part in parts {
            assert!(err.contains(part), "`{part}` is not in: {err}");
        }
        assert_eq!(err.matches("error:").count(), 1, "{err}");
    }
    assert!(!folder.path().join("o.stars").exists());
}

#[test]
fn million_broken_rows_give_one_short_message() {
    let folder = tempfile::tempdir().unwrap();
    let mut csv = String::from("ra_deg,dec_deg,v_mag\n");
    csv.push_str(&"junk,more junk,\n".repeat(1_000_000));
    std::fs::write(folder.path().join("junk.csv"), csv).unwrap();
    let (_, err) = run(folder.path(), &["catalogue", "import", "junk.csv", "--out", "o.stars"], 65);
    assert!(err.contains("1000000 rows") && err.contains("line 2"), "{err}");
    assert!(err.len() < 2000, "{}", err.len());
}

#[test]
fn import_reports_bad_rows_and_info_describes_the_store() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("two.csv"), CSV).unwrap();
    let (out, err) = run(folder.path(), &["catalogue", "import", "two.csv", "builtin:bright", "--out", "sky.stars"], 0);
    assert!(out.contains("two.csv: 2 stars, read as plain table, 1 of 3 rows rejected"), "{out}");
    assert!(out.contains("wrote sky.stars"), "{out}");
    assert!(err.contains("line 3"), "{err}");
    assert!(err.contains("loading two.csv (1 of 2)"), "plain progress lines: {err}");

    let (out, err) = run(folder.path(), &["--log", "warn", "catalogue", "info", "sky.stars"], 0);
    assert!(err.is_empty(), "{err}");
    let value = |key: &str| {
        let line = out.lines().find(|line| line.starts_with(key)).unwrap_or_else(|| panic!("{key} is not in: {out}"));
        line[key.len()..].trim().to_owned()
    };
    let stars: usize = value("stars").parse().unwrap();
    assert!(stars > 302, "{out}");
    let at_infinity: usize = value("at infinity").parse().unwrap();
    assert!(at_infinity >= 1 && at_infinity < stars, "{out}");
    // The brightest star is Sirius.
    assert!(value("apparent V").starts_with("-1.4"), "{out}");
    assert!(out.contains("from              builtin:bright"), "{out}");
}

#[test]
fn stores_depend_only_on_their_seed() {
    let folder = tempfile::tempdir().unwrap();
    let synth = |seed: &str, out: &str| {
        let arguments =
            ["catalogue", "synth", "--stars", "5000", "--seed", seed, "--fainter-than", "3.5", "--out", out];
        let (result, _) = run(folder.path(), &arguments, 0);
        assert!(result.contains("5000 stars") && result.contains("synthetic"), "{result}");
        std::fs::read(folder.path().join(out)).unwrap()
    };
    let first = synth("1", "a.stars");
    assert_eq!(first, synth("1", "b.stars"));
    assert_ne!(first, synth("2", "c.stars"));

    let (out, _) = run(folder.path(), &["catalogue", "info", "a.stars"], 0);
    assert!(out.contains("synthetic galaxy (5000 stars, seed 1, fainter than V = 3.5)"), "{out}");
    let range = out.lines().find(|line| line.starts_with("apparent V")).unwrap();
    let brightest: f64 = range.split_whitespace().nth(2).unwrap().parse().unwrap();
    assert!((3.5..4.5).contains(&brightest), "{range}");

    // Stores are catalogues too, so several of them can be imported into one store.
    let (out, _) = run(folder.path(), &["catalogue", "import", "a.stars", "c.stars", "--out", "both.stars"], 0);
    assert!(out.contains("wrote both.stars: 10000 stars"), "{out}");
}

#[test]
fn unwritable_store_exits_1() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("two.csv"), CSV).unwrap();
    let (_, err) = run(folder.path(), &["catalogue", "import", "two.csv", "--out", "no/such/folder/x.stars"], 1);
    assert!(err.contains("no/such/folder/x.stars"), "{err}");
}

#[test]
fn closed_standard_output_is_not_a_failure() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), &["catalogue", "import", "builtin:bright", "--out", "b.stars"], 0);
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output = Command::new(env!("CARGO_BIN_EXE_steradian"))
        .args(["catalogue", "info", "b.stars"])
        .current_dir(folder.path())
        .stdout(writer)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(text(&output.stderr).is_empty(), "{}", text(&output.stderr));
}

const SCENE: &str = "[scene]\ncatalogues = ['builtin:bright']\n[[views]]\nname = 'all'\ntype = 'equirectangular'\nsize = [64, 32]\n\
    [[views]]\nname = 'cube'\ntype = 'cubemap'\nface_size = 16\nfaces = ['up', 'front']\n[[views]]\nname = 'eyes'\ntype = 'stereo'\n\
    size = [16, 16]\nipd_m = 0.06\nfov = { left_deg = -40, right_deg = 30, up_deg = 30, down_deg = -30 }\n";

#[test]
fn render_bytes_do_not_depend_on_threads() {
    let folder = tempfile::tempdir().unwrap();
    // With this number of stars and this exposure, the frame uses a map of faint stars.
    let scene = "[scene]\ncatalogues = [{ galaxy = { stars = 300000, seed = 1, fainter_than = 3.5 } }]\n\
        [[views]]\nname = 'dome'\ntype = 'dome_master'\nsize = [256, 256]\n[exposure]\nmode = 'manual'\nev100 = -5.4\n";
    std::fs::write(folder.path().join("dome.toml"), scene).unwrap();
    let mut first: Option<Vec<Vec<u8>>> = None;
    for threads in ["1", "3", "8"] {
        let output = Command::new(env!("CARGO_BIN_EXE_steradian"))
            .args(["render", "--config", "dome.toml", "--out", threads])
            .current_dir(folder.path())
            .env("RAYON_NUM_THREADS", threads)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let read = |name: &str| std::fs::read(folder.path().join(threads).join(name)).unwrap();
        let files = ["dome.png", "dome.exr", "manifest.json"].map(read).to_vec();
        let manifest: serde_json::Value = serde_json::from_slice(&files[2]).unwrap();
        assert!(manifest["views"][0]["stars_in_map"].as_u64().unwrap() > 10_000, "the frame uses the map: {manifest}");
        assert!(first.get_or_insert_with(|| files.clone()) == &files, "{threads} threads");
    }
    // The bytes of a file do not depend on which other files are written.
    let both = first.unwrap();
    for (kind, file, absent, expected) in
        [("png", "dome.png", "dome.exr", &both[0]), ("exr", "dome.exr", "dome.png", &both[1])]
    {
        run(folder.path(), &["render", "--config", "dome.toml", "--out", kind, "--files", kind], 0);
        assert!(&std::fs::read(folder.path().join(kind).join(file)).unwrap() == expected, "{file} alone");
        assert!(!folder.path().join(kind).join(absent).exists(), "{absent} was not requested");
    }
    let (_, error) = run(folder.path(), &["render", "--config", "dome.toml", "--out", "c", "--files", "gif"], 64);
    assert!(error.contains("gif") && error.contains("png") && error.contains("exr"), "{error}");
}

#[test]
fn explain_prints_bounds_of_display_and_hdr_images() {
    let folder = tempfile::tempdir().unwrap();
    // Use pixels of less than 0.7 degrees, so that display images have a budget of their own.
    let scene =
        "[scene]\ncatalogues = ['builtin:bright']\n[[views]]\nname = 'all'\ntype = 'dome_master'\nsize = [300, 300]\n";
    std::fs::write(folder.path().join("sky.toml"), scene).unwrap();
    let (out, _) = run(folder.path(), &["render", "--config", "sky.toml", "--out", "a", "--explain"], 0);
    for expected in [
        "exposure    EV100 ",
        "view        all: ",
        "shows stars to V = ",
        "display images\n",
        "HDR images\n",
        "  bound     ",
    ] {
        assert!(out.contains(expected), "{expected}: {out}");
    }
}

#[test]
fn render_writes_all_images_and_the_manifest_deterministically() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("sky.toml"), SCENE).unwrap();
    let (out, _) = run(folder.path(), &["render", "--config", "sky.toml", "--out", "a"], 0);
    let expected = ["all", "cube.up", "cube.front", "eyes.left", "eyes.right"];
    for stem in expected {
        for extension in ["exr", "png"] {
            assert!(
                out.lines().any(|line| Path::new(line) == Path::new("a").join(format!("{stem}.{extension}"))),
                "{out}"
            );
        }
    }
    let manifest = std::fs::read(folder.path().join("a/manifest.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_slice(&manifest).unwrap();
    assert!(!manifest["adapter"].as_str().unwrap().is_empty());
    let views = manifest["views"].as_array().unwrap();
    assert_eq!(views.iter().map(|view| view["name"].as_str().unwrap()).collect::<Vec<_>>(), ["all", "cube", "eyes"]);
    assert_eq!(views[1]["files"].as_array().unwrap().len(), 4);
    assert!(views[0]["stars_drawn"].as_u64().unwrap() > 300, "the full sphere shows every star: {manifest}");

    run(folder.path(), &["render", "--config", "sky.toml", "--out", "b"], 0);
    for stem in expected {
        for extension in ["exr", "png"] {
            let read = |out: &str| std::fs::read(folder.path().join(format!("{out}/{stem}.{extension}"))).unwrap();
            assert_eq!(read("a"), read("b"), "{stem}.{extension}");
        }
    }
    // An override affects the picture.
    run(folder.path(), &["render", "--config", "sky.toml", "--out", "c", "--set", "views.all.size=[32, 16]"], 0);
    let size = |out: &str| {
        let png = std::fs::File::open(folder.path().join(format!("{out}/all.png"))).unwrap();
        png::Decoder::new(std::io::BufReader::new(png)).read_info().unwrap().info().size()
    };
    assert_eq!((size("a"), size("c")), ((64, 32), (32, 16)));
}

#[test]
fn manifest_has_exposure_per_view_and_explain_per_frame() {
    let folder = tempfile::tempdir().unwrap();
    let own = "[exposure]\nlimiting_magnitude = 5.0\n[[views]]\nname = 'manual'\ntype = 'equirectangular'\nsize = [64, 32]\n\
               exposure = { mode = 'manual', ev100 = -7.5 }\n[[views]]\nname = 'plain'\ntype = 'equirectangular'\nsize = [64, 32]\n\
               [[views]]\nname = 'clear'\ntype = 'equirectangular'\nsize = [64, 32]\n[views.glare]\nmethod = 'none'\n";
    std::fs::write(folder.path().join("own.toml"), own).unwrap();
    let (out, _) = run(folder.path(), &["render", "--config", "own.toml", "--out", "a", "--explain"], 0);
    assert_eq!(out.matches("exposure    EV100 ").count(), 3, "{out}");
    let manifest = std::fs::read(folder.path().join("a/manifest.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_slice(&manifest).unwrap();
    let views = manifest["views"].as_array().unwrap();
    assert_eq!(
        views.iter().map(|view| view["name"].as_str().unwrap()).collect::<Vec<_>>(),
        ["manual", "plain", "clear"]
    );
    let ev100 = |value: &serde_json::Value| value["exposure_ev100"].as_f64().unwrap();
    assert_eq!(ev100(&views[0]), -7.5);
    // The other two views share the general exposure. The manifest contains it as the exposure of the first of them.
    assert_eq!([ev100(&views[1]), ev100(&views[2])], [ev100(&manifest); 2]);
    assert!((views[1]["limiting_magnitude"].as_f64().unwrap() - 5.0).abs() < 1e-3, "{manifest}");
    assert_eq!(views[2]["plan"]["glare"].as_str().unwrap(), "none");
    let read = |name: &str| std::fs::read(folder.path().join("a").join(name)).unwrap();
    assert!(read("plain.png") != read("clear.png") && read("manual.png") != read("plain.png"));
    // A view that is drawn alone with the same settings has the same files.
    let alone = "[[views]]\nname = 'manual'\ntype = 'equirectangular'\nsize = [64, 32]\n[exposure]\nmode = 'manual'\nev100 = -7.5\n";
    std::fs::write(folder.path().join("alone.toml"), alone).unwrap();
    run(folder.path(), &["render", "--config", "alone.toml", "--out", "b"], 0);
    for name in ["manual.png", "manual.exr"] {
        assert_eq!(read(name), std::fs::read(folder.path().join("b").join(name)).unwrap(), "{name}");
    }
    let metered = ["--set", "exposure.metering=spot", "--set", "exposure.spot_deg=60"];
    let (out, err) = run(folder.path(), &[&["render", "--config", "own.toml", "--out", "c"][..], &metered].concat(), 0);
    assert!(out.contains("manifest.json") && err.contains("exposure.limiting_magnitude is left out"), "{err}");
}

#[test]
fn render_exits_64_for_configuration_65_for_catalogues_69_for_adapters() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, content: &str| std::fs::write(folder.path().join(name), content).unwrap();
    file("sky.toml", SCENE);
    file("empty.toml", "");
    file("lost.toml", &SCENE.replace("'builtin:bright'", "'lost.csv'"));
    for (arguments, code, parts) in [
        (&["--config", "missing.toml"][..], 64, &["missing.toml"][..]),
        (&["--config", "empty.toml"], 64, &["empty.toml", "[[views]]"]),
        (&["--config", "sky.toml", "--set", "views.all.siz=3"], 64, &["sky.toml", "views[0].siz", "--set"]),
        (&["--config", "sky.toml", "--set", "views.all.size=[2000000, 2]"], 64, &["sky.toml", "view `all`", "2000000"]),
        (&["--config", "lost.toml"], 65, &["lost.toml", "lost.csv"]),
        (&["--config", "sky.toml", "--adapter", "no such adapter"], 69, &["no such adapter"]),
    ] {
        let (out, err) = run(folder.path(), &[&["render", "--out", "out"], arguments].concat(), code);
        assert!(out.is_empty(), "{out}");
        for part in parts {
            assert!(err.contains(part), "`{part}` is not in: {err}");
        }
        assert_eq!(err.matches("error:").count(), 1, "{err}");
    }
    assert!(!folder.path().join("out").exists());
    file("out", "a file at the path of the folder");
    // A folder that cannot be written is detected before any star is loaded.
    let no_folder = ["/proc/none"].into_iter().filter(|_| cfg!(target_os = "linux"));
    for out in ["out", "out/inner"].into_iter().chain(no_folder) {
        let (_, err) = run(folder.path(), &["render", "--out", out, "--config", "lost.toml"], 1);
        assert!(err.contains(&format!("cannot write {out}")), "{err}");
        assert_eq!(err.contains("is a file, and a folder is needed"), out.starts_with("out"), "{err}");
    }
}

#[test]
fn info_prints_the_adapter_as_text_and_json() {
    let folder = tempfile::tempdir().unwrap();
    let (out, _) = run(folder.path(), &["info"], 0);
    assert!(out.contains("adapter") && out.contains("fallbacks"), "{out}");
    let (out, _) = run(folder.path(), &["info", "--json"], 0);
    let report: serde_json::Value = serde_json::from_str(&out).unwrap();
    for key in ["adapter", "driver", "features", "limits", "fallbacks"] {
        assert!(!report[key].is_null(), "{key} is not in {out}");
    }
    let (out, err) = run(folder.path(), &["info", "--json", "--adapter", "no such adapter"], 69);
    assert!(out.is_empty() && err.contains("no such adapter"), "{err}");
}

/// Copies a folder with all files and subfolders.
fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy_folder(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

#[test]
fn shaders_are_read_from_a_folder_in_development() {
    let folder = tempfile::tempdir().unwrap();
    let shaders = folder.path().join("shaders");
    copy_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders"), &shaders);
    std::fs::write(
        folder.path().join("sky.toml"),
        "[[views]]\nname = 'sky'\ntype = 'equirectangular'\nsize = [16, 8]\n\
         [exposure]\nmode = 'manual'\nev100 = 0\n",
    )
    .unwrap();
    let run = |arguments: &[&str]| {
        let output = command(folder.path(), arguments).env("STERADIAN_SHADERS", "shaders").output().unwrap();
        (output.status.code(), text(&output.stdout), text(&output.stderr))
    };
    let render = ["render", "--config", "sky.toml", "--out", "out"];

    // The program reads copies of its built-in files, and reports this.
    let (code, out, err) = run(&["info"]);
    assert_eq!(code, Some(0), "{err}");
    assert!(out.contains("\nshaders    shaders (STERADIAN_SHADERS)\n"), "{out}");
    assert!(err.contains("shaders are read from shaders (STERADIAN_SHADERS)"), "{err}");
    let (_, out, _) = run(&["info", "--json"]);
    assert_eq!(serde_json::from_str::<serde_json::Value>(&out).unwrap()["shaders"], "shaders");
    let (code, _, err) = run(&render);
    assert_eq!(code, Some(0), "{err}");

    // An edit takes effect, and an error in it is reported.
    let resolve = shaders.join("display/resolve.wgsl");
    let valid = std::fs::read_to_string(&resolve).unwrap();
    std::fs::write(&resolve, format!("{valid}\nfn edited() -> u32 {{ return unknown_name; }}\n")).unwrap();
    let (code, _, err) = run(&render);
    assert_eq!(code, Some(1), "{err}");
    assert!(err.contains("unknown_name"), "{err}");

    // Errors that can be detected without an adapter stop the program at its start.
    for (edited, problem) in [
        (Some(format!("#import shared/none\n{valid}")), "shaders/display/resolve.wgsl:1: `shared/none` is neither"),
        (None, "shaders/display/resolve.wgsl is missing"),
    ] {
        match edited {
            Some(text) => std::fs::write(&resolve, text).unwrap(),
            None => std::fs::remove_file(&resolve).unwrap(),
        }
        let (code, out, err) = run(&["info"]);
        assert_eq!(code, Some(64), "{err}");
        assert!(out.is_empty() && err.contains("error: STERADIAN_SHADERS: ") && err.contains(problem), "{err}");
    }
}

#[test]
fn published_method_with_moving_camera_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("sky.toml"), SCENE).unwrap();
    let render = |method: &str, code: i32| {
        let moving = ["--set", "scene.camera.velocity_c=[0.5, 0.0, 0.0]", "--set", method];
        run(folder.path(), &[&["render", "--config", "sky.toml", "--out", "out"], &moving[..]].concat(), code).1
    };
    let err = render("stars.method=packed_cas", 64);
    assert!(err.contains("sky.toml") && err.contains("`packed_cas`") && err.contains("velocity_c"), "{err}");
    assert!(!folder.path().join("out").exists());
    render("stars.method=tent", 0);
}

#[test]
fn unusable_point_spread_function_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, content: &str| std::fs::write(folder.path().join(name), content).unwrap();
    file("broken.exr", "not a picture");
    file("scene.toml", "[[views]]\nname = 'flat'\ntype = 'perspective'\nfov_y_deg = 40\nsize = [64, 64]\n");
    let render = |set: &str, code: i32| {
        let arguments =
            ["render", "--config", "scene.toml", "--out", "out", "--set", "stars.method=psf_texture", "--set", set];
        run(folder.path(), &arguments, code)
    };
    let (_, err) = render("stars.psf_texture.file=missing.exr", 65);
    assert!(err.contains("psf_texture") && err.contains("missing.exr"), "{err}");
    let (_, err) = render("stars.psf_texture.file=broken.exr", 65);
    assert!(err.contains("broken.exr") && err.contains("OpenEXR"), "{err}");
    let (_, err) = render("stars.psf_texture.aperture=square", 64);
    assert!(err.contains("aperture") && err.contains("hexagon"), "{err}");
    assert!(!folder.path().join("out").exists());
    // A generated point-spread function can be drawn.
    let make = ["psf", "--aperture", "circle", "--diameter-mm", "1", "--size", "32", "--out", "star.exr"];
    run(folder.path(), &make, 0);
    render("stars.psf_texture.file=star.exr", 0);
    assert!(folder.path().join("out/flat.png").exists());
}

#[test]
fn audit_reports_its_comparison_and_changes_no_picture() {
    let folder = tempfile::tempdir().unwrap();
    // Use pixels of at most a degree, as audits require.
    let finer = SCENE.replace("size = [64, 32]", "size = [384, 192]").replace("face_size = 16", "face_size = 96");
    std::fs::write(folder.path().join("sky.toml"), finer.replace("size = [16, 16]", "size = [96, 96]")).unwrap();
    let audited = ["render", "--config", "sky.toml", "--out", "a", "--explain", "--set", "accuracy.audit=true"];
    let (out, _) = run(folder.path(), &audited, 0);
    assert!(out.contains("  audit     cube.up (display): ") && out.contains("within the budget"), "{out}");
    let coarse = [
        "render",
        "--config",
        "sky.toml",
        "--out",
        "e",
        "--explain",
        "--set",
        "accuracy.audit=true",
        "--set",
        "views.all.size=[64,32]",
    ];
    // Although the other views are audited, the coarse one is reported as not audited.
    let output = steradian(folder.path(), &coarse);
    assert!(text(&output.stdout).contains("not audited: view all: pixels of 5.6 degrees"), "{}", text(&output.stdout));
    let manifest = std::fs::read(folder.path().join("a/manifest.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_slice(&manifest).unwrap();
    let plan = &manifest["views"][0]["plan"];
    let images = plan["audit"]["images"].as_array().unwrap();
    assert!(images.iter().all(|image| image["within_budget"].as_bool().unwrap() && image["worst"]["x"].is_u64()));
    run(folder.path(), &["render", "--config", "sky.toml", "--out", "b"], 0);
    for name in ["all.png", "all.exr", "eyes.left.png"] {
        let read = |out: &str| std::fs::read(folder.path().join(out).join(name)).unwrap();
        assert_eq!(read("a"), read("b"), "{name}");
    }
    // A published method has no budget, so the output mentions none.
    let published = [
        "render",
        "--config",
        "sky.toml",
        "--out",
        "c",
        "--explain",
        "--set",
        "accuracy.audit=true",
        "--set",
        "stars.method=disc",
    ];
    let (out, _) = run(folder.path(), &published, 0);
    assert!(out.contains("not audited: the star method disc") && !out.contains("within the budget;"), "{out}");
    run(folder.path(), &["render", "--config", "sky.toml", "--out", "d", "--set", "accuracy.frame_ms=0"], 64);
}

/// The manifest records all inputs of a picture, so it is sufficient to make the picture again. If a file has changed,
/// it is refused, and the message names it.
#[test]
fn manifest_is_deterministic_and_reproduces_the_frame() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    std::fs::create_dir(place("skies")).unwrap();
    std::fs::write(place("skies/stars.csv"), CSV).unwrap();
    std::fs::write(place("skies/eye.csv"), "theta_deg,per_sr\n0.1,3\n90,1e-3\n").unwrap();
    let scene = format!(
        "[scene]\ncatalogues = ['stars.csv', 'builtin:bright']\ntime = 2026-03-01T00:00:00Z\n[glare]\npsf_file = 'eye.csv'\n\
         method = 'sky_cube'\nkernel = 'psf'\n[server]\nlisten = '127.0.0.1:1'\n{}",
        SCENE.split_once("[[views]]").map(|(_, views)| format!("[[views]]{views}")).unwrap()
    );
    std::fs::write(place("skies/sky.toml"), scene).unwrap();
    let (from_configuration, from) =
        (["--config", "skies/sky.toml", "--set", "views.all.size=[32, 16]"], ["--from", "a/manifest.json"]);
    let render = |out: &str, arguments: &[&str], code: i32| {
        run(folder.path(), &[&["render", "--out", out], arguments].concat(), code)
    };
    for out in ["a", "b"] {
        render(out, &from_configuration, 0);
    }
    render("again", &from, 0);
    // The manifest works from any folder, and after the files were moved.
    std::fs::rename(place("skies"), place("moved")).unwrap();
    let (_, err) = render("elsewhere", &from, 65);
    assert!(err.contains("eye.csv"), "{err}");
    render("moved-again", &[&from[..], &["--folder", "moved"]].concat(), 0);
    let written = std::fs::read_dir(place("a")).unwrap().map(|entry| entry.unwrap().file_name());
    let written: Vec<String> = written.map(|name| name.into_string().unwrap()).collect();
    assert_eq!(written.len(), 12, "{written:?}");
    for out in ["b", "again", "moved-again"] {
        for name in written.iter().filter(|name| *name != "timings.json") {
            let read = |out: &str| std::fs::read(place(out).join(name)).unwrap();
            assert!(read("a") == read(out), "{out}/{name}");
        }
    }
    let manifest: serde_json::Value =
        serde_json::from_slice(&std::fs::read(place("a/manifest.json")).unwrap()).unwrap();
    assert_eq!(manifest["catalogues"][0]["rejected_rows"], 1);
    assert_eq!(manifest["catalogues"][0]["first_rejected"][0]["line"], 3);
    assert_eq!(manifest["catalogues"][1]["name"], "builtin:bright");
    assert_eq!(
        manifest["files"].as_array().unwrap().iter().map(|file| &file["file"]).collect::<Vec<_>>(),
        ["eye.csv", "stars.csv"]
    );
    assert_eq!(manifest["time_s_since_j2000"], 825_595_200.0);
    let toml = manifest["configuration"]["toml"].as_str().unwrap();
    assert!(toml.contains("size = [32, 16]") && !toml.contains("listen"), "{toml}");
    assert!(!manifest["driver"].as_str().unwrap().is_empty());

    std::fs::write(place("moved/stars.csv"), CSV.replace("3.0", "3.1")).unwrap();
    let (_, err) = render("changed", &[&from[..], &["--folder", "moved"]].concat(), 65);
    assert!(err.contains("stars.csv") && err.contains("SHA-256") && err.contains("manifest.json"), "{err}");
    assert!(!place("changed").exists(), "no file is written");
    std::fs::write(place("a/manifest.json"), "{ \"version\": 3 }").unwrap();
    let (_, err) = render("broken", &from, 65);
    assert!(err.contains("a/manifest.json"), "{err}");
    for arguments in [
        &[][..],
        &[&from[..], &from_configuration[..2]].concat()[..],
        &["--config", "skies/sky.toml", "--folder", "moved"],
    ] {
        render("none", arguments, 64);
    }
}

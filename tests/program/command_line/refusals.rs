//! Options, names and keys that are refused before anything is drawn.

use super::*;

#[test]
fn values_below_0_are_refused_by_their_option() {
    let folder = tempfile::tempdir().unwrap();
    let film = ["film", "--config", "a.toml", "--path", "p.toml", "--out", "out"];
    let import = ["projectors", "import", "a.mpcdi", "--out", "o.toml"];
    let psf = ["psf", "--aperture", "circle", "--out", "o.exr"];
    for (command, option, part) in [
        (&film[..], &["--frames", "-1..2"][..], "`-1..2` is not a range of frames"),
        (&film, &["--frames", "0..2", "--shard", "-1/2"], "--shard"),
        (&["film", "status", "film"], &["--frames", "-1..2"], "`-1..2` is not a range of frames"),
        (&import, &["--axes", "-x,y,z"], "--axes"),
        (&import, &["--size", "-1x2"], "width x height"),
        (&psf, &["--diameter-mm", "2", "--size", "-4"], "--size"),
        (&["show"], &["--frames", "-1"], "--frames"),
    ] {
        let (_, err) = run(folder.path(), &[command, option].concat(), 64);
        assert!(err.contains(part) && !err.contains("unexpected argument"), "{option:?}: {err}");
    }
    // The files of these commands are missing, which is detected after the options are read.
    for (command, option) in [
        (&import[..], ["--fov-deg", "-10"]),
        (&["dome", "check", "--config", "a.toml"], ["--reflectivity", "-0.1"]),
        (&["catalogue", "export", "a.stars", "--out", "a.csv"], ["--distances-pc", "-5..5"]),
    ] {
        let output = steradian(folder.path(), &[command, &option].concat());
        let err = text(&output.stderr);
        assert!(!output.status.success() && !err.contains("unexpected argument"), "{option:?}: {err}");
    }
}

#[test]
fn names_that_files_cannot_have_and_keys_without_effect_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, content: &str| std::fs::write(folder.path().join(name), content).unwrap();
    file("long.toml", &SCENE.replace("'all'", &format!("'{}'", "a".repeat(65))));
    file("twins.toml", &SCENE.replace("'cube'", "'ALL'").replace("'eyes'", "'con'"));
    std::fs::write(folder.path().join("latin-1.toml"), b"[scene]\ncatalogues = ['\xe4.csv']\n").unwrap();
    file("sky.toml", SCENE);
    for (arguments, parts) in [
        (&["--config", "long.toml"][..], &["views[0].name", "65 characters: must have at most 64"][..]),
        (&["--config", "latin-1.toml"], &["latin-1.toml", "line 2 is not UTF-8: save the file as UTF-8"]),
        (
            &["--config", "sky.toml", "--set", "tone_map.peak_cd_m2=12"],
            &["tone_map.peak_cd_m2: has no effect", "--set"],
        ),
        (&["--config", "sky.toml", "--set", "views.all.blend=false"], &["views[0].blend", "unknown key"]),
    ] {
        let (_, err) = run(folder.path(), &[&["render", "--out", "out"], arguments].concat(), 64);
        assert!(parts.iter().all(|part| err.contains(part)), "{err}");
    }
    let (_, err) = run(folder.path(), &["render", "--out", "out", "--files", "png", "--config", "twins.toml"], 0);
    for part in ["views[1].name (view `ALL`): differs from views[0]", "views[2].name (view `con`): Windows reserves"] {
        assert!(err.contains(part), "{err}");
    }
}

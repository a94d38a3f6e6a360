//! Commands for deep stores.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use testkit::exr_file::channels;

use super::{command, run};

/// Returns the root checksum in the output of a command.
fn root(out: &str) -> String {
    let line =
        out.lines().find(|line| line.starts_with("root checksum")).unwrap_or_else(|| panic!("no checksum: {out}"));
    line.split_whitespace().last().unwrap().to_owned()
}

fn synth(out: &str) -> [&str; 12] {
    [
        "catalogue",
        "synth",
        "--stars",
        "150000",
        "--seed",
        "3",
        "--fainter-than",
        "13.4",
        "--memory",
        "128MiB",
        "--out",
        out,
    ]
}

#[test]
fn a_deep_store_is_made_checked_divided_and_exported() {
    let folder = tempfile::tempdir().unwrap();
    let (made, err) = run(folder.path(), &synth("galaxy"), 0);
    assert!(made.contains("wrote galaxy: 150000 stars"), "{made}");
    assert!(err.contains("drawing stars"), "plain progress lines: {err}");
    let (info, _) = run(folder.path(), &["catalogue", "info", "galaxy"], 0);
    assert!(info.contains("stars             150000") && info.contains("plane-13-7"), "{info}");
    let (checked, _) = run(folder.path(), &["catalogue", "check", "galaxy", "--light"], 0);
    assert!(checked.contains("all checksums are right") && checked.contains("every composite star"), "{checked}");
    assert_eq!((root(&info), root(&checked)), (root(&made), root(&made)));

    // Export a part of the stars as a store and as a table, and read the table again.
    let part = ["--cone", "266,-29,30", "--magnitudes", "..13.8"];
    run(folder.path(), &[&["catalogue", "slice", "galaxy", "--out", "part"][..], &part].concat(), 0);
    let (exported, _) =
        run(folder.path(), &[&["catalogue", "export", "galaxy", "--out", "part.csv"][..], &part].concat(), 0);
    let rows = fs::read_to_string(folder.path().join("part.csv")).unwrap().lines().count() - 1;
    assert!(rows > 1000 && exported.contains(&format!("{rows} stars")), "{rows}: {exported}");
    let (info, _) = run(folder.path(), &["catalogue", "info", "part"], 0);
    assert!(info.contains(&format!("stars             {rows}\n")) && info.contains("part: within 30"), "{info}");
    run(folder.path(), &[&["catalogue", "export", "part", "--out", "part.parquet"][..]].concat(), 0);
    for (file, store) in [("part.csv", "again"), ("part.parquet", "from-parquet")] {
        let (out, _) = run(folder.path(), &["catalogue", "import", file, "--memory", "128MiB", "--out", store], 0);
        assert!(out.contains(&format!("wrote {store}: {rows} stars")), "{out}");
    }
    run(folder.path(), &["catalogue", "export", "galaxy", "--out", "table.txt"], 64);

    // A scene shows the same light from the store and from the table.
    let light = |catalogue: &str| -> f64 {
        let configuration = format!(
            "[scene]\ncatalogues = ['{catalogue}']\n[glare]\nmethod = 'none'\n\
             [[views]]\nname = 'v'\ntype = 'equirectangular'\nsize = [64, 32]\n"
        );
        fs::write(folder.path().join("c.toml"), configuration).unwrap();
        run(folder.path(), &["render", "--config", "c.toml", "--files", "exr", "--out", "out"], 0);
        let [green, omega_sr] = channels(&fs::read(folder.path().join("out/v.exr")).unwrap(), ["G", "omega"]);
        green.iter().zip(omega_sr).map(|(green, sr)| f64::from(*green) * f64::from(sr)).sum()
    };
    let [stored, listed] = ["part", "part.csv"].map(light);
    assert!(stored > 0.0 && (stored / listed - 1.0).abs() < 1e-4, "{stored} {listed}");
    let manifest = fs::read_to_string(folder.path().join("out/manifest.json")).unwrap();
    assert!(manifest.contains(&format!("\"stars\": {rows}")), "{manifest}");

    // Damage.
    let path = folder.path().join("galaxy/leaves-13");
    let mut bytes = fs::read(&path).unwrap();
    bytes[5000] ^= 1;
    fs::write(&path, bytes).unwrap();
    let (_, err) = run(folder.path(), &["catalogue", "check", "galaxy"], 65);
    // With `every_star` the leaves are read, so the damage is detected.
    let configuration = fs::read_to_string(folder.path().join("c.toml")).unwrap().replace("part.csv", "galaxy");
    let configuration = format!("{configuration}[stars]\nevery_star = true\n");
    fs::write(folder.path().join("c.toml"), configuration).unwrap();
    let (_, refused) = run(folder.path(), &["render", "--config", "c.toml", "--out", "damaged"], 65);
    assert!(refused.contains("leaves-13") && !folder.path().join("damaged/manifest.json").exists(), "{refused}");
    assert!(err.contains("leaves-13") && err.contains("leaf ") && err.contains("of order 6"), "{err}");
}

#[test]
fn an_import_counts_its_rules_and_does_not_overwrite_other_folders() {
    let folder = tempfile::tempdir().unwrap();
    // The rows are: Sirius, 1" from its position in the built-in table; a star with a good parallax and one with a bad
    // parallax; a star without parallax; a star without colour; a star that is repeated.
    let gaia = "source_id,ra,dec,phot_g_mean_mag,bp_rp,parallax,parallax_error,pmra,pmdec\n\
        1,101.28716,-16.71640,-1.3,0.0,379,0.5,0,0\n2,10,20,15.0,0.8,2.0,0.1,1,1\n3,10.1,20,16.0,0.8,0.3,0.2,0,0\n\
        4,10.2,20,17.0,0.8,,,0,0\n5,10,20.0001,15.5,,2.0,0.1,0,0\n5,10,20.0001,15.5,,2.0,0.1,0,0\n";
    fs::write(folder.path().join("gaia.csv"), gaia).unwrap();
    let import = ["catalogue", "import", "builtin:bright", "gaia.csv", "--out", "sky/"];
    let (out, _) = run(folder.path(), &import, 0);
    for part in [
        "builtin:bright: 9096 stars",
        "gaia.csv: 6 stars, read as Gaia archive",
        "distance by the prior: 2",
        "median temperature of their cell: 1",
        "duplicates of other stars: 1",
        "within 2 arcsec and 1 mag of a star of builtin:bright: 1",
        "9100 stars",
    ] {
        assert!(out.contains(part), "`{part}` is not in: {out}");
    }
    let (again, _) = run(folder.path(), &import, 0);
    assert_eq!(root(&again), root(&out));
    fs::create_dir(folder.path().join("mine")).unwrap();
    let (_, err) = run(folder.path(), &["catalogue", "import", "gaia.csv", "--out", "mine/"], 64);
    assert!(err.contains("not a deep store"), "{err}");
    let (_, err) = run(folder.path(), &["catalogue", "info", "mine"], 65);
    assert!(err.contains("not a deep star store"), "{err}");
    assert!(!folder.path().join("sky.partial").exists() && !folder.path().join("mine.partial").exists());
}

#[test]
fn parts_are_shown_refused_by_scenes_and_merged() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.csv"), "ra_deg,dec_deg,v_mag\n10,20,14\n200,-70,15\n266,-29,3\n").unwrap();
    let import = |more: &[&str]| run(folder.path(), &[&["catalogue", "import", "s.csv"][..], more].concat(), 0).0;
    let whole = import(&["--memory", "64MiB", "--out", "whole"]);
    let first = import(&["--cells", "0..1000", "--out", "a"]);
    assert!(first.contains("wrote a: cells 0..1000 of 0..3072, "), "{first}");
    import(&["--cells", "1000..3072", "--out", "b"]);
    let (info, _) = run(folder.path(), &["catalogue", "info", "a"], 0);
    let shown = info.contains("cells             0..1000 of 0..3072") && info.contains("input             s.csv (");
    assert!(shown, "{info}");
    run(folder.path(), &["catalogue", "check", "a", "--light"], 0);
    let configuration =
        "[scene]\ncatalogues = ['b']\n[[views]]\nname = 'v'\ntype = 'equirectangular'\nsize = [64, 32]\n";
    fs::write(folder.path().join("c.toml"), configuration).unwrap();
    for arguments in [
        &["render", "--config", "c.toml", "--out", "out"][..],
        &["catalogue", "slice", "b", "--out", "slice"],
        &["catalogue", "export", "b", "--out", "b.csv"],
        &["catalogue", "import", "b", "--out", "again"],
    ] {
        let (_, err) = run(folder.path(), arguments, 64);
        assert!(err.contains("b: has only the cells 1000..3072") && err.contains("catalogue merge"), "{err}");
    }
    let (_, err) = run(folder.path(), &["catalogue", "merge", "b", "--out", "merged"], 64);
    assert!(err.contains("the cells 0..1000 of 0..3072 are in none of the parts"), "{err}");
    let (_, err) = run(folder.path(), &["catalogue", "merge", "whole", "--out", "merged"], 65);
    assert!(err.contains("whole: it is a whole store"), "{err}");
    let (merged, _) = run(folder.path(), &["catalogue", "merge", "b", "a", "--out", "merged"], 0);
    assert_eq!(merged, whole.replace("wrote whole", "wrote merged"));
    let (_, err) = run(
        folder.path(),
        &["catalogue", "synth", "--stars", "9", "--seed", "1", "--out", "x", "--cells", "5..3073"],
        64,
    );
    assert!(err.contains("0 <= A < B <= 3072"), "{err}");
}

/// Ends the program with SIGKILL after `delay`, unless it has ended.
fn killed(folder: &Path, arguments: &[&str], delay: Duration) {
    let mut child = command(folder, arguments)
        .stderr(std::process::Stdio::null())
        .stdout(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let started = Instant::now();
    while started.elapsed() < delay && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(5));
    }
    let _ = child.kill();
    child.wait().unwrap();
}

#[test]
fn a_killed_command_continues_and_gives_the_same_store() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, _) = run(folder.path(), &synth("whole"), 0);
    let started = Instant::now();
    run(folder.path(), &synth("timed"), 0);
    let total = started.elapsed();
    for part in [30, 60, 80, 90] {
        killed(folder.path(), &synth("galaxy"), total * part / 100);
    }
    let (continued, _) = run(folder.path(), &synth("galaxy"), 0);
    assert_eq!(root(&continued), root(&whole));
    let (checked, _) = run(folder.path(), &["catalogue", "check", "galaxy"], 0);
    assert_eq!(root(&checked), root(&whole));
    assert!(!folder.path().join("galaxy.partial").exists());
}

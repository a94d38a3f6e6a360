//! Tests how files are joined, and the errors for invalid files and choices.

use super::*;

fn join(files: &[(&str, &str)], choices: &[(&str, &str)]) -> Result<Joined, ShaderError> {
    Library::new(files.iter().copied()).join("main", &chosen(choices))
}

fn chosen(choices: &[(&str, &str)]) -> Choices {
    choices.iter().map(|(slot, stem)| ((*slot).to_owned(), (*stem).to_owned())).collect()
}

fn error(files: &[(&str, &str)], choices: &[(&str, &str)]) -> String {
    join(files, choices).unwrap_err().to_string()
}

#[test]
fn every_file_is_included_once_after_its_imports() {
    let files = [
        ("main", "#import b\n#import a\nmain"),
        ("a", "// head\n\n#import c\na"),
        ("b", "#import c\n#import c\n#import a\nb"),
        ("c", "c"),
        ("d", "not imported"),
    ];
    let joined = join(&files, &[]).unwrap();
    let text =
        "// shaders/c.wgsl\nc\n// shaders/a.wgsl\n// head\n\na\n// shaders/b.wgsl\nb\n// shaders/main.wgsl\nmain\n";
    assert_eq!(joined, Joined { text: text.to_owned(), needs_u64: false });
}

#[test]
fn unknown_files_name_file_and_line() {
    let files = [("main", "#import a"), ("a", "// head\n#import wrong/file")];
    assert_eq!(
        error(&files, &[]),
        "shaders/a.wgsl:2: `wrong/file` is neither a file below shaders/ nor a table of constants nor a shared structure"
    );
    assert_eq!(
        Library::new(files).join("other", &Choices::new()).unwrap_err().to_string(),
        "shaders/other.wgsl does not exist"
    );
    assert!(error(&[("main", "#import x = none_*")], &[("x", "a")]).contains("main.wgsl:1: `none_*`"));
}

#[test]
fn cycles_are_named() {
    let files = [("main", "#import a"), ("a", "#import b"), ("b", "\n#import a")];
    assert_eq!(error(&files, &[]), "shaders/b.wgsl:2: circular import: a -> b -> a");
    assert_eq!(error(&[("main", "#import main")], &[]), "shaders/main.wgsl:1: circular import: main -> main");
}

#[test]
fn one_alternative_is_chosen() {
    let files = [("main", "#import sum = u32 | u64\nmain"), ("u32", "narrow"), ("u64", "#requires u64\nwide")];
    let wide = join(&files, &[("sum", "u64")]).unwrap();
    assert!(wide.needs_u64 && wide.text.contains("wide") && !wide.text.contains("narrow"));
    assert!(!join(&files, &[("sum", "u32")]).unwrap().needs_u64);
    assert_eq!(error(&files, &[]), "shaders/main.wgsl:1: no file is chosen for `sum`; it must be one of u32, u64");
    assert_eq!(
        error(&files, &[("sum", "main")]),
        "shaders/main.wgsl:1: `main` cannot be chosen for `sum`; it must be one of u32, u64"
    );
    assert_eq!(
        error(&files, &[("sum", "u64"), ("total", "u32")]),
        "shaders/main.wgsl: neither this file nor its imports have alternatives named `total`"
    );
    let twice = [("main", "#import sum = u32\n#import sum = u64"), ("u32", ""), ("u64", "")];
    assert_eq!(
        error(&twice, &[("sum", "u32")]),
        "shaders/main.wgsl:2: the alternatives of `sum` differ from those at shaders/main.wgsl:1"
    );
}

#[test]
fn all_combinations_are_found() {
    let files = [
        ("main", "#import of = kind_*\n@compute fn main() {}"),
        ("kind_a", ""),
        ("kind_b", "#import sum = u32 | u64"),
        ("u32", ""),
        ("u64", ""),
    ];
    let library = Library::new(files);
    let wanted: &[&[(&str, &str)]] =
        &[&[("of", "kind_a")], &[("of", "kind_b"), ("sum", "u32")], &[("of", "kind_b"), ("sum", "u64")]];
    let wanted: Vec<Choices> = wanted.iter().map(|choices| chosen(choices)).collect();
    assert_eq!(library.combinations("main").unwrap(), wanted);
    assert_eq!(library.entry_files().collect::<Vec<_>>(), ["main"]);
    assert!(Library::new([("main", "#import none")]).combinations("main").is_err());
}

#[test]
fn invalid_directives_are_errors() {
    for line in [
        "#import",
        "#import a b",
        "#import a = b |",
        "#import a = b c d",
        "#import x = | | |",
        "#requires f16",
        "#include a",
    ] {
        let found = error(&[("main", &format!("\n{line}")), ("a", ""), ("b", ""), ("d", "")], &[("a", "b")]);
        assert!(found.starts_with(&format!("shaders/main.wgsl:2: `{line}` is not a valid directive")), "{found}");
    }
}

#[test]
fn lines_after_when_are_included_only_with_the_file() {
    let main = "#import extra = off | on\nbefore\n#when on\n    with it\n#end\nafter";
    let files = [("main", main), ("off", ""), ("on", "on itself")];
    let text = |choice| join(&files, &[("extra", choice)]).unwrap().text;
    assert_eq!(text("off"), "// shaders/off.wgsl\n// shaders/main.wgsl\nbefore\nafter\n");
    assert_eq!(text("on"), "// shaders/on.wgsl\non itself\n// shaders/main.wgsl\nbefore\n    with it\nafter\n");
    // A file that is included only later does not count.
    let late = [("main", "#import a\n#import b"), ("a", "#when b\nlost\n#end"), ("b", "")];
    assert!(!join(&late, &[]).unwrap().text.contains("lost"));
    for (main, found) in [
        ("#when none\n#end", "shaders/main.wgsl:1: `none` is neither"),
        ("x\n#when a", "shaders/main.wgsl:2: this `#when` has no `#end`"),
        ("#end", "shaders/main.wgsl:1: `#end` is not a valid directive here"),
        ("#when a\n#when a\n#end\n#end", "shaders/main.wgsl:2: `#when a` is not a valid directive here"),
        ("#when a\n#import a\n#end", "shaders/main.wgsl:2: `#import a` is not a valid directive here"),
    ] {
        let error = error(&[("main", main), ("a", "")], &[]);
        assert!(error.starts_with(found), "{error}");
    }
}

#[test]
fn files_with_an_entry_point_have_one_and_cannot_be_imported() {
    let two = "@vertex\nfn first() {}\n// @fragment fn not() {}\nfn plain() {}\n@fragment fn second(a: u32) {}";
    let library =
        Library::new([("main", "#import other"), ("other", two), ("one", "@compute @workgroup_size(1)\nfn go() {}")]);
    assert_eq!(library.entry("one").unwrap(), ("one", "go"));
    assert_eq!(
        library.entry("other").unwrap_err().to_string(),
        "shaders/other.wgsl must have one entry point; found: first, second"
    );
    assert_eq!(
        library.entry("main").unwrap_err().to_string(),
        "shaders/main.wgsl must have one entry point; found: none"
    );
    assert_eq!(
        library.join("main", &Choices::new()).unwrap_err().to_string(),
        "shaders/main.wgsl:1: `other` has an entry point and cannot be imported"
    );
}

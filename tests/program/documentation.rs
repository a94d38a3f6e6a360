//! Tests the documentation. The commands in README.md and in every page of `docs/` work as written, every example runs, every link leads to an
//! existing file and heading, and all paths exist that are named in a page or in a comment of `src/`, `crates/` or `shaders/`. Measured figures: see
//! `measured`.
//!
//! Commands are the lines of the fenced blocks marked `sh`. The commands of a page run one after the other by `sh`, in
//! a folder with the repository's configurations and with the built program in PATH:
//!
//! - `cargo run --release --example NAME -- ARGUMENTS` runs the example built by `cargo test`,
//! - `steradian serve` runs in the background on a free port and is stopped by SIGTERM after the last command,
//! - `steradian show` draws three frames, or exits with 69 if there is no display,
//! - `steradian xr` draws one frame, or exits with 69 and the missing part of OpenXR,
//! - Python programs are run by `python/tests/test_documents.py` if Python has their dependencies; here, their files only have to exist and have the
//!   options that commands use,
//! - commands in [`EXCUSED`] are not run; they are checked in another way.

use std::{
    collections::BTreeSet,
    fs,
    io::{BufRead, BufReader},
    net::TcpListener,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    sync::mpsc,
    thread,
    time::{Duration, Instant},
};

/// Address of the daemon in the documentation; commands get a free port instead.
const DOCUMENTED_ADDRESS: &str = "127.0.0.1:7143";
/// Commands that are not run: their beginning, the reason, and the substitute check.
const EXCUSED: &[(&str, &str, Check)] = &[
    ("make ", "runs these tests, or installs packages; the Makefile must have the target", check_make),
    ("grpcurl ", "grpcurl may not be installed; the protocol must have the called method", check_grpcurl),
    ("PYTHONPATH=", "python/tests/test_documents.py runs it; the file must have the options", check_python),
    ("scripts/", "installs packages; the script must exist", check_script),
];

/// Check of a command that is not run.
type Check = fn(&str) -> Result<(), String>;

/// Paths in code spans that are not files of the repository: their beginning, and the reason.
const NO_FILES: &[(&str, &str)] = &[
    ("out/", "written by commands of the documentation"),
    ("target/", "built by Cargo"),
    ("~/", "a folder of the user"),
    ("/", "a path of the system"),
    ("openxr", "files of an OpenXR runtime"),
    ("libopenxr1-", "a Debian package"),
    ("chart.csv", "written by `chart`"),
    ("index.html", "written by `chart`"),
    ("manifest.json", "written by `render`"),
    ("film.json", "written by `film`"),
    ("part.json", "written by `catalogue import --cells`"),
    ("timings.json", "written by `render`"),
    ("http", "an address"),
];

/// Folders that paths start from.
const ROOTS: [&str; 6] = ["", "src", "shaders", "crates/sky/src", "crates/render/src", "crates/testkit/src"];

/// Folders of sources.
const SOURCE_FOLDERS: [&str; 10] =
    ["src", "crates", "shaders", "tests", "benches", "examples", "configs", "scripts", "proto", "python"];

/// Time limit for the start and for the end of a daemon, far above the time that these need.
const PATIENCE: Duration = Duration::from_secs(120);

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &str) -> String {
    fs::read_to_string(repository().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Returns the commands in the blocks marked `sh`, without comments and blank lines and with continued lines joined.
fn commands(document: &str) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    let (mut inside, mut continued) = (false, false);
    for line in document.lines() {
        if let Some(mark) = line.trim_start().strip_prefix("```") {
            inside = !inside && mark.trim() == "sh";
            continue;
        }
        let line = line.trim();
        if !inside || line.is_empty() || line.starts_with('#') {
            continue;
        }
        let (text, goes_on) = line.strip_suffix('\\').map_or((line, false), |text| (text.trim_end(), true));
        match found.last_mut().filter(|_| continued) {
            Some(command) => {
                command.push(' ');
                command.push_str(text);
            }
            None => found.push(text.to_owned()),
        }
        continued = goes_on;
    }
    found
}

/// Returns the name of the example that a command runs, and its arguments after `--`.
fn example_of(command: &str) -> Option<(&str, &str)> {
    let rest = command.strip_prefix("cargo run --release --example ")?;
    Some(rest.split_once(" -- ").unwrap_or((rest, "")))
}

fn has_target(makefile: &str, target: &str) -> bool {
    makefile.lines().any(|line| line.starts_with(&format!("{target}:")))
}

/// Whether the protocol contains a call. Example: `steradian.v1.ViewService/ListViews`.
fn has_call(call: &str) -> bool {
    let Some((service, method)) = call.strip_prefix("steradian.v1.").and_then(|name| name.split_once('/')) else {
        return false;
    };
    let folder = repository().join("proto/steradian/v1");
    fs::read_dir(folder).unwrap().any(|file| {
        let text = fs::read_to_string(file.unwrap().path()).unwrap();
        let declared = text.split_once(&format!("service {service} {{")).map(|(_, rest)| rest);
        let body = declared.and_then(|rest| rest.split_once("\n}")).map(|(body, _)| body);
        body.is_some_and(|body| body.contains(&format!("rpc {method}(")))
    })
}

/// Returns README.md and the pages in `docs/`.
fn documents() -> Vec<String> {
    let pages = fs::read_dir(repository().join("docs")).unwrap().map(|entry| entry.unwrap().file_name());
    let pages = pages.map(|name| format!("docs/{}", name.to_str().unwrap())).filter(|name| name.ends_with(".md"));
    let mut all: Vec<String> = pages.chain(["README.md".to_owned()]).collect();
    all.sort();
    all
}

/// Checks a `make` command by its target.
fn check_make(command: &str) -> Result<(), String> {
    let found = command.strip_prefix("make ").is_some_and(|target| has_target(&read("Makefile"), target));
    if found { Ok(()) } else { Err(format!("`{command}`: the Makefile does not have this target")) }
}

/// Checks the mask of a `grpcurl` command. grpcurl reads a mask as a message, in which paths have the names of the protocol.
fn check_mask(command: &str) -> Result<(), String> {
    let Some((_, rest)) = command.split_once("-d '") else { return Ok(()) };
    let text = rest.split('\'').next().unwrap_or_default();
    let message: serde_json::Value = serde_json::from_str(text).map_err(|error| format!("`{command}`: {error}"))?;
    let Some(mask) = message.get("updateMask").or(message.get("update_mask")) else { return Ok(()) };
    let paths: Vec<&str> =
        mask["paths"].as_array().into_iter().flatten().map(|path| path.as_str().unwrap_or_default()).collect();
    let protocol = fs::read_dir(repository().join("proto/steradian/v1")).unwrap();
    let protocol: String = protocol.map(|file| fs::read_to_string(file.unwrap().path()).unwrap()).collect();
    let is_field = |name: &str| protocol.contains(&format!(" {name} = "));
    if !paths.is_empty() && paths.iter().all(|path| path.split('.').all(is_field)) {
        return Ok(());
    }
    Err(format!("`{command}`: the mask must be {{\"paths\": [...]}} with names of the protocol"))
}

/// Checks a `grpcurl` command by its calls and its mask.
fn check_grpcurl(command: &str) -> Result<(), String> {
    check_mask(command)?;
    let mut calls = command.split_whitespace().filter(|word| word.contains('/') && word.starts_with("steradian"));
    match calls.find(|call| !has_call(call)) {
        Some(call) => Err(format!("`{command}`: the protocol has no {call}")),
        None => Ok(()),
    }
}

/// Checks a Python program by its file and options.
fn check_python(command: &str) -> Result<(), String> {
    let words: Vec<&str> = command.split_whitespace().collect();
    let ["PYTHONPATH=python/src", "python3", script, arguments @ ..] = &words[..] else {
        return Err(format!("`{command}`: should begin with PYTHONPATH=python/src python3"));
    };
    let text = fs::read_to_string(repository().join(script)).map_err(|error| format!("`{command}`: {error}"))?;
    let options = arguments.iter().filter(|argument| argument.starts_with("--"));
    match options.into_iter().find(|option| !text.contains(&format!("(\"{option}\""))) {
        Some(option) => Err(format!("`{command}`: {script} has no {option}")),
        None => Ok(()),
    }
}

/// Checks a script by its file.
fn check_script(command: &str) -> Result<(), String> {
    let script = command.split_whitespace().next().unwrap_or_default();
    if repository().join(script).is_file() { Ok(()) } else { Err(format!("`{command}`: {script} does not exist")) }
}

/// Runs the commands of a document in a temporary folder.
struct Reader {
    folder: tempfile::TempDir,
    daemons: Vec<Child>,
    address: String,
}

impl Reader {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        for examples in ["calibrations", "configs", "paths"] {
            fs::create_dir(folder.path().join(examples)).unwrap();
            for file in fs::read_dir(repository().join(examples)).unwrap() {
                let file = file.unwrap();
                fs::copy(file.path(), folder.path().join(examples).join(file.file_name())).unwrap();
            }
        }
        // A free port. If another process takes it in the meantime, the daemon's error reports that.
        let free = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = free.local_addr().unwrap().to_string();
        Self { folder, daemons: Vec::new(), address }
    }

    /// Returns an `sh` process for a command, with the program in PATH.
    fn shell(&self, command: &str) -> Command {
        let program = Path::new(env!("CARGO_BIN_EXE_steradian"));
        let mut path = program.parent().unwrap().as_os_str().to_owned();
        if let Some(rest) = std::env::var_os("PATH") {
            path.push(":");
            path.push(rest);
        }
        let mut shell = Command::new("sh");
        shell.arg("-c").arg(command).env("PATH", path).current_dir(self.folder.path()).stdin(Stdio::null());
        shell
    }

    fn run(&mut self, command: &str) -> Result<(), String> {
        let command = command.replace(DOCUMENTED_ADDRESS, &self.address);
        if let Some((_, _, check)) = EXCUSED.iter().find(|(beginning, ..)| command.starts_with(beginning)) {
            return check(&command);
        }
        if command.starts_with("steradian serve") {
            // Do not stop the running processes if the command starts a node, because the node joins them.
            if !command.contains("--role node") {
                self.stop()?;
            }
            return self.serve(&command);
        }
        let mut runs = command.clone();
        if let Some((name, arguments)) = example_of(&command) {
            let example = example(name);
            if !example.is_file() {
                return Err(format!(
                    "{}: not built (`cargo test` builds all examples) or not an example",
                    example.display()
                ));
            }
            runs = format!("'{}' {arguments}", example.display());
        }
        if command.starts_with("steradian xr") {
            runs.push_str(" --frames 1");
        }
        if command.starts_with("steradian show") && !command.contains("--monitors") {
            runs.push_str(" --frames 3");
        }
        let output = self.shell(&runs).output().map_err(|error| format!("`{command}`: {error}"))?;
        let said = String::from_utf8_lossy(&output.stderr);
        let needs_a_display = command.starts_with("steradian show") && output.status.code() == Some(69);
        if needs_a_display && said.contains("no display") {
            return Ok(());
        }
        let needs_a_runtime = command.starts_with("steradian xr") && output.status.code() == Some(69);
        if output.status.success() || (needs_a_runtime && said.contains("OpenXR")) {
            return Ok(());
        }
        Err(format!("`{command}`: {}\n{said}", output.status))
    }

    fn serve(&mut self, command: &str) -> Result<(), String> {
        let log = self.folder.path().join("daemon.log");
        let mut shell = self.shell(&format!("exec {command}"));
        shell.stdout(Stdio::piped()).stderr(fs::File::create(&log).map_err(|error| error.to_string())?);
        let mut daemon = shell.spawn().map_err(|error| format!("`{command}`: {error}"))?;
        let output = daemon.stdout.take().expect("standard output must be a pipe");
        self.daemons.push(daemon);
        let (sender, lines) = mpsc::channel();
        thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    return;
                }
            }
        });
        let line = lines.recv_timeout(PATIENCE).map_err(|error| {
            let logged = fs::read_to_string(&log).unwrap_or_default();
            format!("`{command}`: prints nothing: {error}\n{logged}")
        })?;
        // A node listens on any free port.
        let listening = line
            .strip_prefix("listening on ")
            .is_some_and(|address| address == self.address || command.contains("--role node"));
        if listening {
            Ok(())
        } else {
            Err(format!("`{command}`: prints `{line}` and does not listen on {}", self.address))
        }
    }

    /// Stops the running daemons with SIGTERM, as a service manager does.
    fn stop(&mut self) -> Result<(), String> {
        std::mem::take(&mut self.daemons).into_iter().try_for_each(stopped)
    }

    /// Runs all commands of a document and returns their number.
    fn follow(mut self, document: &str) -> Result<usize, String> {
        let commands = commands(document);
        for command in &commands {
            self.run(command)?;
        }
        self.stop()?;
        Ok(commands.len())
    }
}

/// Stops a daemon with SIGTERM.
fn stopped(mut daemon: Child) -> Result<(), String> {
    let signalled = Command::new("kill").arg("-TERM").arg(daemon.id().to_string()).status();
    if !signalled.is_ok_and(|status| status.success()) {
        let _ = daemon.kill();
        return Err("SIGTERM could not be sent to the daemon".to_owned());
    }
    let deadline = Instant::now() + PATIENCE;
    loop {
        match daemon.try_wait().map_err(|error| error.to_string())? {
            Some(status) if status.success() => return Ok(()),
            Some(status) => return Err(format!("the daemon ends with {status} after SIGTERM")),
            None if Instant::now() > deadline => {
                let _ = daemon.kill();
                return Err("the daemon does not end after SIGTERM".to_owned());
            }
            None => thread::sleep(Duration::from_millis(20)),
        }
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        for mut daemon in self.daemons.drain(..) {
            let _ = daemon.kill();
            let _ = daemon.wait();
        }
    }
}

/// Returns the path at which `cargo test` builds an example.
fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_BIN_EXE_steradian")).with_file_name("examples").join(name)
}

#[test]
fn readme_commands_work() {
    let count = Reader::new().follow(&read("README.md")).unwrap();
    assert!(count >= 10, "README.md has only {count} commands: were they found?");
}

#[test]
#[ignore = "long: make test-all"]
fn page_commands_work() {
    let pages = documents().into_iter().filter(|document| document != "README.md");
    let failed =
        pages.filter_map(|page| Reader::new().follow(&read(&page)).err().map(|problem| format!("{page}: {problem}")));
    let problems: Vec<String> = failed.collect();
    assert!(problems.is_empty(), "{}", problems.join("\n"));
}

#[test]
fn excused_commands_are_used() {
    let commands: Vec<String> = documents().iter().flat_map(|document| commands(&read(document))).collect();
    for (beginning, reason, _) in EXCUSED {
        assert!(commands.iter().any(|command| command.starts_with(beginning)), "no page uses `{beginning}` ({reason})");
    }
}

#[test]
fn wrong_commands_are_detected() {
    for wrong in [
        "steradian rendr --config configs/demo.toml --out out",
        "steradian render --config configs/no-such.toml --out out",
        "steradian serve --config configs/no-such.toml --listen 127.0.0.1:7143",
        "steradian catalogue info no-such.stars",
        "no-such-program --help",
        "make no-such-target",
        "grpcurl -plaintext 127.0.0.1:7143 steradian.v1.ViewService/NoSuchCall",
        "grpcurl -plaintext 127.0.0.1:7143 steradian.v1.NoSuchService/ListViews",
        "grpcurl -d '{\"updateMask\": \"exposure\"}' 127.0.0.1:7143 steradian.v1.ViewService/UpdateView",
        "grpcurl -d '{\"updateMask\": {\"paths\": [\"definition.fovDeg\"]}}' 127.0.0.1:7143 steradian.v1.ViewService/UpdateView",
        "grpcurl -d '{\"updateMask\": }' 127.0.0.1:7143 steradian.v1.ViewService/UpdateView",
        "cargo run --release --example no_such_example -- --out out",
        "cargo run --release --example render_view -- --no-such-option",
        "PYTHONPATH=python/src python3 python/examples/no_such.py",
        "PYTHONPATH=python/src python3 python/examples/frame_ages.py --no-such-option",
        "PYTHONPATH=elsewhere python3 python/examples/frame_ages.py",
        "scripts/no-such.sh",
    ] {
        let document = format!("text\n```sh\n# a comment\n{wrong}\n```\n");
        assert!(Reader::new().follow(&document).is_err(), "`{wrong}` passed");
    }
}

#[test]
fn commands_come_only_from_marked_blocks() {
    let document = "make a\n```sh\n# no\nmake b \\\n  c\n\nmake d\n```\n```toml\nmake e\n```\n```\nmake f\n```\n";
    assert_eq!(commands(document), ["make b c", "make d"]);
}

#[test]
fn documents_run_all_examples_and_readme_names_make_commands() {
    let commands: Vec<String> = documents().iter().flat_map(|document| commands(&read(document))).collect();
    let named: BTreeSet<&str> =
        commands.iter().filter_map(|command| example_of(command)).map(|(name, _)| name).collect();
    for file in fs::read_dir(repository().join("examples")).unwrap() {
        let path = file.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "rs") {
            continue;
        }
        let name = path.file_stem().unwrap().to_str().unwrap();
        assert!(named.contains(name), "no page runs the example {name}");
    }
    for command in ["make demo", "make test"] {
        assert!(commands.iter().any(|other| other == command), "README.md does not name `{command}`");
    }
}

/// Returns the relative targets of the links and pictures in a document. A target consists of a file (empty for the document itself) and a heading.
fn links(document: &str) -> Vec<(String, Option<String>)> {
    let targets = document.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    let targets = targets.filter(|target| !target.contains("://"));
    targets
        .map(|target| match target.split_once('#') {
            Some((file, heading)) => (file.to_owned(), Some(heading.to_owned())),
            None => (target.to_owned(), None),
        })
        .collect()
}

/// Returns the anchors of a document's headings.
fn anchors(document: &str) -> BTreeSet<String> {
    let headings =
        document.lines().filter(|line| line.starts_with('#')).map(|line| line.trim_start_matches('#').trim());
    let kept = |c: char| c.is_alphanumeric() || c == '-' || c == '_' || c == ' ';
    let anchor = |heading: &str| heading.to_lowercase().chars().filter(|&c| kept(c)).collect::<String>();
    headings.map(|heading| anchor(heading).replace(' ', "-")).collect()
}

#[test]
fn links_lead_to_files_and_headings() {
    let found = links("[a](b.md#c) ![d](e/f.png) [g](https://h.org/) [i](#j)");
    let link = |file: &str, heading: Option<&str>| (file.to_owned(), heading.map(str::to_owned));
    assert_eq!(found, [link("b.md", Some("c")), link("e/f.png", None), link("", Some("j"))]);
    assert_eq!(anchors("# Why, `so`\ntext\n## A b"), BTreeSet::from(["why-so".to_owned(), "a-b".to_owned()]));
    for document in documents().into_iter().chain(["CONTRIBUTING.md".to_owned(), "CHANGELOG.md".to_owned()]) {
        let text = read(&document);
        for (file, heading) in links(&text) {
            let path = repository().join(&document).with_file_name(&file);
            let path = if file.is_empty() { repository().join(&document) } else { path };
            assert!(path.exists(), "{document} links to {file}, which does not exist");
            if let Some(heading) = heading {
                let known = anchors(&fs::read_to_string(&path).unwrap());
                assert!(known.contains(&heading), "{document} links to #{heading} of `{file}`, which has {known:?}");
            }
        }
    }
}

/// Returns the code spans of a document, except those in fenced blocks.
fn code_spans(document: &str) -> Vec<String> {
    let mut inside = false;
    let prose = document.lines().filter(|line| {
        let fence = line.trim_start().starts_with("```");
        inside ^= fence;
        !fence && !inside
    });
    let prose: Vec<&str> = prose.collect();
    prose.join("\n").split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// Expands `a/{b,c}.rs` to `a/b.rs` and `a/c.rs`.
fn expanded(path: &str) -> Vec<String> {
    let Some((before, rest)) = path.split_once('{') else { return vec![path.to_owned()] };
    let Some((choices, after)) = rest.split_once('}') else { return vec![path.to_owned()] };
    choices.split(',').map(|choice| format!("{before}{}{after}", choice.trim())).collect()
}

/// Collects all files below a folder.
fn files_below(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() { files_below(&path, found) } else { found.push(path) }
    }
}

/// Whether a code span looks like a path of the repository: it has the extension of a source file, or consists of lower-case folder names.
fn is_path(span: &str) -> bool {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_./{},-*~".contains(c);
    let named = [".rs", ".wgsl", ".toml", ".proto", ".sh", ".md", ".svg", ".png", ".json"];
    let folders = span.contains('/') && span.starts_with(|c: char| c.is_ascii_lowercase() || c == '~' || c == '/');
    let code = span.contains("..") || span.contains("::") || span.starts_with('.');
    !code && span.chars().all(plain) && (folders || named.iter().any(|ending| span.ends_with(ending)))
}

/// Whether a path exists. It can be relative to the root, to `src/`, to `shaders/` or to the sources of a crate. Without a folder, it can be the name
/// of a source file or shader. A path without an extension may be a folder or a module. `*` matches any text in a name.
fn exists(path: &str, sources: &[PathBuf]) -> bool {
    let whole = |root: &str| {
        let path = repository().join(root).join(path);
        path.exists() || path.with_extension("rs").exists()
    };
    let matches = |pattern: &str, name: &str| match pattern.split_once('*') {
        Some((before, after)) => name.starts_with(before) && name.ends_with(after),
        None => name == pattern,
    };
    let (folder, name) = path.rsplit_once('/').unwrap_or(("", path));
    let by_name = || {
        sources.iter().any(|file| {
            let below = file.parent().unwrap().strip_prefix(repository()).unwrap();
            let in_folder = folder.is_empty() || ROOTS.iter().any(|root| below == Path::new(root).join(folder));
            in_folder && matches(name, file.file_name().unwrap().to_str().unwrap())
        })
    };
    ROOTS.into_iter().any(whole) || by_name()
}

/// Returns the files that [`exists`] accepts without a folder.
fn sources() -> Vec<PathBuf> {
    let mut sources = Vec::new();
    for folder in SOURCE_FOLDERS {
        files_below(&repository().join(folder), &mut sources);
    }
    sources
}

/// Returns the paths that a document names and that do not exist.
fn missing_paths(document: &str, sources: &[PathBuf]) -> Vec<String> {
    let excused = |path: &String| NO_FILES.iter().any(|(beginning, _)| path.starts_with(beginning));
    let spans = code_spans(document).into_iter().filter(|span| is_path(span)).filter(|span| !excused(span));
    spans.flat_map(|span| expanded(&span)).filter(|path| !exists(path, sources)).collect()
}

/// Returns the paths of files in the comments of a Rust or WGSL file. These are words that begin with a folder of sources, or end like the name of a
/// source file. Comments that follow code on the same line are left out.
fn paths_in_comments(source: &str) -> Vec<String> {
    let separates = |c: char| c.is_whitespace() || "()[];:\"`|".contains(c);
    let comments = source.lines().filter_map(|line| line.trim_start().strip_prefix("//"));
    let words = comments.flat_map(|comment| comment.trim_start_matches(['/', '!']).split(separates));
    // A list in braces is one word, so commas inside of a word do not end it.
    let words = words.map(|word| word.trim_end_matches([',', '.']).trim_end_matches("'s"));
    let in_folder = |word: &str| SOURCE_FOLDERS.iter().any(|folder| word.starts_with(&format!("{folder}/")));
    let of_source =
        |word: &str| [".rs", ".wgsl"].iter().any(|ending| word.len() > ending.len() && word.ends_with(ending));
    let is_template = |word: &str| word.contains('{') && !word.contains(',');
    let paths = words.filter(|word| is_path(word) && !is_template(word) && (in_folder(word) || of_source(word)));
    paths.flat_map(expanded).collect()
}

#[test]
fn paths_in_comments_exist() {
    let sources = sources();
    let mut files = Vec::new();
    for folder in ["src", "crates", "shaders"] {
        files_below(&repository().join(folder), &mut files);
    }
    let mut problems = Vec::new();
    let mut count = 0;
    for file in files {
        let paths = paths_in_comments(&fs::read_to_string(&file).unwrap());
        count += paths.len();
        let missing = paths.into_iter().filter(|path| !exists(path, &sources));
        problems.extend(missing.map(|path| format!("{}: {path}", file.display())));
    }
    assert!(problems.is_empty(), "paths that do not exist:\n{}", problems.join("\n"));
    assert!(count > 100, "only {count} paths were found");
}

#[test]
fn paths_are_found_in_comments_alone() {
    let source = "//! Twin: crates/render/src/plan/none.rs. See `shaders/none/{a,b}.wgsl`,\n    // tiles.rs's and (plan/none.rs); x / y and a/b\n\
                  let path = \"src/other.rs\"; // src/after_code.rs\n/// `shaders/{name}.wgsl`, .wgsl";
    let paths = paths_in_comments(source);
    let expected =
        ["crates/render/src/plan/none.rs", "shaders/none/a.wgsl", "shaders/none/b.wgsl", "tiles.rs", "plan/none.rs"];
    assert_eq!(paths, expected);
    let sources = sources();
    let existing: Vec<_> = paths.iter().filter(|path| exists(path, &sources)).collect();
    assert_eq!(existing, ["tiles.rs"]);
}

#[test]
fn paths_that_documents_name_exist() {
    let sources = sources();
    let mut problems = Vec::new();
    for document in documents().into_iter().chain(["CONTRIBUTING.md".to_owned()]) {
        problems
            .extend(missing_paths(&read(&document), &sources).into_iter().map(|path| format!("{document}: {path}")));
    }
    assert!(problems.is_empty(), "paths that do not exist:\n{}", problems.join("\n"));
}

#[test]
fn missing_paths_are_detected() {
    let good = "`crates/render/src/plan/mod.rs` `plan/` `plan/tiles.rs` `tiles.rs` `crates/render/src/plan/{limits,tiles}.rs` `plan/tiles` `crates/testkit/src/`\n\
                ```\n`src/none.rs`\n```\n`SceneService/UpdateScene` `out/dome.png` `a.b` `L = E / A` `--set a.b=c`\n";
    let sources = sources();
    assert_eq!(missing_paths(good, &sources), Vec::<String>::new());
    for wrong in [
        "src/none.rs",
        "plan/none.rs",
        "none.wgsl",
        "passes/none/",
        "crates/render/src/plan/{tiles,none}.rs",
        "nowhere/at/all",
    ] {
        assert_eq!(missing_paths(&format!("text `{wrong}` text"), &sources).len(), 1, "`{wrong}` passed");
    }
}

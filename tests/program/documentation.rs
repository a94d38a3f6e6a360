//! Proves that the documentation is true: the commands of README.md work as they stand there, every example runs, and every
//! file that a document links to exists.
//!
//! Commands are the lines of the fenced blocks marked `sh`. They run one after the other by `sh`, in a folder that has the
//! repository's configurations, with the built program in PATH:
//!
//! - `cargo run --release --example NAME -- ARGUMENTS` runs the example as `cargo test` has built it,
//! - `steradian serve` goes on in the background, on a free port, and is stopped by SIGTERM after the last command,
//! - `steradian xr` draws one frame, or says by exit code 69 what of OpenXR is missing here; `tests/headset` runs it on a runtime,
//! - `make TARGET` is not run; the Makefile must have the target,
//! - `grpcurl` may not be installed; the method that is called must be in the protocol.

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

/// Address of the daemon in the documentation; commands get a free port in its place.
const DOCUMENTED_ADDRESS: &str = "127.0.0.1:7143";
/// Far longer than a daemon needs to start or to end.
const PATIENCE: Duration = Duration::from_secs(120);

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &str) -> String {
    fs::read_to_string(repository().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// The commands in the blocks marked `sh`. Comments and blank lines are left out, continued lines joined.
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

/// Name of the example that a command runs, and what follows `--`.
fn example_of(command: &str) -> Option<(&str, &str)> {
    let rest = command.strip_prefix("cargo run --release --example ")?;
    Some(rest.split_once(" -- ").unwrap_or((rest, "")))
}

fn has_target(makefile: &str, target: &str) -> bool {
    makefile.lines().any(|line| line.starts_with(&format!("{target}:")))
}

/// Whether a call like `steradian.v1.ViewService/ListViews` is in the protocol.
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

/// Checks a `grpcurl` command by the calls it names.
fn check_grpcurl(command: &str) -> Result<(), String> {
    let mut calls = command.split_whitespace().filter(|word| word.contains('/') && word.starts_with("steradian"));
    match calls.find(|call| !has_call(call)) {
        Some(call) => Err(format!("`{command}`: the protocol has no {call}")),
        None => Ok(()),
    }
}

/// Runs the commands of a document in a folder of its own.
struct Reader {
    folder: tempfile::TempDir,
    daemon: Option<Child>,
    address: String,
}

impl Reader {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("configs")).unwrap();
        for file in fs::read_dir(repository().join("configs")).unwrap() {
            let file = file.unwrap();
            fs::copy(file.path(), folder.path().join("configs").join(file.file_name())).unwrap();
        }
        // A port that nobody listens on. Another process may take it in between; then the daemon's error says so.
        let free = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = free.local_addr().unwrap().to_string();
        Self { folder, daemon: None, address }
    }

    /// `sh` for a command, with the program in PATH.
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
        if let Some(target) = command.strip_prefix("make ") {
            let found = has_target(&read("Makefile"), target);
            return if found { Ok(()) } else { Err(format!("`{command}`: the Makefile has no such target")) };
        }
        if command.starts_with("grpcurl ") {
            return check_grpcurl(&command);
        }
        if command.starts_with("steradian serve") {
            self.stop()?;
            return self.serve(&command);
        }
        let mut runs = command.clone();
        if let Some((name, arguments)) = example_of(&command) {
            let example = example(name);
            if !example.is_file() {
                return Err(format!(
                    "{}: not built: `cargo test` builds all examples, or there is none",
                    example.display()
                ));
            }
            runs = format!("'{}' {arguments}", example.display());
        }
        if command.starts_with("steradian xr") {
            runs.push_str(" --frames 1");
        }
        let output = self.shell(&runs).output().map_err(|error| format!("`{command}`: {error}"))?;
        let said = String::from_utf8_lossy(&output.stderr);
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
        let output = daemon.stdout.take().expect("standard output is a pipe");
        self.daemon = Some(daemon);
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
        let listening = line.strip_prefix("listening on ").is_some_and(|address| address == self.address);
        if listening { Ok(()) } else { Err(format!("`{command}`: prints `{line}`, listens not on {}", self.address)) }
    }

    /// Stops the daemon, if one runs, as a service manager does.
    fn stop(&mut self) -> Result<(), String> {
        let Some(mut daemon) = self.daemon.take() else { return Ok(()) };
        let told = Command::new("kill").arg("-TERM").arg(daemon.id().to_string()).status();
        if !told.is_ok_and(|status| status.success()) {
            let _ = daemon.kill();
            return Err("the daemon could not be told to end".to_owned());
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

    /// Runs everything that a document tells its reader to do.
    fn follow(mut self, document: &str) -> Result<usize, String> {
        let commands = commands(document);
        for command in &commands {
            self.run(command)?;
        }
        self.stop()?;
        Ok(commands.len())
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        if let Some(mut daemon) = self.daemon.take() {
            let _ = daemon.kill();
            let _ = daemon.wait();
        }
    }
}

/// Where `cargo test` puts the example of that name.
fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_BIN_EXE_steradian")).with_file_name("examples").join(name)
}

#[test]
fn the_commands_of_the_readme_work() {
    match Reader::new().follow(&read("README.md")) {
        Ok(count) => assert!(count >= 10, "README.md has only {count} commands: were they found?"),
        Err(problem) => panic!("{problem}"),
    }
}

#[test]
fn a_wrong_command_is_noticed() {
    for wrong in [
        "steradian rendr --config configs/demo.toml --out out",
        "steradian render --config configs/no-such.toml --out out",
        "steradian serve --config configs/no-such.toml --listen 127.0.0.1:7143",
        "steradian catalogue info no-such.stars",
        "no-such-program --help",
        "make no-such-target",
        "grpcurl -plaintext 127.0.0.1:7143 steradian.v1.ViewService/NoSuchCall",
        "grpcurl -plaintext 127.0.0.1:7143 steradian.v1.NoSuchService/ListViews",
        "cargo run --release --example no_such_example -- --out out",
        "cargo run --release --example render_view -- --no-such-option",
    ] {
        let document = format!("text\n```sh\n# a comment\n{wrong}\n```\n");
        assert!(Reader::new().follow(&document).is_err(), "`{wrong}` passed");
    }
}

#[test]
fn commands_are_found_in_marked_blocks_alone() {
    let document = "make a\n```sh\n# no\nmake b \\\n  c\n\nmake d\n```\n```toml\nmake e\n```\n```\nmake f\n```\n";
    assert_eq!(commands(document), ["make b c", "make d"]);
}

#[test]
fn the_readme_runs_every_example_and_names_both_make_commands() {
    let commands = commands(&read("README.md"));
    let named: BTreeSet<&str> =
        commands.iter().filter_map(|command| example_of(command)).map(|(name, _)| name).collect();
    for file in fs::read_dir(repository().join("examples")).unwrap() {
        let path = file.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap();
        assert!(named.contains(name), "README.md does not run the example {name}");
    }
    for command in ["make demo", "make test"] {
        assert!(commands.iter().any(|other| other == command), "README.md does not name `{command}`");
    }
}

/// Relative targets of the links and pictures of a document.
fn links(document: &str) -> Vec<String> {
    let targets = document.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    let paths = targets.map(|target| target.split('#').next().unwrap_or_default().to_owned());
    paths.filter(|path| !path.is_empty() && !path.contains("://")).collect()
}

#[test]
fn links_lead_to_files() {
    assert_eq!(links("[a](b.md#c) ![d](e/f.png) [g](https://h.org/) [i](#j)"), ["b.md", "e/f.png"]);
    for document in [
        "README.md",
        "CONTRIBUTING.md",
        "CHANGELOG.md",
        "docs/architecture.md",
        "docs/benchmarks.md",
        "docs/glare-methods.md",
        "docs/star-methods.md",
    ] {
        let folder = repository().join(document);
        for link in links(&read(document)) {
            let path = folder.parent().unwrap().join(&link);
            assert!(path.exists(), "{document} links to {link}, which does not exist");
        }
    }
}

//! Proves that only modules called `platform` contain code that depends on the operating system. Such code is: `cfg` predicates that name systems,
//! modules of the standard library and of tokio for particular systems, crates for particular systems, and paths such as `/proc`. Tests and
//! benchmarks run on Linux and are not examined.

use std::path::{Path, PathBuf};

use crate::layering::{
    CRATES,
    paths::{Token, tokens},
    rust_files,
};

/// Folders that are examined, besides those of [`CRATES`].
const OTHERS: [&str; 2] = ["crates/proto/src", "examples"];

/// Name of the modules that may have such code.
const PLATFORM: &str = "platform";

/// Predicates of `cfg` that name systems.
const PREDICATES: [&str; 6] = ["unix", "windows", "target_os", "target_family", "target_vendor", "target_env"];

/// Crates for particular operating systems.
const SYSTEM_CRATES: [&str; 12] = [
    "libc",
    "libsystemd",
    "nix",
    "objc2",
    "rustix",
    "sd_notify",
    "signal_hook",
    "wayland_client",
    "winapi",
    "windows_sys",
    "x11_dl",
    "x11rb",
];

/// Types and functions for particular operating systems.
const SYSTEM_NAMES: [&str; 8] = [
    "RawWindowHandle",
    "UnixDatagram",
    "UnixListener",
    "UnixStream",
    "ctrl_break",
    "ctrl_close",
    "ctrl_logoff",
    "ctrl_shutdown",
];

/// Ends of the names of winit's traits for particular operating systems.
const EXTENSIONS: [&str; 4] = ["ExtX11", "ExtWayland", "ExtWindows", "ExtMacOS"];

/// Starts of paths that exist only on particular operating systems.
const SYSTEM_PATHS: [&str; 4] = ["\"/proc/", "\"/sys/", "\"/dev/", "\"C:\\"];

/// Returns the words of a source that depend on the operating system.
fn dependent_code(source: &str) -> Vec<String> {
    let tokens = tokens(source);
    let mut found = Vec::new();
    let word = |index: usize| match tokens.get(index) {
        Some(Token::Word(word)) => word.as_str(),
        _ => "",
    };
    for index in 0..tokens.len() {
        let name = word(index);
        if SYSTEM_CRATES.contains(&name)
            || SYSTEM_NAMES.contains(&name)
            || EXTENSIONS.iter().any(|end| name.ends_with(end))
        {
            found.push(name.to_owned());
        }
        // Find `std::os::unix` and `tokio::signal::unix`, even in a group.
        let is_path = tokens.get(index + 1) == Some(&Token::PathSeparator);
        if is_path && (name == "os" || (name == "signal" && ["unix", "windows"].contains(&word(index + 2)))) {
            found.push(format!("{name}::{}", word(index + 2)));
        }
        if ["cfg", "cfg_attr"].contains(&name) {
            found.extend(predicates(&tokens[index + 1..]).map(|predicate| format!("{name}({predicate})")));
        }
    }
    let code = source.lines().filter(|line| !line.trim_start().starts_with("//"));
    for line in code {
        found.extend(SYSTEM_PATHS.iter().filter(|start| line.contains(**start)).map(|start| start[1..].to_owned()));
    }
    found
}

/// Returns the predicates that name systems inside the parentheses that follow `cfg` or `cfg!`.
fn predicates(after: &[Token]) -> impl Iterator<Item = &str> {
    let opens = after.iter().take(2).position(|token| *token == Token::Other('('));
    let inside = opens.map_or(&[][..], |opens| &after[opens..]);
    let mut depth = 0_i32;
    let inside = inside.iter().take_while(move |token| {
        match token {
            Token::Other('(') => depth += 1,
            Token::Other(')') => depth -= 1,
            _ => {}
        }
        depth > 0
    });
    inside.filter_map(|token| match token {
        Token::Word(word) if PREDICATES.contains(&word.as_str()) => Some(word.as_str()),
        _ => None,
    })
}

/// Whether a file belongs to a module called `platform`.
fn is_platform(file: &Path) -> bool {
    file.with_extension("").iter().any(|part| part == PLATFORM)
}

/// Examines every file; returns the violations, and the files that belong to `platform`.
fn examined() -> (Vec<String>, Vec<PathBuf>) {
    let (mut report, mut platform) = (Vec::new(), Vec::new());
    for folder in CRATES.iter().chain(&OTHERS) {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
        let mut files = Vec::new();
        rust_files(&root, &root, &mut files);
        files.sort();
        for file in files {
            if is_platform(&file) {
                platform.push(Path::new(folder).join(file));
                continue;
            }
            let source = std::fs::read_to_string(root.join(&file)).expect("source can be read");
            let found = dependent_code(&source);
            report.extend(found.into_iter().map(|name| format!("{folder}/{}: {name}", file.display())));
        }
    }
    (report, platform)
}

#[test]
fn code_that_depends_on_the_system_is_in_modules_named_platform() {
    let (report, platform) = examined();
    assert!(report.is_empty(), "code for particular operating systems outside of `platform`:\n{}", report.join("\n"));
    for file in ["crates/sky/src/platform.rs", "src/platform/unix/sockets.rs", "src/windows/platform/unix/x11.rs"] {
        assert!(platform.iter().any(|known| known == Path::new(file)), "{file} is not examined: {platform:?}");
    }
}

/// Returns the names of the `pub(crate)` items of a source.
fn interface(source: &str) -> Vec<String> {
    let tokens = tokens(source);
    let word = |index: usize| match tokens.get(index) {
        Some(Token::Word(word)) => word.as_str(),
        _ => "",
    };
    let is_public = |index: usize| {
        word(index) == "pub" && word(index + 2) == "crate" && tokens.get(index + 3) == Some(&Token::Other(')'))
    };
    let kinds = ["async", "const", "enum", "fn", "mod", "struct"];
    let names = (0..tokens.len()).filter(|index| is_public(*index)).filter_map(|index| {
        let first = (index + 4..).find(|index| !kinds.contains(&word(*index)))?;
        // In a re-export, the name is at the end.
        let last = (first..tokens.len()).take_while(|index| tokens[*index] != Token::Other(';')).last();
        Some(if word(first) == "use" { word(last?) } else { word(first) }.to_owned())
    });
    let mut names: Vec<String> = names.collect();
    names.sort();
    names
}

#[test]
fn all_systems_have_the_same_interface() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/platform");
    let mut files = Vec::new();
    rust_files(&root.join("unix"), &root.join("unix"), &mut files);
    assert!(files.len() > 5, "{files:?}");
    let read = |system: &str, file: &Path| {
        let source = std::fs::read_to_string(root.join(system).join(file));
        interface(&source.unwrap_or_else(|error| panic!("{system}/{}: {error}", file.display())))
    };
    for file in &files {
        assert_eq!(read("unix", file), read("windows", file), "{}", file.display());
    }
}

#[test]
fn devices_are_not_read() {
    let error = steradian_sky::files::read_bounded(Path::new("/dev/zero"), 3).expect_err("a device has no end");
    assert!(error.to_string().contains("only regular files"), "{error}");
}

#[test]
fn violations_are_found_in_every_form() {
    for source in [
        "use rustix::process;",
        "use std::os::unix::net::UnixStream;",
        "use std::{io, os::unix::fs::FileTypeExt as _};",
        "use std::os::fd::AsFd;",
        "use tokio::{net::{TcpListener, UnixListener}, sync::watch};",
        "let hangups = signal::unix::signal(kind)?;",
        "tokio::signal::windows::ctrl_c()",
        "#[cfg(unix)] mod socket;",
        "#[cfg(all(test, not(windows)))] mod tests {}",
        "#[cfg(any(feature = \"cli\", target_os = \"linux\"))] fn f() {}",
        "#[cfg_attr(target_family = \"unix\", allow(dead_code))] fn f() {}",
        "const B: Backends = if cfg!(target_vendor = \"apple\") { METAL } else { VULKAN };",
        "use winit::platform::x11::EventLoopBuilderExtX11;",
        "x11rb::connect(None)",
        "let text = std::fs::read_to_string(\"/proc/self/statm\")?;",
        "windows_sys::Win32::Foundation::CloseHandle(handle)",
    ] {
        assert!(!dependent_code(source).is_empty(), "not found: {source}");
    }
    assert!(!is_platform(Path::new("service/daemon/platforms.rs")));
    assert_ne!(interface("pub(crate) fn a() {}"), interface("pub(crate) async fn b() {}"));
    assert_eq!(interface("pub(crate) use x::{Y as Z}; pub(crate) const fn a() {} fn b() {}").len(), 2);
}

#[test]
fn other_code_is_not_reported() {
    for source in [
        "#[cfg(feature = \"windows\")] mod windows; use crate::windows::check_display;",
        "#[cfg(test)] mod tests { use super::*; } // cfg(unix), rustix",
        "use crate::platform::{process, signals}; const UNIX_PREFIX: &str = \"unix:\";",
        "tokio::signal::ctrl_c()",
        "fn unix(windows: &[u32]) -> Address { Address::Unix(windows.os) }",
        "/// Reads `/proc/self`.\nlet a = \"/procedure\";",
    ] {
        assert_eq!(dependent_code(source), Vec::<String>::new(), "{source}");
    }
    for file in ["platform.rs", "platform/unix/sockets.rs", "windows/platform/win32.rs"] {
        assert!(is_platform(Path::new(file)), "{file}");
    }
}

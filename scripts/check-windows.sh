#!/usr/bin/env bash
# Checks that all crates and the program compile for Windows, or builds the program if the first argument is `build`. Needs the Rust target, and MinGW
# for C code and for linking; the script installs neither. A first check takes about four minutes on two cores, so CI does not run it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

target=x86_64-pc-windows-gnu
if ! [[ -d $(rustc --print sysroot)/lib/rustlib/$target/lib ]]; then
    echo "not checked: the target is missing: rustup target add $target" >&2
    exit 1
fi
if ! command -v x86_64-w64-mingw32-gcc >/dev/null; then
    echo 'not checked: the C compiler for Windows is missing: apt install gcc-mingw-w64-x86-64' >&2
    exit 1
fi
case ${1-check} in
    check) cargo check --release --target "$target" --package steradian --package steradian-sky --package steradian-render --lib --bins ;;
    build) cargo build --release --target "$target" --bin steradian ;;
    *)
        echo "usage: $0 [check|build]" >&2
        exit 64
        ;;
esac

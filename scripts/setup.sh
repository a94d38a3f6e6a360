#!/usr/bin/env bash
# Ensures that this machine can build and run Steradian: a Rust toolchain, a linker, a Vulkan driver; with STERADIAN_REQUIRE_PAGE=1 also the
# programs for the tests of the page, with STERADIAN_REQUIRE_PYTHON=1 those for the tests of the Python package.
# Changes nothing if everything is installed. Exit code 69: a missing program cannot be installed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source scripts/lib/apt.sh

# The oldest toolchain that the manifest allows.
needed=$(sed -n 's/^rust-version *= *"\([0-9.]*\)".*/\1/p' Cargo.toml)
readonly needed
if [[ -z $needed ]]; then fail 'Cargo.toml names no rust-version'; fi

check_cargo() {
    local how="Rust $needed or newer is needed: install it with rustup (https://rustup.rs), or run: rustup update stable"
    if ! command -v cargo >/dev/null; then
        fail "cargo is not in PATH. $how"
    fi
    local found
    found=$(cargo --version | cut -d ' ' -f 2)
    # sort --version-sort puts the older version first.
    if [[ $(printf '%s\n' "$needed" "${found%%-*}" | sort --version-sort | head -n 1) != "$needed" ]]; then
        fail "the version of cargo is $found. $how"
    fi
}

# rustc calls the C compiler to link, and the crates ring and zstd-sys compile C code.
check_linker() {
    if command -v cc >/dev/null; then return; fi
    local reason="'cc' is missing, which rustc needs for linking and some crates for C"
    if has_apt; then
        apt_install "$reason" '' gcc libc6-dev || fail "$reason, and apt could not install gcc and libc6-dev (see above)"
    else
        fail "$reason: install a C compiler (gcc or clang) with the C library's development files"
    fi
}

check_cargo
check_linker
scripts/ensure-vulkan.sh
# Optional: without a browser the tests of the page are reported as ignored.
if [[ -n ${STERADIAN_REQUIRE_PAGE-} && $STERADIAN_REQUIRE_PAGE != 0 ]]; then
    scripts/ensure-page.sh npm browser
fi
# Optional: a Python with grpcio and pytest.
if [[ -n ${STERADIAN_REQUIRE_PYTHON-} && $STERADIAN_REQUIRE_PYTHON != 0 ]]; then
    scripts/ensure-python.sh
fi

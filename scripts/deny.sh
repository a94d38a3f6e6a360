#!/usr/bin/env bash
# Checks the dependencies against deny.toml, with the cargo-deny that is installed or one in target/tools, which is built once. Where none can be had, or the
# database of advisories cannot be fetched, it says what was not checked; what is found fails.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

version=0.20.2
# It takes longer where registry or machine are slow: then it is given up.
most_s=${STERADIAN_DENY_BUILD_S:-300}
tools=${CARGO_TARGET_DIR:-target}/tools
PATH=$(realpath -m "$tools")/bin:$PATH
if ! command -v cargo-deny >/dev/null; then
    echo "building cargo-deny $version in $tools, at most $most_s s"
    # Beside the tools, so that a build that was given up goes on the next time.
    if ! timeout "$most_s" cargo install cargo-deny --quiet --locked --version "$version" --root "$tools" --target-dir "$tools/build"; then
        echo "licences, versions, sources and advisories of dependencies are not checked: cargo-deny $version could not be built within $most_s s" >&2
        exit 0
    fi
    rm -rf "$tools/build"
fi

cargo deny check licenses bans sources
if cargo deny fetch db; then
    cargo deny check --disable-fetch advisories
else
    echo 'advisories are not checked: their database cannot be fetched' >&2
fi

#!/usr/bin/env bash
# Checks the dependencies against deny.toml, with an installed cargo-deny or one that is built once in target/tools. If cargo-deny cannot be built, or
# the database of advisories cannot be fetched, the script reports which checks were skipped, and succeeds. It fails if a check finds a violation.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

version=0.20.2
# Time limit of the build, s. If the registry or the machine is too slow, the build is abandoned.
most_s=${STERADIAN_DENY_BUILD_S:-300}
tools=${CARGO_TARGET_DIR:-target}/tools
PATH=$(realpath -m "$tools")/bin:$PATH
if ! command -v cargo-deny >/dev/null; then
    echo "building cargo-deny $version in $tools, at most $most_s s"
    # The build folder is kept, so that an abandoned build continues the next time.
    if ! timeout "$most_s" cargo install cargo-deny --quiet --locked --version "$version" --root "$tools" --target-dir "$tools/build"; then
        echo "licences, versions, sources and advisories of dependencies are not checked: cargo-deny $version was not built within $most_s s" >&2
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

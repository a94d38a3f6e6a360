#!/usr/bin/env bash
# Ensures that the daemon's page can be built (npm) or tested (browser): installs missing packages with apt, and those of web/package-lock.json
# with npm. Building and running Steradian needs neither npm nor a browser: the built page is in web/dist.
#
# Usage: scripts/ensure-page.sh [npm] [browser]. Exit code 69: a missing package cannot be installed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source scripts/lib/apt.sh

# The oldest Node.js that the packages support.
readonly NODE=20

# has_node: whether node is new enough and npm exists.
has_node() {
    local found
    if ! command -v node >/dev/null || ! command -v npm >/dev/null; then return 1; fi
    found=$(node --version)
    found=${found#v}
    ((${found%%.*} >= NODE))
}

ensure_npm() {
    if ! has_node; then
        local reason="building the page needs Node.js $NODE or newer, and npm"
        has_apt || fail "$reason: install them"
        apt_install "$reason" '' nodejs npm || fail "$reason, and apt could not install them (see above)"
        has_node || fail "$reason, and this system's package is older: install them from elsewhere (https://nodejs.org)"
    fi
    if [[ web/package-lock.json -nt web/node_modules/.package-lock.json ]]; then
        say 'installing the packages of web/package-lock.json into web/node_modules with npm'
        npm ci --prefix web --no-fund --no-audit >&2 || fail 'npm could not install them (see above)'
    fi
}

ensure_browser() {
    if command -v chromium >/dev/null && command -v chromedriver >/dev/null; then return; fi
    local reason='the tests of the page need Chromium and its driver'
    has_apt || fail "$reason: install chromium and chromedriver"
    apt_install "$reason" '' chromium chromium-driver || fail "$reason, and apt could not install them (see above)"
}

for part in "$@"; do
    case $part in
    npm) ensure_npm ;;
    browser) ensure_browser ;;
    *) fail "$part: must be npm or browser" ;;
    esac
done

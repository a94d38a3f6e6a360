#!/usr/bin/env bash
# Ensures that the tests of the Python package can run: installs a Python with grpcio, protobuf, numpy, pytest and mypy with apt if it is missing. Building and
# running Steradian does not need it.
#
# Usage: scripts/ensure-python.sh. STERADIAN_PYTHON names the Python for the tests. Exit code 69: a missing package cannot be installed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source scripts/lib/apt.sh

# has_modules: whether one of the Pythons that tests/python tries has all modules.
has_modules() {
    local python
    for python in ${STERADIAN_PYTHON:-/usr/bin/python3 python3}; do
        if "$python" -c 'import google.protobuf, grpc, mypy, numpy, pytest' 2>/dev/null; then return 0; fi
    done
    return 1
}

if has_modules; then exit 0; fi
reason='the tests of the Python package need grpcio, protobuf, numpy, pytest and mypy'
if [[ -n ${STERADIAN_PYTHON-} ]]; then fail "$reason: install them for $STERADIAN_PYTHON"; fi
has_apt || fail "$reason: install them"
apt_install "$reason" '' python3 python3-grpcio python3-protobuf python3-numpy python3-pytest mypy ||
    fail "$reason, and apt could not install them (see above)"
has_modules || fail "$reason, and the packages of this system do not contain all of them"

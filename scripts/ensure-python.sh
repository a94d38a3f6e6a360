#!/usr/bin/env bash
# Ensures that the tests of the Python package can run; with the argument `farm` those of the job templates, with `hats` that of catalogues in HATS.
# Building and running Steradian does not need this. Installs what is missing:
# - with apt, a Python with grpcio, protobuf, numpy, pytest and mypy,
# - `farm`: with pip, openjd-cli and kubernetes-validate in a virtual environment in ~/.cache/steradian/farm (130 MB),
# - `hats`: with pip, hats-import in a virtual environment in ~/.cache/steradian/hats (930 MB).
#
# Usage: scripts/ensure-python.sh [farm | hats]. STERADIAN_PYTHON names the Python for the tests, STERADIAN_FARM_PYTHON the one for the job templates,
# STERADIAN_HATS_PYTHON the one for catalogues in HATS. Exit code 69: a missing package cannot be installed.
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

ensure_modules() {
    if has_modules; then return; fi
    local reason='the tests of the Python package need grpcio, protobuf, numpy, pytest and mypy'
    if [[ -n ${STERADIAN_PYTHON-} ]]; then fail "$reason: install them for $STERADIAN_PYTHON"; fi
    has_apt || fail "$reason: install them"
    apt_install "$reason" '' python3 python3-grpcio python3-protobuf python3-numpy python3-pytest mypy ||
        fail "$reason, and apt could not install them (see above)"
    has_modules || fail "$reason, and the packages of this system do not contain all of them"
}

# install_in FOLDER REASON PACKAGE...: makes a virtual environment with these packages.
install_in() {
    local folder=$1 reason=$2
    shift 2
    say "$reason: installing them with pip in $folder"
    if ! python3 -m venv --clear "$folder" >/dev/null 2>&1; then
        has_apt || fail "$reason, and python3 cannot make a virtual environment"
        apt_install "$reason" '' python3 python3-venv && python3 -m venv --clear "$folder" >&2 ||
            fail "$reason, and python3 cannot make a virtual environment"
    fi
    "$folder/bin/pip" install --quiet --disable-pip-version-check "$@" >&2 ||
        fail "$reason, and pip could not install them (see above)"
}

farm=${XDG_CACHE_HOME:-$HOME/.cache}/steradian/farm

has_farm_modules() { "${STERADIAN_FARM_PYTHON:-$farm/bin/python}" -c 'import kubernetes_validate, openjd.cli' 2>/dev/null; }

ensure_farm_modules() {
    if has_farm_modules; then return; fi
    local reason='the tests of the job templates need openjd-cli and kubernetes-validate'
    if [[ -n ${STERADIAN_FARM_PYTHON-} ]]; then fail "$reason: install them for $STERADIAN_FARM_PYTHON"; fi
    # Versions are fixed, because a new one may refuse files that an old one accepts.
    install_in "$farm" "$reason" openjd-cli==0.8.0 kubernetes-validate==1.37.0
    has_farm_modules || fail "$reason, and they do not run"
}

hats=${XDG_CACHE_HOME:-$HOME/.cache}/steradian/hats

has_hats_import() { "${STERADIAN_HATS_PYTHON:-$hats/bin/python}" -c 'import hats_import' 2>/dev/null; }

ensure_hats_import() {
    if has_hats_import; then return; fi
    local reason='the test of catalogues in HATS needs hats-import and its dependencies'
    if [[ -n ${STERADIAN_HATS_PYTHON-} ]]; then fail "$reason: install them for $STERADIAN_HATS_PYTHON"; fi
    install_in "$hats" "$reason" hats-import==0.11.1
    has_hats_import || fail "$reason, and they do not run"
}

case ${1-} in
    '') ensure_modules ;;
    farm) ensure_farm_modules ;;
    hats) ensure_hats_import ;;
    *) fail "unknown argument $1: must be farm, hats, or none" ;;
esac

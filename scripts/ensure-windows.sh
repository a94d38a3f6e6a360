#!/usr/bin/env bash
# Ensures that windows can be tested without a monitor. Installs with apt Xvfb, and Xorg with its dummy driver, whose monitors can be switched on and
# off. Building and running Steradian needs neither.
#
# Usage: scripts/ensure-windows.sh. Exit code 69: a missing package cannot be installed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source scripts/lib/apt.sh

readonly DUMMY=/usr/lib/xorg/modules/drivers/dummy_drv.so
reason='the tests of windows need Xvfb, and Xorg with its dummy driver'

has_all() {
    command -v Xvfb >/dev/null && command -v Xorg >/dev/null && [[ -e $DUMMY ]]
}

if has_all; then exit 0; fi
has_apt || fail "$reason: install them"
apt_install "$reason" '' xvfb xserver-xorg-core xserver-xorg-video-dummy ||
    fail "$reason, and apt could not install them (see above)"
has_all || fail "$reason: the packages are installed, but not at the expected place ($DUMMY)"

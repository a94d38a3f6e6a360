#!/usr/bin/env bash
# Makes sure that windows can be tested without a monitor: installs Xvfb, and Xorg with its dummy driver, whose monitors can be switched on
# and off, with apt. Neither is needed to build or run Steradian.
#
# Usage: scripts/ensure-windows.sh. Exit code 69: something is missing that the script cannot install.
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
has_all || fail "$reason: the packages are installed, and they are not where they are looked for ($DUMMY)"

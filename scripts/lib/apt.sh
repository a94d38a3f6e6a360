# shellcheck shell=bash
# Installing packages on Debian and its relatives. Sourced, not run. It announces everything that it does to the system.

# Exit code of a missing prerequisite: EX_UNAVAILABLE of sysexits.h.
readonly EX_UNAVAILABLE=69

say() { printf 'setup: %s\n' "$*" >&2; }

# fail LINE...: says what is missing and how to get it, and ends the script.
fail() {
    local line
    for line in "$@"; do say "$line"; done
    exit "$EX_UNAVAILABLE"
}

# Whether this system installs packages with apt.
has_apt() { command -v apt-get >/dev/null; }

# os_release KEY: a value of /etc/os-release, empty if there is none.
os_release() {
    if [[ -r /etc/os-release ]]; then
        (
            # shellcheck disable=SC1091
            source /etc/os-release
            printf '%s' "${!1-}"
        )
    fi
}

# as_root COMMAND...: runs a command as root, directly or through sudo.
as_root() {
    if [[ $EUID -eq 0 ]]; then
        "$@"
    # Without a terminal nobody could type a password: then sudo must do without, or fail at once.
    elif [[ -t 0 ]]; then
        sudo "$@"
    else
        sudo -n "$@"
    fi
}

# need_root REASON PACKAGE...: ends the script with the command to run, if there is no way to become root.
need_root() {
    local reason=$1
    shift
    if [[ $EUID -eq 0 ]]; then return; fi
    local how="installing it needs root; as root, run: apt-get install $*"
    if ! command -v sudo >/dev/null; then fail "$reason" "$how"; fi
    if [[ ! -t 0 ]] && ! sudo -n true; then fail "$reason" "$how"; fi
}

apt_get() {
    as_root env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=300 "$@"
}

# Refreshes the package lists. A source that fails is no reason to give up: what is needed may be in another.
apt_refresh() {
    say 'refreshing the package lists'
    apt_get update >&2 || say 'some package lists could not be refreshed (see above)'
}

# apt_install REASON SUITE PACKAGE...: installs packages, of the given suite if that is not empty. The package lists are
# refreshed only if apt cannot do it with those it has.
apt_install() {
    local reason=$1 suite=$2
    shift 2
    local options=(--yes --no-install-recommends)
    if [[ -n $suite ]]; then options+=(--target-release "$suite"); fi

    need_root "$reason" "$@"
    local root=directly
    if [[ $EUID -ne 0 ]]; then root='through sudo'; fi
    say "$reason"
    say "installing with apt, as root ($root): $*${suite:+ (from $suite)}"
    if apt-get --simulate "${options[@]}" install "$@" >/dev/null 2>&1 && apt_get "${options[@]}" install "$@" >&2; then
        return
    fi
    apt_refresh
    apt_get "${options[@]}" install "$@" >&2
}

# shellcheck shell=bash
# Functions that install packages on Debian and its derivatives. Sourced, not run. Every change of the system is announced.

# Exit code if a prerequisite is missing: EX_UNAVAILABLE of sysexits.h.
readonly EX_UNAVAILABLE=69

say() { printf 'setup: %s\n' "$*" >&2; }

# fail LINE...: prints the missing parts and how to get them, and ends the script.
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
    # Without a terminal the user cannot type a password, so sudo must work without one, or fail at once.
    elif [[ -t 0 ]]; then
        sudo "$@"
    else
        sudo -n "$@"
    fi
}

# need_root REASON PACKAGE...: if the script cannot become root, prints the command to run and ends.
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

# Refreshes the package lists. A failing source is not fatal, because another may have the packages.
apt_refresh() {
    say 'refreshing the package lists'
    apt_get update >&2 || say 'some package lists could not be refreshed (see above)'
}

# apt_install REASON SUITE PACKAGE...: installs packages, from SUITE if that is not empty. The package lists are refreshed
# only if the installation fails with the current ones.
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

# debian_source OWN SUITE: prints a deb822 source for another suite of Debian's archive, with the address and key of the machine's source for the
# suite OWN (an extended regular expression: 'bookworm', 'trixie|stable'). Other archives use the same suite names, so a source counts as Debian's
# archive only if its address contains 'debian', it has a component 'main', and it is not the security archive.
debian_source() {
    local own=$1 suite=$2 file found
    for file in /etc/apt/sources.list.d/*.sources; do
        if [[ ! -f $file ]]; then continue; fi
        # Copies the first paragraph with the suite OWN, including its key, and replaces the suite.
        found=$(grep -v '^#' "$file" | awk -v own="$own" -v suite="$suite" '
            BEGIN { RS = ""; FS = "\n" }
            /(^|\n)Enabled:[ \t]*no/ { next }
            !/(^|\n)Components:[^\n]*[ \t]main([ \t\n]|$)/ { next }
            !/(^|\n)URIs:[^\n]*debian/ || /(^|\n)URIs:[^\n]*debian-security/ { next }
            $0 ~ "(^|\n)Suites:[^\n]*[ \t](" own ")([ \t\n]|$)" {
                for (i = 1; i <= NF; i++) {
                    if ($i ~ /^Types:/) $i = "Types: deb"
                    if ($i ~ /^Suites:/) $i = "Suites: " suite
                    if ($i ~ /^Components:/) $i = "Components: main"
                    print $i
                }
                exit
            }')
        if [[ -n $found ]]; then
            printf '%s\n' "$found"
            return 0
        fi
    done
    for file in /etc/apt/sources.list /etc/apt/sources.list.d/*.list; do
        if [[ ! -f $file ]]; then continue; fi
        # The format of a line is: deb [options] URI suite components.
        found=$(sed -nE "s/^deb[[:space:]]+(\[([^]]*)\][[:space:]]+)?([^[:space:]]*debian[^[:space:]]*)[[:space:]]+($own)[[:space:]](.*[[:space:]])?main([[:space:]].*)?\$/\3 \2/p" "$file" |
            grep -v '^[^ ]*debian-security' | head -n 1) || continue
        if [[ -n $found ]]; then
            local uri=${found%% *} key
            key=$(sed -nE 's/.*signed-by=([^ ]+).*/\1/p' <<<"$found")
            printf 'Types: deb\nURIs: %s\nSuites: %s\nComponents: main\n' "$uri" "$suite"
            printf 'Signed-By: %s\n' "${key:-/usr/share/keyrings/debian-archive-keyring.gpg}"
            return 0
        fi
    done
    return 1
}

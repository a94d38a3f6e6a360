#!/usr/bin/env bash
# Ensures that a Vulkan driver works on this machine. If none does, installs Mesa's software driver (lavapipe) on Debian and
# its derivatives; on other systems it reports the missing packages. Exit code 69: no driver.
#
# On Debian 12 the driver comes from bookworm-backports, because the release's own (Mesa 22.3) draws only the first
# layer in multiview. If that suite is not among the apt sources, it is added as
# /etc/apt/sources.list.d/steradian-backports.sources, with the address and key of the existing Debian source. It stays, so
# that the driver keeps getting updates; apt installs nothing else from it, because backports have a low priority.
#
# To use another driver, set VK_DRIVER_FILES to its manifest. The script then only checks that it exists.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source scripts/lib/apt.sh

readonly BACKPORTS_FILE=/etc/apt/sources.list.d/steradian-backports.sources

# library_exists PATH MANIFEST: whether the loader will find a driver's library. A name without a slash is looked up as
# the dynamic linker does; a relative path counts from the manifest.
library_exists() {
    local path=$1 manifest=$2
    case $path in
    /*) [[ -e $path ]] ;;
    */*) [[ -e $(dirname "$manifest")/$path ]] ;;
    *) shared_library_exists "$path" ;;
    esac
}

# shared_library_exists NAME: whether the dynamic linker finds a library of this name.
shared_library_exists() {
    local name=$1 cache directory
    # ldconfig is in a folder that is often not in the PATH of ordinary users. Its output is stored first, because 'grep -q'
# at the end of a pipe would end ldconfig by a signal, which pipefail reports.
    cache=$(PATH=$PATH:/usr/sbin:/sbin ldconfig -p 2>/dev/null) || cache=
    if grep -qF "$name " <<<"$cache"; then return 0; fi
    local -a directories
    IFS=: read -ra directories <<<"${LD_LIBRARY_PATH-}"
    for directory in "${directories[@]}" /usr/lib64 /usr/lib /lib64 /lib; do
        if [[ -n $directory && -e $directory/$name ]]; then return 0; fi
    done
    return 1
}

# manifests: the driver manifests that the Vulkan loader reads, one per line ("Driver discovery on Linux" in its docs).
manifests() {
    local chosen=${VK_DRIVER_FILES:-${VK_ICD_FILENAMES-}} entry folder
    local -a entries
    if [[ -z $chosen ]]; then
        chosen=${XDG_CONFIG_HOME:-${HOME-}/.config}:${XDG_CONFIG_DIRS:-/etc/xdg}:/etc
        chosen+=:${XDG_DATA_HOME:-${HOME-}/.local/share}:${XDG_DATA_DIRS:-/usr/local/share:/usr/share}
        IFS=: read -ra entries <<<"$chosen"
        entries=("${entries[@]/%//vulkan/icd.d}")
    else
        IFS=: read -ra entries <<<"$chosen"
    fi
    for entry in "${entries[@]}"; do
        if [[ -d $entry ]]; then
            for folder in "$entry"/*.json; do
                if [[ -f $folder ]]; then printf '%s\n' "$folder"; fi
            done
        elif [[ -f $entry ]]; then
            printf '%s\n' "$entry"
        fi
    done
}

# render_node_of VENDOR...: whether this user may use a GPU of one of these PCI vendors, or of any vendor if none is given.
render_node_of() {
    local node vendor wanted
    for node in /dev/dri/renderD*; do
        if [[ ! -r $node || ! -w $node ]]; then continue; fi
        if [[ $# -eq 0 ]]; then return 0; fi
        vendor=$(cat "/sys/class/drm/${node##*/}/device/vendor" 2>/dev/null) || continue
        for wanted in "$@"; do
            if [[ $vendor == "$wanted" ]]; then return 0; fi
        done
    done
    return 1
}

# works LIBRARY: whether this machine has the hardware for a driver. Without it, a hardware driver offers no adapter.
works() {
    case ${1##*/} in
    *lvp* | *swiftshader*) return 0 ;;
    *nvidia*) compgen -G '/dev/nvidia[0-9]*' >/dev/null ;;
    *intel*) render_node_of 0x8086 ;;
    *radeon* | *amdvlk*) render_node_of 0x1002 ;;
    *nouveau*) render_node_of 0x10de ;;
    *dzn*) [[ -e /dev/dxg ]] ;;
    # Drivers of virtual machines: it cannot be determined here whether the host supports them.
    *virtio* | *gfxstream*) return 1 ;;
    *) render_node_of ;;
    esac
}

# find_driver: prints the manifest of a driver that works.
find_driver() {
    local manifest library
    if ! shared_library_exists libvulkan.so.1; then return 1; fi
    while IFS= read -r manifest; do
        library=$(sed -n 's/.*"library_path"[[:space:]]*:[[:space:]]*"\([^"]*\)".*/\1/p' "$manifest" | head -n 1)
        if [[ -z $library ]] || ! library_exists "$library" "$manifest"; then continue; fi
        if [[ -n ${VK_DRIVER_FILES:-${VK_ICD_FILENAMES-}} ]] || works "$library"; then
            printf '%s\n' "$manifest"
            return 0
        fi
    done < <(manifests)
    return 1
}

# apt_knows_backports: whether the suite is among the apt sources, in either format.
apt_knows_backports() {
    # With -q, grep succeeds on a match even if one of the two places does not exist.
    grep -rqsE --include='*.list' --include='*.sources' '^(deb|Suites:).*bookworm-backports' \
        /etc/apt/sources.list /etc/apt/sources.list.d
}

# ensure_backports: makes bookworm-backports available to apt, or reports the reason and returns 1.
ensure_backports() {
    local source
    if apt_knows_backports; then return 0; fi
    if ! source=$(debian_source bookworm bookworm-backports); then
        say 'no apt source for bookworm found, so the address of bookworm-backports is unknown'
        return 1
    fi
    say "adding $BACKPORTS_FILE for a driver newer than Debian 12's (remove the file if you do not want it)"
    printf '%s\n' "$source" | as_root tee "$BACKPORTS_FILE" >/dev/null
    # The exit code of the update also depends on other sources, so check whether the suite is available instead.
    apt_refresh
    if ! grep -q 'n=bookworm-backports' <<<"$(apt-cache policy)"; then
        say "bookworm-backports cannot be read from there: removing $BACKPORTS_FILE"
        as_root rm -f "$BACKPORTS_FILE"
        return 1
    fi
}

install_driver() {
    local reason='no working Vulkan driver was found (on a machine without a GPU: the software driver)'
    local packages=(libvulkan1 mesa-vulkan-drivers)
    need_root "$reason" "${packages[@]}"
    if [[ $(os_release ID) == debian && $(os_release VERSION_CODENAME) == bookworm ]]; then
        if ensure_backports && apt_install "$reason" bookworm-backports "${packages[@]}"; then return 0; fi
        say "falling back to the driver of Debian 12: correct, but multiview is not used with it"
    fi
    apt_install "$reason" '' "${packages[@]}"
}

if find_driver >/dev/null; then exit 0; fi
if [[ -n ${VK_DRIVER_FILES:-${VK_ICD_FILENAMES-}} ]]; then
    fail 'the Vulkan loader is missing, or the driver named by VK_DRIVER_FILES (or VK_ICD_FILENAMES):' \
        "  ${VK_DRIVER_FILES:-$VK_ICD_FILENAMES}"
fi
if ! has_apt; then
    fail 'no working Vulkan driver was found. Install the Vulkan loader and a driver:' \
        '  Fedora: dnf install vulkan-loader mesa-vulkan-drivers' \
        '  Arch: pacman -S vulkan-icd-loader vulkan-swrast' \
        '  Alpine: apk add vulkan-loader mesa-vulkan-swrast' \
        '  others: libvulkan.so.1 and the driver of your GPU, or lavapipe, the software driver of Mesa' \
        'A driver in an unusual place: set VK_DRIVER_FILES to its manifest.'
fi
install_driver || fail 'apt could not install libvulkan1 and mesa-vulkan-drivers (see above)'
driver=$(find_driver) || fail 'libvulkan1 and mesa-vulkan-drivers are installed, but no Vulkan driver works'
say "Vulkan driver: $driver"

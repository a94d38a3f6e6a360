#!/usr/bin/env bash
# Ensures that Monado, an OpenXR runtime that needs no headset, is unpacked in a folder of this user, and prints that
# folder. The headset tests start it there; it is not part of Steradian. Exit code 69: Monado is not available here.
#
# The packages come from Debian's suite trixie, with the address and key of the machine's Debian source. They are fetched
# and unpacked, not installed: the system does not change, including its apt state, and no root is needed. The C library
# is included, because the runtime needs a newer one than that of Debian 12. So both the service and a program that loads
# the runtime are started through the dynamic linker unpacked here: see runtime.json in the folder.
#
# The folder (150 MB to fetch, 550 MB on disk) is outside of the build folder, so that all checkouts share it:
# ~/.cache/steradian/monado-N, or STERADIAN_MONADO_DIR. To fetch again, remove it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source scripts/lib/apt.sh

# Version number of this script, which is part of the folder's name. Increase it with every change of the folder's contents.
readonly RECIPE=1
readonly SUITE=trixie
readonly LIBRARIES=/usr/lib/x86_64-linux-gnu
readonly PACKAGES=(
    libopenxr1-monado monado-cli libopenxr-loader1 openxr-layer-corevalidation
    libvulkan1 mesa-vulkan-drivers libblas3 liblapack3
)
# Dependencies of the packages above that the runtime does not need: apt treats them as installed.
readonly NEEDLESS=(
    adduser debconf fontconfig-config gdal-data gdal-plugins gnupg iso-codes libglx-mesa0 libpam-modules lsb-base
    mariadb-common openssl-provider-legacy passwd proj-data readline-common sysvinit-utils unixodbc-common x11-common
    xkb-data
)

# write_status FILE: writes apt's list of installed packages. It contains the unneeded packages, in a version that satisfies every dependency.
write_status() {
    local package
    for package in "${NEEDLESS[@]}"; do
        printf 'Package: %s\nStatus: install ok installed\nVersion: 999:0\nArchitecture: amd64\n' "$package"
        printf 'Multi-Arch: foreign\nMaintainer: none\nDescription: not wanted\n\n'
    done >"$1"
}

# write_apt_configuration FOLDER: configures apt to use only FOLDER. It keeps the machine's settings for fetching (proxies, time limits), but not its
# hooks, which would change the system.
write_apt_configuration() {
    local folder=$1
    apt-config dump | grep '^Acquire::' >"$folder/apt.conf" || true
    cat >>"$folder/apt.conf" <<CONFIGURATION
Dir::Etc::main "/dev/null";
Dir::Etc::parts "/dev/null";
Dir::Etc::sourcelist "$folder/debian.sources";
Dir::Etc::sourceparts "/dev/null";
Dir::Etc::preferences "/dev/null";
Dir::Etc::preferencesparts "/dev/null";
Dir::State "$folder";
Dir::State::lists "$folder/lists";
Dir::State::status "$folder/status";
Dir::Cache "$folder/cache";
Dir::Log "$folder/log";
APT::Architecture "amd64";
APT::Architectures "amd64";
APT::Install-Recommends "false";
APT::Sandbox::User "";
APT::Update::Error-Mode "any";
Acquire::Retries "3";
Debug::NoLocking "true";
CONFIGURATION
}

# fetch FOLDER: downloads the packages and their dependencies to FOLDER/cache/archives.
fetch() {
    local folder=$1 own
    own=$(os_release VERSION_CODENAME)
    own="${own:+$own|}trixie|stable|testing|sid|unstable"
    mkdir -p "$folder"/{lists/partial,cache/archives/partial,log}
    write_status "$folder/status"
    write_apt_configuration "$folder"
    if ! debian_source "$own" "$SUITE" >"$folder/debian.sources"; then
        fail "no apt source of Debian found, so the address of its suite $SUITE is unknown"
    fi
    # Fetch only the package lists, not the lists of files, descriptions or icons.
    printf 'Targets: Packages\n' >>"$folder/debian.sources"

    say "reading the package lists of Debian $SUITE"
    APT_CONFIG=$folder/apt.conf apt-get --quiet update >&2 ||
        fail "the package lists of Debian $SUITE cannot be read (no network? see above)"
    say "fetching Monado and its dependencies from Debian $SUITE (about 150 MB)"
    APT_CONFIG=$folder/apt.conf apt-get --quiet=2 --yes --download-only install "${PACKAGES[@]}" >&2 ||
        fail "the packages of Monado cannot be fetched from Debian $SUITE (see above)"
}

# unpack FOLDER ROOT: unpacks the fetched packages without documentation and translations.
unpack() {
    local folder=$1 root=$2 package
    mkdir -p "$root"
    say "unpacking Monado to $root"
    for package in "$folder"/cache/archives/*.deb; do
        dpkg-deb --fsys-tarfile "$package" | tar --extract --directory "$root" --keep-directory-symlink \
            --no-same-owner --no-same-permissions --exclude './usr/share/doc' --exclude './usr/share/man' \
            --exclude './usr/share/locale' --exclude './usr/share/i18n' ||
            fail "${package##*/} cannot be unpacked (no space left? see above)"
    done
}

# library_of MANIFEST: prints the library named by the manifest of a driver, a runtime or a layer.
library_of() { sed -nE 's/.*"library_path"[[:space:]]*:[[:space:]]*"([^"]*)".*/\1/p' "$1" | head -n 1; }

# absolute_manifest MANIFEST ROOT TARGET: copies a manifest, with the absolute path of its library below ROOT.
absolute_manifest() {
    local manifest=$1 root=$2 target=$3 library
    library=$(library_of "$manifest")
    # A bare name is one that the dynamic linker looks up: the library is in this folder.
    if [[ $library != /* ]]; then library=$LIBRARIES/$library; fi
    if [[ ! -f $root$library ]]; then fail "$manifest names a missing library: $library"; fi
    sed -E "s|(\"library_path\"[[:space:]]*:[[:space:]]*\")[^\"]*|\1$root$library|" "$manifest" >"$target"
}

# only PATTERN: prints the one file that matches.
only() {
    local -a files
    mapfile -t files < <(compgen -G "$1")
    if [[ ${#files[@]} -ne 1 ]]; then fail "one file expected, ${#files[@]} found: $1"; fi
    printf '%s\n' "${files[0]}"
}

# describe DIR: writes the manifests and runtime.json for the files in DIR/root.
describe() {
    local dir=$1 root=$1/root libraries=$1/root$LIBRARIES
    local linker=$libraries/ld-linux-x86-64.so.2 driver runtime layer
    # On an installed system, the alternatives and the run paths of the packages name these folders.
    local path=$libraries:$root/usr/lib:$libraries/blas:$libraries/lapack:$libraries/pulseaudio
    mkdir -p "$dir/manifests/layers"
    driver=$(only "$root/usr/share/vulkan/icd.d/lvp_icd*.json")
    runtime=$(only "$root/usr/share/openxr/1/openxr_monado*.json")
    layer=$(only "$root/usr/share/openxr/1/api_layers/explicit.d/*core_validation*.json")
    absolute_manifest "$driver" "$root" "$dir/manifests/lvp_icd.json"
    absolute_manifest "$runtime" "$root" "$dir/manifests/openxr_monado.json"
    absolute_manifest "$layer" "$root" "$dir/manifests/layers/${layer##*/}"

    # Check now that each part finds all of its libraries; otherwise it would fail in the middle of a test.
    local part missing
    for part in "$root/usr/bin/monado-service" "$root/usr/bin/monado-ctl" "$libraries/libopenxr_loader.so.1" \
        "$libraries/libvulkan.so.1" "$(library_of "$dir/manifests/openxr_monado.json")" \
        "$(library_of "$dir/manifests/lvp_icd.json")" "$(library_of "$dir/manifests/layers/${layer##*/}")"; do
        missing=$("$linker" --library-path "$path" --list "$part" 2>&1) || fail "$part does not load: $missing"
        if grep -q 'not found' <<<"$missing"; then
            fail "$part lacks libraries: $(sed -n 's/^[[:space:]]*\(.*\) => not found.*/\1/p' <<<"$missing" | tr '\n' ' ')"
        fi
    done

    # Steradian's tests read this file. It is renamed to its final name last, so that it exists only if all files that it names exist.
    cat >"$dir/runtime.json.part" <<RUNTIME
{
    "recipe": $RECIPE,
    "folder": "$dir",
    "linker": "$linker",
    "library_path": "$path",
    "service": "$root/usr/bin/monado-service",
    "control": "$root/usr/bin/monado-ctl",
    "openxr_runtime": "$dir/manifests/openxr_monado.json",
    "openxr_loader": "$libraries/libopenxr_loader.so.1",
    "openxr_layers": "$dir/manifests/layers",
    "vulkan_driver": "$dir/manifests/lvp_icd.json",
    "vulkan_loader": "$libraries/libvulkan.so.1"
}
RUNTIME
    mv "$dir/runtime.json.part" "$dir/runtime.json"
}

# complete DIR: whether everything exists at the paths in its manifests.
complete() {
    [[ -f $1/runtime.json ]] && grep -qF "\"recipe\": $RECIPE," "$1/runtime.json" &&
        grep -qF "\"folder\": \"$1\"," "$1/runtime.json"
}

if [[ -n ${STERADIAN_MONADO_DIR-} ]]; then
    dir=$STERADIAN_MONADO_DIR
elif [[ -n ${XDG_CACHE_HOME:-${HOME-}} ]]; then
    dir=${XDG_CACHE_HOME:-$HOME/.cache}/steradian/monado-$RECIPE
else
    dir=${CARGO_TARGET_DIR:-target}/monado-$RECIPE
fi
mkdir -p "$dir" 2>/dev/null || fail "the folder for Monado cannot be created: $dir"
dir=$(realpath "$dir")
# The folder's name is part of manifests and library paths, in which these characters cannot be quoted.
case $dir in
*[\"\\:\|\&]* | *$'\n'*) fail "the folder for Monado must have no quote, backslash, colon, | or & in its name: $dir" ;;
esac

if ! complete "$dir"; then
    # Partial results are removed below. If the user named a folder with other contents by mistake, those must not be removed.
    if [[ ! -e $dir/monado.lock && -n $(ls -A "$dir") ]]; then
        fail "the folder for Monado must be new or empty: $dir"
    fi
    if [[ $(uname -s)-$(uname -m) != Linux-x86_64 ]]; then
        fail "Monado can be fetched for Linux on x86-64 only, not for $(uname -s) on $(uname -m)"
    fi
    for tool in apt-get apt-config dpkg-deb tar flock; do
        command -v "$tool" >/dev/null || fail "fetching Monado needs the tools of Debian, and $tool is missing"
    done
    # Only one run at a time does this: a second one waits, and then finds the result. The lock ends with the script.
    if [[ ! -w $dir ]]; then fail "the folder for Monado is not writable: $dir"; fi
    exec 9>>"$dir/monado.lock"
    if ! flock --nonblock 9; then
        say "waiting for another run that is fetching Monado to $dir"
        flock 9
    fi
    if ! complete "$dir"; then
        rm -rf "$dir"/{apt,root,manifests,runtime.json}
        fetch "$dir/apt"
        unpack "$dir/apt" "$dir/root"
        rm -rf "$dir/apt"
        describe "$dir"
        say "Monado is ready in $dir"
    fi
fi
printf '%s\n' "$dir"

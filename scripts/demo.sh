#!/usr/bin/env bash
# Starts the daemon on a free port, lets a client move the camera over gRPC while frames stream back, and writes a dome, a
# stereo pair, a cubemap and an equirectangular picture to out/, as PNG and as EXR (cd/m^2). Prints the adapter, the number of stars, the time per
# view, and the error of the light in the pictures. `make demo` builds the programs first.
#
# Usage: scripts/demo.sh [CONFIG [FOLDER]]. Exit code 0: all steps succeeded, and the light is correct to 1e-3.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly config=${1:-configs/demo.toml} out=${2:-out}
readonly bin=${CARGO_TARGET_DIR:-target}/release
# The daemon loads its stars before it listens. With a large catalogue on a slow machine this takes long.
readonly start_timeout_s=300 stop_timeout_s=60

for program in "$bin/steradian" "$bin/examples/client" "$bin/examples/flux"; do
    if [[ ! -x $program ]]; then
        printf 'demo: %s does not exist: run make demo, which builds it\n' "$program" >&2
        exit 1
    fi
done

scratch=$(mktemp -d)
daemon=
clean_up() {
    if [[ -n $daemon ]] && kill -0 "$daemon" 2>/dev/null; then
        kill -KILL "$daemon" 2>/dev/null || true
        wait "$daemon" 2>/dev/null || true
    fi
    rm -rf "$scratch"
}
trap clean_up EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

# fail MESSAGE: prints the message and the log of the daemon, and ends the script.
fail() {
    printf 'demo: %s\n' "$1" >&2
    if [[ -s $scratch/log ]]; then sed 's/^/daemon: /' "$scratch/log" >&2; fi
    exit 1
}

"$bin/steradian" serve --config "$config" --listen 127.0.0.1:0 >"$scratch/stdout" 2>"$scratch/log" &
daemon=$!

address=
deadline=$((SECONDS + start_timeout_s))
while [[ -z $address ]]; do
    address=$(sed -n 's/^listening on \(.*\)$/\1/p' "$scratch/stdout")
    if [[ -n $address ]]; then break; fi
    if ! kill -0 "$daemon" 2>/dev/null; then
        code=0
        wait "$daemon" || code=$?
        daemon=
        cat "$scratch/log" >&2
        printf 'demo: the daemon ended with code %s before it listened\n' "$code" >&2
        exit "$((code == 0 ? 1 : code))"
    fi
    if ((SECONDS >= deadline)); then fail "the daemon did not listen within $start_timeout_s s"; fi
    sleep 0.1
done
printf 'daemon      listening on %s\n' "$address"

mkdir -p "$out"
"$bin/examples/client" --connect "http://$address" --out "$out" --steps 60 || fail 'the client failed'

kill -TERM "$daemon"
deadline=$((SECONDS + stop_timeout_s))
while kill -0 "$daemon" 2>/dev/null; do
    if ((SECONDS >= deadline)); then fail "the daemon did not end within $stop_timeout_s s of SIGTERM"; fi
    sleep 0.1
done
code=0
wait "$daemon" || code=$?
daemon=
if ((code != 0)); then fail "the daemon ended with code $code after SIGTERM"; fi
printf 'daemon      drained and ended with code 0\n'

# The example reports its own errors: wrong light, or a configuration without a view of the whole sky to measure.
"$bin/examples/flux" --config "$config" --pictures "$out"

#!/usr/bin/env bash
# Counts the instructions of ten reference frames with callgrind, and reports those that have grown by more than 10 % since
# benches/instruction_counts.csv was recorded. With --record it records the counts instead. Installs valgrind if possible, and takes at most three
# minutes.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if ! command -v valgrind >/dev/null && [[ $(id -u) == 0 ]] && command -v apt-get >/dev/null; then
    apt-get install --yes --no-install-recommends valgrind >/dev/null 2>&1 || true
fi
if ! command -v valgrind >/dev/null; then
    echo 'ci: instruction counts: not compared, valgrind is not installed' >&2
    exit 0
fi
# Do not use `cargo bench`: this build shares the compiled library with the tests.
program=$(cargo build --release --bench instruction_counts --message-format=json |
    sed -n 's/.*"name":"instruction_counts".*"executable":"\([^"]*\)".*/\1/p' | tail -n 1)
code=0
timeout "${STERADIAN_COUNT_SECONDS:-170}" "$program" "$@" >&2 || code=$?
if ((code == 124)); then
    echo "ci: instruction counts: not compared, the time of ${STERADIAN_COUNT_SECONDS:-170} s is used up" >&2
    exit 0
fi
exit "$code"

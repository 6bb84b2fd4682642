#!/usr/bin/env bash
# The loop with the emulator over shared memory, with virtual EtherCAT drives over a veth pair and with virtual moteus drives over
# pseudo-terminals, one after the other in one go, beside cyclictest under the same load: exchange, lateness, lost samples, and where
# the drives' clock wants the loop. As root, in a network namespace of its own.
#
#   benches/drives.sh SECONDS [FLEXSPLINE]
set -euo pipefail
seconds="${1:?how many seconds for each case}"
program="$(realpath "${2:-target/release/flexspline}")"
if [ -z "${FLEXSPLINE_DRIVES_INSIDE:-}" ]; then
    exec env FLEXSPLINE_DRIVES_INSIDE=1 unshare -n "$0" "$seconds" "$program"
fi
ip link add veth0 type veth peer name veth1
ip link set veth0 up
ip link set veth1 up
folder="$(mktemp -d)"
drives=""
trap '[ -z "$drives" ] || kill "$drives" 2>/dev/null; rm -rf "$folder"' EXIT
here="$(dirname "$(realpath "$0")")"
shipped="$here/../robots"

# Robots with the tables of their virtual drives: the PA-10, and twelve joints of the SHD-17 kind.
python3 "$here/drives_robots.py" "$shipped" "$folder"

stolen() { awk '/^cpu /{ print $2+$3+$4+$6+$7+$8, $9, $2+$3+$4+$5+$6+$7+$8+$9 }' /proc/stat; }

# measure NAME RUN-ARGUMENTS...
measure() {
    local name="$1"
    shift
    local before after
    before="$(stolen)"
    "$program" run --instance drives-bench --duration "${seconds}s" --json "$folder/$name.json" \
        --record "$folder/$name.mcap" "$@" >"$folder/$name.txt" 2>&1 ||
        echo "$name: $(tail -1 "$folder/$name.txt")" >&2
    after="$(stolen)"
    echo "$before $after" >"$folder/$name.stat"
}

ethercat() {
    chrt -f 70 "$program" drives emulate ethercat --interface veth1 --clock-error 50 --robot "$2" --rate 1500 >/dev/null &
    drives=$!
    sleep 2
    measure "$1" --driver ethercat --robot "$2" --rate 1500
    kill "$drives"
    wait "$drives" || true
    drives=""
    sleep 1
}

moteus() {
    chrt -f 70 "$program" drives emulate moteus --robot "$2" --buses 4 --link "$folder/port" >/dev/null &
    drives=$!
    sleep 2
    measure "$1" --driver moteus --robot "$2" --rate 1500
    kill "$drives"
    wait "$drives" || true
    drives=""
}

if command -v cyclictest >/dev/null; then
    cyclictest --mlockall --priority=80 --interval=667 --histogram=100000 --quiet --duration="$seconds" \
        >"$folder/cyclictest.hist"
else
    echo "no cyclictest (Debian: rt-tests): its row is left out" >&2
fi
measure emulator --robot pa10 --rate 1500
ethercat ethercat-7 "$folder/pa10-ethercat.toml"
ethercat ethercat-12 "$folder/twelve-ethercat.toml"
moteus moteus-7 "$folder/pa10-moteus.toml"
python3 "$here/drives_table.py" "$folder"

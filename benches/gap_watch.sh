#!/bin/sh
# How soon `flexspline gap watch` tells of a gap: every effect of examples/gap-round.toml, each on its own and from 30 s on.
#
#   benches/gap_watch.sh target/release/flexspline 31 32 33
#
# Virtual time; prints what was told first for each effect and seed, or that nothing was told by 50 s.
set -eu
flexspline=$1
shift
examples=$(dirname "$0")/../examples
folder=$(mktemp -d)
trap 'rm -r "$folder"' EXIT
awk -v folder="$folder" '
    /^\[\[effect\]\]/ { n++; file = sprintf("%s/%02d.toml", folder, n); print > file; print "start_s = 30.0" > file; next }
    n { print > file }
' "$examples/gap-round.toml"
for file in "$folder"/*.toml; do
    effect=$(sed -n 's/^effect = "\(.*\)"/\1/p' "$file")
    for seed in "$@"; do
        told=$("$flexspline" gap watch --robot "$examples/bench.toml" --emulate 50s --seed "$seed" --inject "$file" |
            grep -m 1 'a gap appeared' || echo 'nothing')
        echo "$effect, seed $seed: $told"
    done
done

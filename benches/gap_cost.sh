#!/usr/bin/env bash
# What `flexspline gap diagnose` costs over the number of joints and over the length of the recording.
#
#   benches/gap_cost.sh target/release/flexspline
#
# The first 1, 2, 3, 5 and 7 joints of the PA-10, each an arm of its own, along 30 s of multi_sine at 1.5 kHz, and three joints
# along 15, 30, 60 and 120 s. What is recorded is the robot file's own model, with the damping of the plant file's gears: without
# it they flutter. So there is no gap, and the same work for all; a joint that is told one all the same is counted, since it costs
# more. Prints processor seconds (both cores), those per joint and 30 s, and, where GNU time is installed, the most memory held.
set -euo pipefail
flexspline=$1
robots=$(dirname "$0")/../robots
folder=$(mktemp -d)
trap 'rm -r "$folder"' EXIT

# The PA-10 with its first joints only, and the damping of their gears.
arm() {
    awk -v most="$1" '
        /structural_damping/ && FILENAME ~ /plant/ {
            if (match($0, /{.*}/)) damping[++dampings] = substr($0, RSTART, RLENGTH)
        }
        FILENAME ~ /plant/ { next }
        /^effects = / { sub(/ }]/, " }, " damping[joints] "]") }
        /^name = "pa10"/ { print "name = \"arm\""; next }
        /^(proportional|derivative)_/ {
            split($0, sides, /[][]/); split(sides[2], gains, ", "); line = gains[1]
            for (k = 2; k <= most; k++) line = line ", " gains[k]
            print sides[1] "[" line "]"; next
        }
        /^\[\[link\]\]/ { left_out = ++links > most }
        /^\[\[joint\]\]/ { left_out = ++joints > most }
        !left_out { print }
    ' "$robots/pa10.plant.toml" "$robots/pa10.toml"
}

memory=$(type -P time || true)
printf '%-7s %-4s %-12s %-22s %-12s %s\n' joints s 'processor, s' 'per joint and 30 s, s' 'memory, MiB' 'joints with a gap'
cost() {
    local joints=$1 seconds=$2 robot=$folder/arm$1.toml
    arm "$joints" > "$robot"
    "$flexspline" run --mode lockstep --robot "$robot" --trajectory multi_sine --duration "${seconds}s" --estimators residual \
        --record "$folder/run.mcap" > "$folder/run.txt"
    "$flexspline" recording simulate "$folder/run.mcap" --robot "$robot" --out "$folder/nominal.mcap" > "$folder/run.txt"
    local diagnose=("$flexspline" gap diagnose --robot "$robot" --recording "$folder/nominal.mcap" --out "$folder/gap")
    TIMEFORMAT='%U %S'
    { time "${diagnose[@]}" > "$folder/told.txt"; } 2> "$folder/time.txt"
    local held=-
    if [ -n "$memory" ]; then
        "$memory" -f %M -o "$folder/memory.txt" "${diagnose[@]}" > "$folder/told.txt"
        held=$(awk '{ printf "%.0f", $1 / 1024 }' "$folder/memory.txt")
    fi
    local told
    told=$(grep -c -E '^ joint[0-9]' "$folder/told.txt")
    told=$((told - $(grep -c -E '^ joint[0-9].* no gap ' "$folder/told.txt" || true)))
    awk -v joints="$joints" -v seconds="$seconds" -v held="$held" -v told="$told" '
        {
            sum = $1 + $2
            printf "%-7d %-4d %-12.1f %-22.2f %-12s %d\n", joints, seconds, sum, sum * 30 / (joints * seconds), held, told
        }
    ' "$folder/time.txt"
}

for joints in 1 2 3 5 7; do cost "$joints" 30; done
for seconds in 15 60 120; do cost 3 "$seconds"; done

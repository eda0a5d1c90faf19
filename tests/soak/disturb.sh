#!/usr/bin/env bash
# Disturbs a small campaign for a long time, and checks that no run is lost and no bit changed.
#
#   tests/soak/disturb.sh [SECONDS] [SEED]        by default an hour, and a seed that is told
#
# Each round starts the campaign again and again on one folder of results, and disturbs every start in one way: kill -9 of
# the program, of a worker or of both, SIGINT, SIGTERM, a stop of some seconds, too few open files, files that may not grow,
# and, where strace is there, system calls that fail. Then `verify` finishes what is left and compares every row and every
# policy with an undisturbed record, to the bit. Exits with 1 at the first difference, and keeps the folder.
set -u -o pipefail
seconds=${1:-3600}; seed=${2:-$RANDOM}; RANDOM=$seed
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
program=${PROGRAM:-$root/target/release/mcpo-run}
work=$(mktemp -d); cd "$work" || exit 1
unset MCPO_RESULTS

cat > tiny.toml <<'TOML'
name = "tiny"
budget.env_steps = 32_768
rollout.steps = 256
network.hidden = [8]
evaluation = { every = 4096, episodes = 1, final_episodes = 2 }
checkpoint.every_seconds = 0.02
algorithms.ppo.minibatch = 64

[[matrix]]
seed = [0, 1]
env = ["InvertedPendulum-v2", "MountainCarContinuous-v0"]
algorithm = ["ppo"]
TOML
echo "seed $seed, $seconds s, in $work"
"$program" verify tiny.toml --against record --record --quiet || exit 1

calls=(openat write fsync rename unlink flock mkdir clone3)
errors=(EIO ENOSPC EMFILE ENOMEM EACCES)
ways=(program worker both INT TERM pause files size)
command -v strace > /dev/null && ways+=(call call call)

# Starts the campaign and disturbs it in the way $1; the program's own exit code says nothing here.
disturb() {
    local way=$1 before=()
    case $way in
        files) ulimit -S -n $((8 + RANDOM % 40)) ;;
        size) ulimit -S -f $((1 + RANDOM % 64)); trap '' XFSZ ;;
        call)
            local call=${calls[RANDOM % ${#calls[@]}]} error=${errors[RANDOM % ${#errors[@]}]}
            before=(strace -f --seccomp-bpf -qq -o /dev/null -e "trace=$call"
                -e "inject=$call:error=$error:when=$((1 + RANDOM % 400))+$((1 + RANDOM % 50))") ;;
    esac
    timeout -s INT -k 10 20 "${before[@]}" "$program" tiny.toml --results results --jobs 2 --quiet > /dev/null 2> last-stderr &
    local guard=$!
    sleep "0.$(printf %03d $((RANDOM % 900)))"
    local main workers=
    main=$(pgrep -P $guard | head -1)
    [[ -n $main ]] && workers=$(pgrep -P "$main" | head -2)
    [[ -n $workers ]] && case $way in
        program) kill -9 $main ;;
        worker) kill -9 ${workers%%$'\n'*} ;;
        both) kill -9 $main $workers ;;
        INT | TERM) kill -s "$way" $main ;;
        pause) kill -STOP $main $workers; sleep 2; kill -CONT $main $workers ;;
    esac 2> /dev/null
    wait $guard
    # Workers whose program was killed write a checkpoint and go.
    for worker in $workers; do while kill -0 "$worker" 2> /dev/null; do sleep 0.05; done; done
}

end=$((SECONDS + seconds)); rounds=0; disturbances=0
while ((SECONDS < end)); do
    rm -rf results
    for ((n = 2 + RANDOM % 8; n > 0; n--)); do
        way=${ways[RANDOM % ${#ways[@]}]}
        (disturb "$way") 2> /dev/null
        disturbances=$((disturbances + 1))
        if grep -q "panicked" last-stderr; then
            echo "a panic after '$way'; see $work/last-stderr"; exit 1
        fi
    done
    if ! said=$("$program" verify tiny.toml --against record --results results --quiet 2>&1) || [[ $said != *"to the bit"* ]]; then
        printf '%s\nafter %s, the last of them %s; kept in %s\n' "$said" "$disturbances disturbances" "$way" "$work"; exit 1
    fi
    leftovers=$(find results -name '.writing-*' -o -name '*.partial' -o -name heartbeat.json | grep -v /report/)
    if [[ -n $leftovers ]]; then
        printf 'left behind:\n%s\nkept in %s\n' "$leftovers" "$work"; exit 1
    fi
    rounds=$((rounds + 1))
    echo "$rounds rounds, $disturbances disturbances: as recorded, to the bit"
done
rm -rf "$work"

#!/usr/bin/env bash
# The texture of one mesh on many others, by several workers on this machine under GNU parallel. Each takes one shard of the targets;
# what is done is not made again, so that it may be run again after an interrupt.
#
#   bash examples/batch_parallel.sh WORKERS OUT_DIR [arguments of barymap batch but -o and --shard]
#
# BARYMAP=PROGRAM names another program than `barymap`. What the workers say and report goes to OUT_DIR/.workers, the whole to OUT_DIR/report.json.
# Other schedulers do the same with their own number of a task, Slurm for example:
#   barymap batch ... --shard $((SLURM_ARRAY_TASK_ID + 1))/$SLURM_ARRAY_TASK_COUNT
set -euo pipefail

if [ $# -lt 4 ]; then
    sed -n '2,9s/^# \{0,1\}//p' "$0" >&2
    exit 2
fi
workers=$1 out=$2
shift 2
command -v parallel >/dev/null || { echo "GNU parallel is not installed (Debian, Ubuntu: apt-get install parallel)" >&2; exit 2; }
mkdir -p "$out/.workers"

# More shards than workers, so that a worker that is done early takes another. The workers share the cores.
shards=$((workers * 4))
export RAYON_NUM_THREADS=${RAYON_NUM_THREADS:-$(($(nproc) > workers ? $(nproc) / workers : 1))}
# A shard with a failed target fails; the last step says which.
parallel --will-cite --jobs "$workers" --results "$out/.workers" \
    "${BARYMAP:-barymap}" batch --quiet -o "$out" --shard "{}/$shards" --report "$out/.workers/shard_{}.json" "$@" \
    ::: $(seq "$shards") >/dev/null 2>&1 || true

# One more run, over all: it passes over what is done, tells what failed, and writes one report of everything.
"${BARYMAP:-barymap}" batch -o "$out" --report "$out/report.json" "$@"

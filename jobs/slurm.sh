#!/usr/bin/env bash
# jobs/slurm.sh SCENE BASE [FLAGS of ppm-vk...]: renders BASE.FRAME.exr on Slurm. Each frame is an array job, one task for each part,
# and a merge that waits for it. Settings by environment:
#   PARTS=4   parts of a frame: N parts of n iterations have the noise of one render of N·n
#   FRAMES=0  frames, such as '1 2 3' or "$(seq 1 24)"
#   FPS=24    frames per second of the file's animations
# The partition, time limit and so on by sbatch's own: SBATCH_PARTITION, SBATCH_TIMELIMIT, SBATCH_GPUS... (man sbatch). BASE's folder
# is common to all nodes, and ppm-vk is in the PATH. docs/farm.md has more.
#SBATCH --job-name=ppm-vk
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --signal=B:USR1@120
set -euo pipefail

# FRAME: where its files are.
base_of() { printf '%s.%04d' "$base" "$1"; }

submit() {
    base=$(realpath -m -- "$2")
    local scene parts=${PARTS:-4} fps=${FPS:-24} frame time job
    scene=$(realpath -- "$1")
    shift 2
    mkdir -p "$(dirname "$base")"
    for frame in ${FRAMES:-0}; do
        time=$(LC_ALL=C awk -v frame="$frame" -v fps="$fps" 'BEGIN { printf "%.17g", frame / fps }')
        job=$(sbatch --parsable --array="1-$parts" --output="$(base_of "$frame").part%a.log" "${BASH_SOURCE[0]}" \
            --task "$(base_of "$frame")" "$parts" --scene "$scene" --frame-time "$time" "$@")
        # With a cluster's name after a semicolon, where there are several.
        sbatch --parsable --dependency="afterok:${job%%;*}" --kill-on-invalid-dep=yes --output="$(base_of "$frame").merge.log" \
            "${BASH_SOURCE[0]}" --merge "$(base_of "$frame")" "$parts"
    done
}

# One part. Slurm ends tasks by force; with --resume the next run goes on from the state.
render() {
    local base=$1 parts=$2 part=$SLURM_ARRAY_TASK_ID program
    shift 2
    ppm-vk "$@" --part "$part/$parts" --state "$base.part$part.state" --resume -o "$base.part$part.exr" --quiet &
    program=$!
    # USR1: two minutes before the time limit. The task is queued again and goes on.
    trap 'kill -TERM "$program"; wait "$program" || true; scontrol requeue "${SLURM_ARRAY_JOB_ID}_$part"; exit 1' USR1
    trap 'kill -TERM "$program"; wait "$program" || exit $?' TERM
    wait "$program"
}

merge() {
    local base=$1 parts=$2 part states=()
    for ((part = 1; part <= parts; part++)); do states+=("$base.part$part.state"); done
    exec ppm-vk merge "${states[@]}" -o "$base.exr" --png "$base.png"
}

case ${1:-} in
--task) render "${@:2}" ;;
--merge) merge "${@:2}" ;;
'' | -*) sed -n '2,/^#SBATCH/{/^# /s/^# //p}' "${BASH_SOURCE[0]}" >&2; exit 2 ;;
*) (($# >= 2)) || { echo 'slurm.sh: SCENE and BASE are needed' >&2; exit 2; }; submit "$@" ;;
esac

#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# A frame of a scene as an array of Slurm: a task for each block of samples, then the picture.
#
#   SCENE=shot.usda FOLDER=/shared/shot FRAME=7 SAMPLES=1024 BLOCKS=16 sh slurm_array.sh
#
# CAMERA, WIDTH, OUT, CACHES, FLAGS (of usdrecord) and SBATCH (flags of sbatch, such as "--gres=gpu:1") are optional, and
# RETRIES, how often a task is queued again.
# A task that is preempted, or runs out of time, gets SIGTERM 60 s before it is killed: it writes what it has, is queued
# again, and goes on from there. So does one whose node fails, from its last octave of samples.
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --signal=B:TERM@60
set -eu
here=$(dirname -- "$(readlink -f -- "$0")")
farm=${OOCPT_FARM:-$here/oocpt_farm.py}
: "${SCENE:?}" "${FOLDER:?}" "${FRAME:?}" "${SAMPLES:?}" "${BLOCKS:?}"
OUT=${OUT:-$FOLDER/frame.%04d.exr}
kept="--folder=$FOLDER --frame=$FRAME --samples=$SAMPLES --blocks=$BLOCKS"

if [ -z "${SLURM_JOB_ID:-}" ]; then
    export SCENE FOLDER FRAME SAMPLES BLOCKS OUT
    export OOCPT_FARM="$farm"
    # shellcheck disable=SC2086 # flags are words
    array=$(sbatch --parsable ${SBATCH:-} --array="1-$BLOCKS" "$0")
    # shellcheck disable=SC2086
    sbatch --parsable ${SBATCH:-} --dependency="afterok:${array%%;*}" "$0"
    exit
fi
if [ -z "${SLURM_ARRAY_TASK_ID:-}" ]; then
    # shellcheck disable=SC2086
    exec python3 "$farm" picture $kept "--out=$OUT"
fi
# shellcheck disable=SC2086
python3 "$farm" part $kept "--scene=$SCENE" "--block=$SLURM_ARRAY_TASK_ID" "--camera=${CAMERA:-}" \
    "--width=${WIDTH:-960}" "--caches=${CACHES:-}" -- ${FLAGS:-} &
task=$!
trap 'kill -TERM $task' TERM INT
status=0
wait $task || status=$?
# The trap interrupts the first wait.
if kill -0 $task 2>/dev/null; then
    status=0
    wait $task || status=$?
fi
# 75 asks for it; above 128 a signal ended the task, such as that of a machine without memory.
if { [ $status -eq 75 ] || [ $status -gt 128 ]; } && [ "${SLURM_RESTART_COUNT:-0}" -lt "${RETRIES:-100}" ]; then
    scontrol requeue "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID"
fi
exit $status

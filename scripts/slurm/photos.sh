#!/usr/bin/env bash
# Estimates many photos in an array job; docs/cluster.md explains it.
#
#   sbatch --array=1-16 scripts/slurm/photos.sh PHOTOS SCENES [OPTION…]
#
# PHOTOS is a folder and SCENES the output folder, both on a file system that all nodes share; options are those of
# `lightoctree batch`. Submit the same job again to continue after failures: finished photos are kept.
#SBATCH --job-name=lightoctree
#SBATCH --cpus-per-task=4
#SBATCH --mem-per-cpu=1G
#SBATCH --time=04:00:00
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=lightoctree-%A_%a.log
# Stops after the current photos a minute before the time limit.
#SBATCH --signal=INT@60
set -euo pipefail

if [ $# -lt 2 ]; then
  echo "usage: sbatch --array=1-N $0 PHOTOS SCENES [OPTION…]" >&2
  exit 2
fi
photos=$1 scenes=$2
shift 2
if [ -z "${PARTS:-}" ] && [ "$SLURM_ARRAY_TASK_COUNT" -ne "$SLURM_ARRAY_TASK_MAX" ]; then
  echo "the array is not 1-N; set PARTS to the number of parts, for example sbatch --export=ALL,PARTS=16" >&2
  exit 2
fi
# `srun` passes the signal to the program.
exec srun --cpus-per-task="$SLURM_CPUS_PER_TASK" "${LIGHTOCTREE:-lightoctree}" batch "$photos" --output "$scenes" \
  --shard "$SLURM_ARRAY_TASK_ID/${PARTS:-$SLURM_ARRAY_TASK_MAX}" --threads "$SLURM_CPUS_PER_TASK" "$@"

#!/usr/bin/env bash
# Generates rooms in an array job; docs/cluster.md explains it.
#
#   sbatch --array=1-16 scripts/slurm/rooms.sh --scenes 2000 --seed 1 -o ROOMS
#
# Options are those of `lightoctree-lab synth`. Submit the same job again to continue: finished shards are kept.
#SBATCH --job-name=lightoctree-rooms
#SBATCH --cpus-per-task=4
#SBATCH --mem-per-cpu=1G
#SBATCH --time=24:00:00
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=lightoctree-rooms-%A_%a.log
#SBATCH --signal=INT@120
set -euo pipefail

if [ -z "${PARTS:-}" ] && [ "$SLURM_ARRAY_TASK_COUNT" -ne "$SLURM_ARRAY_TASK_MAX" ]; then
  echo "the array is not 1-N; set PARTS to the number of parts, for example sbatch --export=ALL,PARTS=16" >&2
  exit 2
fi
exec srun --cpus-per-task="$SLURM_CPUS_PER_TASK" "${LIGHTOCTREE_LAB:-lightoctree-lab}" synth \
  --shard "$SLURM_ARRAY_TASK_ID/${PARTS:-$SLURM_ARRAY_TASK_MAX}" --threads "$SLURM_CPUS_PER_TASK" "$@"

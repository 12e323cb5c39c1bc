#!/usr/bin/env bash
# Runs scripts/slurm under a Slurm of its own on this machine: array jobs whose tasks are killed and submitted again.
#
#   checks/slurm.sh target/release/lightoctree PHOTOS [target/release/lightoctree-lab]
#
# It needs root and the packages slurm-wlm and munge. The daemons are stopped at the end.
set -euo pipefail

if [ $# -lt 2 ]; then
  echo "usage: $0 LIGHTOCTREE PHOTOS [LIGHTOCTREE-LAB]" >&2
  exit 2
fi
LIGHTOCTREE=$(realpath "$1") photos=$(realpath "$2") LIGHTOCTREE_LAB=${3:+$(realpath "$3")}
export LIGHTOCTREE LIGHTOCTREE_LAB
scripts=$(realpath "$(dirname "$0")/../scripts/slurm")
folder=$(mktemp -d)
cd "$folder"
mkdir state spool
node=$(hostname -s)
cat > slurm.conf <<END
ClusterName=check
SlurmctldHost=$node
SlurmUser=root
SlurmctldPort=36817
SlurmdPort=36818
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
MpiDefault=none
KillWait=5
NodeName=$node NodeAddr=127.0.0.1 CPUs=$(nproc)
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP
END
export SLURM_CONF=$folder/slurm.conf
daemons=() has_passed=
stop() {
  # Of a run that failed.
  scancel --quiet --user="$(id --user --name)" || true
  for _ in $(seq 20); do pgrep -x slurmstepd > /dev/null || break; sleep 0.5; done
  for pid in "${daemons[@]}"; do kill "$pid" 2>/dev/null || true; done
  wait
  if [ -n "$has_passed" ]; then rm -r "$folder"; else echo "failed; logs are in $folder" >&2; fi
}
trap stop EXIT
mkdir -p /run/munge && chown munge: /run/munge
if ! munge -n > /dev/null 2>&1; then
  runuser -u munge -- munged --foreground > munged.log 2>&1 & daemons+=($!)
fi
slurmctld -D > slurmctld.log 2>&1 & daemons+=($!)
slurmd -D -N "$node" > slurmd.log 2>&1 & daemons+=($!)
for _ in $(seq 60); do
  [ "$(sinfo --noheader --format %t 2>/dev/null)" = idle ] && break
  sleep 1
done
sinfo

submit() { sbatch --parsable --cpus-per-task=1 --mem-per-cpu=0 --array=1-4 "$@"; }
await() { while [ -n "$(squeue --noheader --jobs "$1" 2>/dev/null)" ]; do sleep 1; done; }
lines() { cat scenes/report-"$1"-of-4.jsonl 2>/dev/null | wc -l; }
results() { (cd "$1" && find . -name '*.scene' -print0 | sort -z | xargs -0 sha256sum); }

"$LIGHTOCTREE" batch "$photos" --output expected
total=$(results expected | wc -l)

job=$(submit "$scripts/photos.sh" "$photos" scenes)
while [ "$(lines 1)" -lt 2 ] || [ "$(lines 2)" -lt 2 ]; do sleep 0.1; done
# One is killed, as by a lack of memory, and another one stopped, as before a time limit.
scancel --signal=KILL "${job}_1" || true
scancel --signal=INT "${job}_2" || true
await "$job"
done=$(results scenes | wc -l)
echo "job $job: $done of $total photos"
grep --with-filename 'error: stopped after' "lightoctree-${job}_2.log"
[ "$done" -gt 0 ] && [ "$done" -lt "$total" ]

again=$(submit "$scripts/photos.sh" "$photos" scenes)
await "$again"
tail --lines 1 lightoctree-"${again}"_*.log
diff <(results expected) <(results scenes)
kept=$(sed --quiet 's/.* photos estimated, \([0-9]*\) kept.*/\1/p' lightoctree-"${again}"_*.log |
  paste --serial --delimiters + | bc)
[ "$kept" -eq "$done" ]
[ "$(cat scenes/report-*-of-4.jsonl | sort --unique | wc -l)" -eq "$total" ]
echo "job $again: $kept photos kept, all $total with the bytes of one process"

# Only some tasks: the number of parts is given.
some=$(sbatch --parsable --cpus-per-task=1 --mem-per-cpu=0 --array=2,4 "$scripts/photos.sh" "$photos" scenes)
await "$some"
grep --with-filename 'set PARTS' "lightoctree-${some}_2.log"
some=$(PARTS=4 sbatch --parsable --cpus-per-task=1 --mem-per-cpu=0 --array=2,4 "$scripts/photos.sh" "$photos" scenes)
await "$some"
grep --with-filename ' 0 of ' "lightoctree-${some}_4.log"

if [ -n "$LIGHTOCTREE_LAB" ]; then
  rooms=(--scenes 8 --scenes-per-shard 1 --seed 1 --set shots=1 --set panoramas=1 --set panorama_height=32)
  "$LIGHTOCTREE_LAB" synth "${rooms[@]}" -o expected-rooms
  job=$(submit "$scripts/rooms.sh" "${rooms[@]}" -o rooms)
  while ! compgen -G 'rooms/rooms-*.tar' > /dev/null; do sleep 0.1; done
  scancel --signal=KILL "${job}_2"
  await "$job"
  done=$(find rooms -name '*.tar' | wc -l)
  again=$(submit "$scripts/rooms.sh" "${rooms[@]}" -o rooms)
  await "$again"
  diff <(cd expected-rooms && sha256sum ./*.tar) <(cd rooms && sha256sum ./*.tar)
  echo "jobs $job and $again: $done of 8 shards, then all with the bytes of one process"
fi
has_passed=1

#!/bin/bash
# A pilot: a job of Slurm that runs flamefield-worker, which pulls work over the bus until there is none left.
# Submitted by 'flamefield cluster up' and 'flamefield reprocess --executor slurm'.
# usage: pilot.sh DIRECTORY campaign|live flamefield-worker OPTION...
#   DIRECTORY  of this submission, on every node: worker.key (0600), dispatcher.pub, setup.sh
# Signals: USR1 (sbatch --signal, ahead of the time limit) finishes the job in hand and takes no other; TERM gives
# it back at once. A worker that is killed is started again here: Slurm's own requeue would take minutes.
directory=$1 kind=$2
shift 2
name=${directory##*/}-${SLURM_ARRAY_TASK_ID:-0}
if [ ! -r "$directory/worker.key" ]; then
  echo "pilot $name on $(hostname): no $directory/worker.key (the directory is not shared with this node, or the" \
    "submission was taken down) mount it here under this path, or set [cluster] directory" >&2
  exit 2
fi
if [ -e "$directory/setup.sh" ]; then . "$directory/setup.sh"; fi

worker='' ending=''
forward() {
  ending=1
  [ -n "$worker" ] && kill "-$1" "$worker" 2>/dev/null
}
trap 'forward USR1' USR1
trap 'forward TERM' TERM

restarts=0
while :; do
  # A name of its own: the dispatcher still waits for the one that is dead.
  suffix=''
  [ "$restarts" -gt 0 ] && suffix=.$restarts
  "$@" --keys "$directory" --name "$name$suffix" &
  worker=$!
  wait "$worker"
  code=$?
  while kill -0 "$worker" 2>/dev/null; do  # a signal of ours ends the waiting, not the worker
    wait "$worker"
    code=$?
  done
  wait "$worker" 2>/dev/null  # its own status, where the last one was our signal's
  ended=$?
  [ "$ended" -ne 127 ] && code=$ended
  worker=''
  # 0: nothing left to do. 2: refused, which trying again does not mend. 1: the dispatcher is away.
  if [ -n "$ending" ] || [ "$code" -eq 0 ] || [ "$code" -eq 2 ]; then exit "$code"; fi
  restarts=$((restarts + 1))
  if [ "$kind" = live ]; then
    sleep $((restarts < 10 ? restarts : 10)) &
    wait $!
  elif [ "$code" -le 128 ] || [ "$restarts" -gt 5 ]; then
    exit "$code"
  fi
  echo "pilot $name on $(hostname): worker ended with $code, start $restarts" >&2
  [ -n "$ending" ] && exit 0
done

#!/bin/sh
# A daemon that is killed with its bench process in the middle of a run, as by the end of the machine, and the next one:
# it recovers the recording before it listens. bench_deaths.py kills either of them.
#   sh daemon_crash.sh PROGRAM
set -eu
program=$1
DATA=$(mktemp -d)
export FERROBENCH_DATA="$DATA"
daemon=""
clean() {
  [ -z "$daemon" ] || kill "$daemon" 2>/dev/null || true
  [ -z "$daemon" ] || wait "$daemon" 2>/dev/null || true
  rm -rf "$DATA"
}
trap clean EXIT
fail() { echo "FAILED: $1" >&2; cat "$DATA/log" >&2; exit 1; }
until_true() {
  tries=0
  until "$@" >/dev/null 2>&1; do
    tries=$((tries + 1))
    [ "$tries" -lt 300 ] || fail "waited in vain for: $*"
    sleep 0.1
  done
}
start() {
  "$program" serve --port 0 --token-file "$DATA/token" >"$DATA/log" 2>&1 &
  daemon=$!
  until_true "$program" call system.info
}
bench_processes() {
  for folder in /proc/[0-9]*; do
    if grep -q "^ferrobench: holds the voltage" "$folder/cmdline" 2>/dev/null &&
       grep -q "$DATA" "$folder/environ" 2>/dev/null; then
      echo "${folder#/proc/}"
    fi
  done
}
lets_go() { [ -z "$(ls "/proc/$1/fd" 2>/dev/null)" ]; }
has_rows() { "$program" call run.status | grep -q '"rows_on_disk": [1-9]'; }

start
"$program" call run.start '{"protocol": "creep-6-holds-fast", "model": "soft-pzt"}' >/dev/null
until_true has_rows
"$program" list | grep -q " running " || fail "the list does not show the run under way"
bench=$(bench_processes)
[ -n "$bench" ] || fail "no process holds the voltage"
kill -KILL "$daemon" $bench
wait "$daemon" 2>/dev/null || true
until_true lets_go $bench  # what waits for the disk dies once the disk has answered

start
grep -q "^recovered creep-6-holds-fast" "$DATA/log" || fail "the daemon did not recover it"
"$program" list | grep -q " recovered " || fail "the list does not show the recovered recording"
ls "$DATA/recordings" | grep -q journal && fail "the journal is still there"
name=$("$program" list --format json | sed -n 's/.*"name": "\([^"]*\)".*/\1/p')
"$program" report "$name" >/dev/null || fail "the recovered recording cannot be reported"
"$program" export "$name" --format json | grep -q '"gap"' || fail "the gap is not stated"
echo "a killed daemon's run is recovered at the next start"

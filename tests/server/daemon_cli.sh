#!/bin/sh
# The command line against a running daemon (see daemon_test.sh): runs go through it, and Ctrl-C is a safe stop.
#   sh daemon_cli.sh PROGRAM
set -eu
program=$1
fail() { echo "FAILED: $1" >&2; exit 1; }
until_running() {
  tries=0
  until "$program" call run.status | grep -q '"state": "running"'; do
    tries=$((tries + 1))
    [ "$tries" -lt 100 ] || fail "the run did not start"
    sleep 0.1
  done
}

path=$("$program" run stage-full-range --model soft-pzt --fast --quiet)
[ -f "$path" ] || fail "no recording at $path"
"$program" call run.status | grep -q '"state": "complete"' || fail "the daemon did not run it"
"$program" list | grep -q "stage-full-range" || fail "the list does not name it"

"$program" run stage-full-range --model soft-pzt --fast --quiet --out "$DATA/copy.h5" >/dev/null
"$program" report "$DATA/copy.h5" --format json | grep -q '"stroke"' || fail "the copy cannot be reported"

# In real time; interrupted, it must be over soon, with the output at zero, and say so by its exit code.
# A command that a script puts into the background ignores SIGINT; SIGTERM is the same safe stop.
"$program" run creep-6-holds-fast --model soft-pzt --quiet 2>"$DATA/said" >/dev/null &
run=$!
until_running
kill -TERM "$run"
sleep 0.2
kill -TERM "$run"
code=0
wait "$run" || code=$?
[ "$code" = 130 ] || fail "the exit code was $code"
"$program" call run.status >"$DATA/status"
grep -q '"state": "aborted"' "$DATA/status" || fail "the run was not aborted"
grep -q '"output_at_zero": true' "$DATA/status" || fail "the output is not at zero"

# Long work on what lies in the data folder is the daemon's: it shows there, and is stopped there.
jobs() { "$program" call job.list | grep -c "\"kind\": \"$1\"" || true; }
"$program" table 3.13 --model soft-pzt --format json | grep -q '"cells"' || fail "the table did not come back"
[ "$(jobs table)" = 1 ] || fail "the table was not the daemon's job"
name=$(basename "$path" .h5)
fit="--model soft-pzt --free material.barrier --starts 1 --iterations 1 --out $DATA/fitted.json"
"$program" fit "$name" $fit >/dev/null || fail "the fit by name failed"
grep -q ferrobench-model "$DATA/fitted.json" || fail "the fitted model is not in its file"
"$program" fit "$path" $fit >/dev/null || fail "the fit by the path in the data folder failed"
[ "$(jobs fit)" = 2 ] || fail "the fits were not the daemon's jobs"
"$program" fit "$DATA/copy.h5" $fit >/dev/null || fail "the fit of a file from elsewhere failed"
[ "$(jobs fit)" = 2 ] || fail "the daemon was given a file from elsewhere"
"$program" fit no-such-recording $fit >/dev/null 2>"$DATA/said" && fail "it fitted what is not there"
grep -q "'ferrobench list'" "$DATA/said" || grep -q "Allowed: \|allowed: " "$DATA/said" || fail "it does not say what is there"
"$program" discover --model nec-single-crystal --table 3.11 >/dev/null 2>"$DATA/said" &
search=$!
tries=0
until [ "$(jobs discover)" = 1 ]; do
  tries=$((tries + 1))
  [ "$tries" -lt 100 ] || fail "the search was not the daemon's job"
  sleep 0.1
done
kill -TERM "$search"
code=0
wait "$search" || code=$?
[ "$code" = 130 ] || fail "the exit code of the search was $code"
grep -q "nothing was written" "$DATA/said" || fail "it does not say that it was stopped"
"$program" call job.list | grep -q '"state": "cancelled"' || fail "the daemon goes on with the search"

# Limits, in units that people use; and what is refused is told in them.
"$program" limits set field_max=1.5kV/mm >/dev/null || fail "a limit cannot be set"
"$program" limits | grep -q '^field_max  *1.5 kV/mm' || fail "the limit was not set"
"$program" limits set field_max=5000kV/mm 2>"$DATA/said" >/dev/null && fail "an absurd limit was taken"
grep -q "field_max: is outside its range: 5000 kV/mm; allowed: 0 to 1000 kV/mm" "$DATA/said" || fail "not in its unit"

# One controller: others are refused until they show the lease.
lease=$("$program" call lease.acquire '{"duration_s": 60}' | sed -n 's/.*"lease": "\(.*\)".*/\1/p')
[ -n "$lease" ] || fail "no lease was told"
"$program" run stage-full-range --model soft-pzt --fast --quiet >/dev/null 2>"$DATA/said" && fail "it ran without the lease"
grep -q -- "--lease" "$DATA/said" || fail "it does not say how to show the lease"
"$program" run stage-full-range --model soft-pzt --fast --quiet --lease "$lease" >/dev/null || fail "refused with --lease"
"$program" --lease no-such-lease list >/dev/null 2>&1 && fail "took a lease that is none"
# The emergency stop is for everybody, also with a lease that is none any more.
"$program" run creep-6-holds-fast --model soft-pzt --quiet --lease "$lease" >/dev/null 2>&1 &
run=$!
until_running
FERROBENCH_LEASE=no-such-lease "$program" call run.abort >/dev/null || fail "an old lease kept the emergency stop back"
wait "$run" && fail "the run was not stopped"
FERROBENCH_LEASE=$lease "$program" call lease.release >/dev/null || fail "refused with FERROBENCH_LEASE"
echo "the command line works through the daemon"

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

#!/bin/sh
# A daemon whose disk is full says so, and what it had is still there.
#   sh full_disk.sh PROGRAM SHIM      SHIM: the library of tests/faults
set -eu
program=$1
shim=$2
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
call() { "$program" call "$@" >"$DATA/said" 2>&1; }
# Every file but the daemon's own log of calls; what is sparse and hidden too.
all() { find "$DATA/models" "$DATA/recordings" -type f -exec sha256sum {} + | sort; }

path=$("$program" run stage-full-range --model soft-pzt --fast --quiet)
name=$(basename "$path" .h5)
env FAULT_FOLDER="$DATA/" FAULT_KIND=full FAULT_WHEN="$DATA/full" LD_PRELOAD="$shim" \
  ASAN_OPTIONS=verify_asan_link_order=0 "$program" serve --port 0 --token-file "$DATA/token" >"$DATA/log" 2>&1 &
daemon=$!
tries=0
until call system.info; do
  tries=$((tries + 1))
  [ "$tries" -lt 300 ] || fail "the daemon did not start"
  sleep 0.1
done
"$program" model show soft-pzt >"$DATA/model.json"
params="{\"name\": \"mine\", \"model\": $(cat "$DATA/model.json")}"
call model.put "$params" || fail "model.put: $(cat "$DATA/said")"
all >"$DATA/before"

touch "$DATA/full"
for refused in model.put recording.annotate recording.export recording.import; do
  case $refused in
    model.put) given=$params ;;
    recording.annotate) given="{\"name\": \"$name\", \"text\": \"a note\"}" ;;
    recording.export) given="{\"name\": \"$name\"}" ;;
    recording.import) given='{"name": "new", "csv": "t,E\n0,0\n1,1\n", "time": {"column": "t"}, "field": {"column": "E"},
      "length_m": 0.01, "area_m2": 1e-4, "layer_thickness_m": 1e-4}' ;;
  esac
  call "$refused" "$given" && fail "$refused on a full disk: $(cat "$DATA/said")"
  grep -q "make room" "$DATA/said" || fail "$refused said: $(cat "$DATA/said")"
done
all >"$DATA/after"
cmp -s "$DATA/before" "$DATA/after" || fail "files have changed: $(diff "$DATA/before" "$DATA/after")"
call model.get '{"name": "mine"}' || fail "the model is gone: $(cat "$DATA/said")"
echo "a full disk is reported and costs nothing that was there"

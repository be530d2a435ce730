#!/bin/sh
# A daemon of one's own, in a folder of its own, on a free port; then COMMAND with the address and the token added.
#   sh daemon_test.sh PROGRAM COMMAND...      {url} and {token} in COMMAND are replaced; DATA is the folder
set -eu
program=$1
shift
DATA=$(mktemp -d)
export DATA
export FERROBENCH_DATA="$DATA"
"$program" serve --port 0 --token-file "$DATA/token" >"$DATA/log" 2>&1 &
daemon=$!
clean() {
  kill "$daemon" 2>/dev/null || true
  wait "$daemon" 2>/dev/null || true
  rm -rf "$DATA"
}
trap clean EXIT
tries=0
until "$program" call system.info >/dev/null 2>&1; do
  tries=$((tries + 1))
  [ "$tries" -lt 200 ] || { cat "$DATA/log" >&2; exit 1; }
  sleep 0.1
done
URL=$(sed -n 's/^ *JSON-RPC *\(http[^ ]*\).*/\1/p' "$DATA/log")
TOKEN=$(cat "$DATA/token")
export URL TOKEN
# No client or test may find a proxy on the way to the loopback.
export no_proxy=127.0.0.1 NO_PROXY=127.0.0.1
status=0
sh -c "$*" || status=$?
[ "$status" = 0 ] || cat "$DATA/log" >&2
exit "$status"

#!/bin/sh
# From a fresh clone on Debian 12 to an experiment on the virtual device: installs what is missing, builds, starts the
# daemon, runs an experiment over JSON-RPC and shows the report and a published table. Run as root or with sudo at hand.
#   sh server/demo.sh [--keep]      --keep leaves the daemon running
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
. "$root/server/packages.sh"
keep=no
case "${1-}" in
  --keep) keep=yes ;;
  "") ;;
  *) echo "usage: sh server/demo.sh [--keep]" >&2; exit 2 ;;
esac

echo "== what is needed"
install_missing $build_packages
install_page_modules "$root/server/web"

echo "== build"
cmake -S "$root" -B "$root/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DFERROBENCH_TESTS=OFF >/dev/null
ninja -C "$root/build" --quiet ferrobench
bench="$root/build/bin/ferrobench"

echo "== daemon"
log=$(mktemp)
"$bench" serve --port 0 >"$log" 2>&1 &
daemon=$!
stop_daemon() {
  kill "$daemon" 2>/dev/null || true
  wait "$daemon" 2>/dev/null || true
}
trap stop_daemon EXIT
tries=0
until "$bench" call system.info >/dev/null 2>&1; do
  tries=$((tries + 1))
  if ! kill -0 "$daemon" 2>/dev/null || [ "$tries" -gt 100 ]; then
    cat "$log" >&2
    exit 1
  fi
  sleep 0.1
done
kill -0 "$daemon" 2>/dev/null || { cat "$log" >&2; exit 1; }
cat "$log"

echo "== an experiment: a full loop, on the virtual device, over JSON-RPC"
"$bench" call run.start '{"protocol": "stage-full-range", "model": "mcl-op30", "fast": true}' >/dev/null
until "$bench" call run.status | grep -Eq '"state": "(complete|aborted)"'; do sleep 0.1; done
status=$("$bench" call run.status)
echo "$status" | grep -q '"state": "complete"' || { echo "$status" >&2; exit 1; }
recording=$(echo "$status" | sed -n 's/^ *"path": "\(.*\)",*$/\1/p')
"$bench" report "$recording"

echo "== table 3.13: stroke against rate, measured by runs on the virtual device, beside the published values"
"$bench" table 3.13

echo "== where things are"
echo "recording   $recording"
if [ "$keep" = yes ]; then
  trap - EXIT
  echo "daemon      still running, process $daemon; the page's address, and the file with its token, stand above"
else
  echo "daemon      stopped now; start it with: $bench serve"
  echo "page        the address that it prints then"
fi
echo "call it     $bench call rpc.discover"
echo "next        $bench protocol list; README.md"

#!/bin/sh
# Installs what is missing, builds everything and runs every test. Ends with ctest's summary and its exit code.
#   sh tests/run.sh [--checks]      --checks: the checks of checks.sh too, as one more test
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
build=$root/build
checks=OFF
case "${1-}" in
  --checks) checks=ON ;;
  "") ;;
  *) echo "usage: sh tests/run.sh [--checks]" >&2; exit 2 ;;
esac
. "$root/server/packages.sh"
install_missing $build_packages $test_packages
[ $checks = OFF ] || install_missing $check_packages
install_page_modules "$root/server/web"
for modules in "$root/tests/server" "$root/tests/server/web"; do
  npm ci --prefix "$modules" --no-audit --no-fund --silent
done
# The checks take what build and tests leave (a tenth of a busy core: children that read files have 30 s); the test
# "checks" is the last, and says how they ended.
if [ $checks = ON ]; then
  mkdir -p "$build"
  rm -f "$build/checks.result"
  flock "$build/checks.lock" sh -c \
    "nice -n 10 sh '$root/tests/checks.sh' '$build' >'$build/checks.log' 2>&1; echo \$? >'$build/checks.result'" >/dev/null 2>&1 &
fi
cmake -S "$root" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DFERROBENCH_TESTS=ON -DFERROBENCH_CHECKS=$checks >/dev/null
ninja -C "$build" --quiet
exec ctest --test-dir "$build" --output-on-failure --parallel "$(nproc)"

#!/bin/sh
# Installs what is missing, builds everything and runs every test. Ends with ctest's summary and its exit code.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
build=$root/build
. "$root/server/packages.sh"
install_missing $build_packages $test_packages
install_page_modules "$root/server/web"
for modules in "$root/tests/server" "$root/tests/server/web"; do
  npm ci --prefix "$modules" --no-audit --no-fund --silent
done
cmake -S "$root" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DFERROBENCH_TESTS=ON >/dev/null
ninja -C "$build" --quiet
exec ctest --test-dir "$build" --output-on-failure --parallel "$(nproc)"

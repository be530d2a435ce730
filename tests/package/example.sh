#!/bin/sh
# example.sh PACKAGES: a program of somebody else is built against both packages, and runs.
set -eu
folder=$1/example
rm -rf "$folder"
mkdir -p "$folder"
for package in "$1"/*.deb; do dpkg-deb -x "$package" "$folder/root"; done
cmake -S example -B "$folder/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH="$folder/root/usr" >/dev/null
grep -q "ferrobench_DIR:PATH=$folder/root/" "$folder/build/CMakeCache.txt"
ninja -C "$folder/build" --quiet
"$folder/build/example" "$folder/loop.h5" | grep -i stroke
# Nothing of it points to where it was built.
if grep -r "$(cd ../.. && pwd)" "$folder/root/usr/lib/cmake"; then exit 1; fi
"$folder/root/usr/bin/ferrobench" --data "$folder/data" report "$folder/loop.h5" | grep -qi stroke

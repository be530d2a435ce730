#!/bin/sh
# make.sh BUILD PACKAGES: makes the Debian packages of what is built.
set -eu
for tool in dpkg-shlibdeps file; do
  command -v "$tool" >/dev/null || { echo "skipped: there is no $tool"; exit 77; }
done
rm -rf "$2"
cpack --config "$1/CPackConfig.cmake" -B "$2" >"$1/cpack.log" 2>&1 || { cat "$1/cpack.log"; exit 1; }
ls -l "$2"/*.deb

#!/bin/sh
# install.sh PYTHON: pip installs the package from the checkout, without the network, and it works from there. In a copy, as
# setuptools writes beside the sources.
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
version=$(sed -n 's/^project(ferrobench VERSION \([0-9.]*\).*/\1/p' "$root/CMakeLists.txt")
grep -qx "version = \"$version\"" "$root/server/python/pyproject.toml" || { echo "pyproject.toml is not of version $version"; exit 1; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cp -r "$root/server/python" "$folder/source"
"$1" -m pip install --quiet --no-index --no-deps --no-build-isolation --target "$folder/installed" "$folder/source"
cd "$folder"
PYTHONPATH="$folder/installed" "$1" - <<'end'
import pathlib

import ferrobench

assert pathlib.Path(ferrobench.__file__).parent.parent.name == "installed", ferrobench.__file__
with ferrobench.connect() as bench:
    recording = bench.run("stage-full-range", fast=True)
assert recording.status == "complete" and recording["displacement"].unit == "m"
end

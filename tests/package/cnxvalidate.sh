#!/bin/sh
# cnxvalidate.sh FERROBENCH: a recording against its definition by cnxvalidate, the validator of the NeXus committee. It is no
# Debian package, so this is no test of the build: nexus_definition.py compares the two in content.sh. To run it, build
# https://github.com/nexusformat/cnxvalidate (it needs libxml2-dev and libhdf5-dev), get https://github.com/nexusformat/definitions
# for the base classes, and say where both are:
#   NXVALIDATE=.../nxvalidate NEXUS_DEFINITIONS=.../definitions sh tests/package/cnxvalidate.sh build/bin/ferrobench
# Ends with nxvalidate's code: 0 where it found no error. What it says of elements that only a base class does not know are warnings.
set -eu
[ $# = 1 ] && [ -n "${NXVALIDATE:-}" ] && [ -n "${NEXUS_DEFINITIONS:-}" ] || { sed -n '2,7s/^# *//p' "$0" >&2; exit 77; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$1" --data "$folder/data" run full-loops --fast --quiet --out "$folder/run.h5" >/dev/null
"$NXVALIDATE" -l "$NEXUS_DEFINITIONS" -a "$(dirname "$0")/../../recordings/hdf5/ferrobench_recording.nxdl.xml" "$folder/run.h5"

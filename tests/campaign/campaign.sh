#!/bin/sh
# campaign.sh CAMPAIGN FERROBENCH ARGUMENT...: makes the benches that the arguments name, has a batch discover what is hidden in
# them, and judges it. Every answer must be right.
set -eu
campaign=$1 ferrobench=$2
shift 2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$campaign" "$@" --write "$folder/benches" --jobs 2
"$ferrobench" --data "$folder/data" batch discover "$folder/benches/manifest.json" --local 2 --out "$folder/found"
"$campaign" --judge "$folder/found" --read "$folder/benches" --strict yes

#!/bin/sh
# What a command writes costs nothing that was there before, whatever goes wrong, and never its own source.
#   sh outputs.sh PROGRAM [SHIM]
# SHIM: the library of tests/faults that lets the disk be full.
set -u
program=$1
shim=${2:-}
folder=$(mktemp -d)
[ -x "$program" ] || exit 1
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
export FERROBENCH_DATA="$folder/data"
failed=0
fail() { echo "FAILED: $1" >&2; failed=1; }
said() { grep -q -- "$1" err || fail "$2: said $(cat err)"; }

# refused WHAT COMMAND...: it fails, within 20 s.
refused() {
  what=$1
  shift
  timeout 20 "$@" >out 2>err && fail "$what: was done"
  [ $? != 124 ] || fail "$what: hangs"
}
same() { cmp -s "$1" "$2" || fail "$3: the file is not what it was"; }

run() { "$program" run stage-full-range --model soft-pzt --fast --quiet "$@"; }
run --out good.h5 >/dev/null 2>&1 || fail "no recording to begin with"
cp good.h5 kept.h5
"$program" model show soft-pzt >model.json

# A command that is refused has touched nothing.
refused "a misspelt protocol" "$program" run stage-ful-range --fast --out good.h5 --force
same good.h5 kept.h5 "a misspelt protocol"
refused "a bad rate" "$program" run full-loops --fast --set sample_rate_Hz=-1 --out good.h5 --force
same good.h5 kept.h5 "a bad rate"
refused "a part that is not there" "$program" replay kept.h5 --fast --from 1e9 --out good.h5 --force
same good.h5 kept.h5 "a part that is not there"
refused "no --force" "$program" run stage-full-range --model soft-pzt --fast --out good.h5
said "--force" "no --force"
same good.h5 kept.h5 "no --force"
run --out good.h5 --force >/dev/null 2>&1 || fail "--force does not replace"
cmp -s good.h5 kept.h5 && fail "--force has not replaced"
cp good.h5 kept.h5

# Killed in the middle, the old file is there, and --force can be said again.
"$program" run creep-6-holds-fast --model soft-pzt --quiet --out good.h5 --force >/dev/null 2>&1 &
child=$!
tries=0
until [ -s good.h5.journal ] || [ $tries = 100 ]; do sleep 0.1; tries=$((tries + 1)); done
same good.h5 kept.h5 "while a run goes on"
refused "a second run" "$program" run stage-full-range --model soft-pzt --fast --out good.h5 --force
said "being written" "a second run"
kill -9 $child
wait $child 2>/dev/null
same good.h5 kept.h5 "killed in the middle"
# The bench process that the command left brings the output to zero, as the refusal says, and ends.
tries=0
until run --out good.h5 --force >/dev/null 2>refusal.txt; do
  grep -q "until its output is at zero" refusal.txt || fail "--force after a kill: $(cat refusal.txt)"
  [ $tries = 60 ] && fail "the bench of a killed command does not end"
  sleep 0.5
  tries=$((tries + 1))
done
cp good.h5 kept.h5

# No source is replaced, by whatever name.
ln good.h5 hard.h5
ln -s good.h5 soft.h5
for name in good.h5 ./good.h5 hard.h5 soft.h5 "$folder/good.h5"; do
  refused "report to $name" "$program" report good.h5 --out "$name"
  same good.h5 kept.h5 "report to $name"
  refused "export to $name" "$program" export good.h5 --out "$name"
  same good.h5 kept.h5 "export to $name"
  refused "simulate to $name" "$program" simulate good.h5 --out "$name"
  same good.h5 kept.h5 "simulate to $name"
done
cp model.json mine.json
refused "table to its model" "$program" table 3.12 --model mine.json --out mine.json
same mine.json model.json "table to its model"
refused "fit to its model" "$program" fit good.h5 --model mine.json --iterations 1 --out mine.json
same mine.json model.json "fit to its model"

# Only regular files are replaced.
if [ "$(id -u)" = 0 ] && mknod null c 1 3 2>/dev/null; then
  refused "a device" "$program" run stage-full-range --model soft-pzt --fast --out null --force
  said "device" "a device"
  [ -c null ] || fail "the device was replaced"
  "$program" report good.h5 --out null >out 2>err || fail "a text to a device like /dev/null: $(cat err)"
  [ -c null ] || fail "the device was replaced by a text"
fi
mkfifo pipe
refused "a pipe" "$program" run stage-full-range --model soft-pzt --fast --out pipe --force
[ -p pipe ] || fail "the pipe was replaced"
echo precious >precious
ln -s precious link
refused "a link" "$program" report good.h5 --out link
said "precious" "a link"
[ "$(cat precious)" = precious ] || fail "a link was followed"
# A link made in advance, at any name that a recording or its draft ever had.
ln -s precious new.h5.part
run --out new.h5 >out 2>err || fail "a run beside a link: $(cat err)"
[ "$(cat precious)" = precious ] || fail "a link at a draft's name was followed"

# Standard output and pipes take a text.
"$program" report good.h5 --format csv >plain || fail "a report"
"$program" report good.h5 --format csv --out - >out 2>err && cmp -s out plain || fail "--out -: $(cat err)"
"$program" report good.h5 --format csv --out /dev/stdout >out 2>err && cmp -s out plain || fail "/dev/stdout to a file: $(cat err)"
"$program" report good.h5 --format csv --out /dev/stdout 2>err | cmp -s - plain || fail "/dev/stdout to a pipe: $(cat err)"
timeout 20 cat pipe >out &
"$program" report good.h5 --format csv --out pipe 2>err || fail "to a pipe: $(cat err)"
wait $!
cmp -s out plain || fail "through a pipe"
refused "a full standard output" sh -c '"$1" report good.h5 >/dev/full' - "$program"

# What is wrong is said before any work.
refused "a place where nothing can be" "$program" run stage-full-range --model soft-pzt --fast --out /proc/x
grep -q room err && fail "/proc is not full"
said "another folder" "/proc"
refused "a folder that is missing" "$program" table 3.13 --out none/table.txt
said "make it" "a folder that is missing"

# What is read may be a pipe of the shell, but nothing that never ends.
refused "a model without end" "$program" run stage-full-range --model /dev/zero --fast
refused "a model that nobody writes" "$program" run stage-full-range --model ./pipe --fast
refused "a protocol that nobody writes" "$program" run ./pipe --fast
refused "a device that nobody writes" "$program" run stage-full-range --device usb --device-config pipe
"$program" model show soft-pzt |
  "$program" run stage-full-range --model /dev/stdin --fast --quiet --out piped.h5 >out 2>err || fail "a model from a pipe: $(cat err)"

# Many at once in one data folder: each has its file.
for i in 1 2 3 4 5 6 7 8 9 10 11 12; do
  run >"told.$i" 2>"err.$i" &
done
wait
cat told.* | sort -u >told
[ "$(wc -l <told)" = 12 ] || fail "12 runs told of $(wc -l <told) files: $(cat err.*)"
while read -r file; do [ -f "$file" ] || fail "no file at $file"; done <told

# A full disk.
if [ -n "$shim" ]; then
  cp plain text
  for command in "report good.h5 --out $folder/text" "simulate good.h5 --out $folder/good2.h5"; do
    cp kept.h5 good2.h5
    refused "$command on a full disk" env FAULT_FOLDER="$folder/" FAULT_KIND=full FAULT_AT=1 LD_PRELOAD="$shim" \
      ASAN_OPTIONS=verify_asan_link_order=0 "$program" $command
    said "make room" "$command on a full disk"
    same text plain "$command on a full disk"
    same good2.h5 kept.h5 "$command on a full disk"
  done
fi
find "$folder" -name '.ferrobench-*' | grep -q . && fail "drafts were left: $(find "$folder" -name '.ferrobench-*')"
[ $failed = 0 ] && echo "nothing was lost"
exit $failed

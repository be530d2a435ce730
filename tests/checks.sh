#!/bin/sh
# What a change must pass beside the tests. 'sh tests/run.sh --checks' runs them; alone: sh tests/checks.sh [BUILD]
#   format      clang-format on every source
#   alone       sources of the program parsed by themselves, with all warnings (the build joins those of a folder, so that
#               one may lack an include and nobody sees it): those that changed, the latest first, then those that
#               include a header that did, for two minutes
#   sanitizers  ASan and UBSan while text, protocols, recordings, journals and damaged files are read
#   tidy        clang-tidy on the sources of the program (not of its tests) that changed, the latest first, for a minute
#               and a half
# What changed is: since the branch left main, or since the last tag, or in the last 20 commits.
set -u
root=$(cd "$(dirname "$0")/.." && pwd)
mkdir -p "${1:-$root/build}/checks"
work=$(cd "${1:-$root/build}/checks" && pwd)
jobs=$(nproc)
cd "$root" || exit 1

configure() {  # configure FOLDER OPTIONS...
  folder=$1
  shift
  cmake -S . -B "$folder" -G Ninja -DCMAKE_BUILD_TYPE=Debug -DFERROBENCH_TESTS=ON "$@" >/dev/null
}

format() { git ls-files -z '*.cpp' '*.h' | xargs -0 clang-format --dry-run -Werror; }

# What changed is compared with: where the branch left main; on main itself the last tag, or 20 commits ago.
base() {
  left=$(git merge-base HEAD origin/main 2>/dev/null || git merge-base HEAD main 2>/dev/null)
  if [ -n "$left" ] && [ "$left" != "$(git rev-parse HEAD)" ]; then
    echo "$left"
  else
    git describe --tags --abbrev=0 --match 'v[0-9]*' HEAD^ 2>/dev/null || git rev-parse -q --verify HEAD~20
  fi
}

# Files of the program, the latest first; all of them where there is no earlier commit.
changed() {
  if since=$(base); then
    git log --diff-filter=d --name-only --format= "$since..HEAD" -- base protocols recordings model daq server | awk '!seen[$0]++'
  else
    git ls-files base protocols recordings model daq server
  fi
}

# Prints a command that parses a source by itself, for each that changed or that includes what changed, by whatever way.
# json.hpp, half of what there is to parse, is read once for all.
commands() {
  configure "$work/alone" -DCMAKE_CXX_FLAGS_DEBUG=-O0 -DFERROBENCH_UNITY=OFF -DCCACHE=OFF || return 1
  changed >"$work/changed"
  python3 - "$work/alone/compile_commands.json" "$root" "$work/json.h" "$work/changed" <<'end'
import json, re, shlex, subprocess, sys
database, root, prelude, changed = sys.argv[1:]
files = subprocess.run(["git", "ls-files", "*.cpp", "*.h"], capture_output=True, text=True, check=True).stdout.split()
included = {f: re.findall(r'#include "(.*?)"', open(f).read()) for f in files}
latest_first = {f: i for i, f in enumerate(open(changed).read().split())}
touched = set(latest_first)
while more := {f for f in files if f not in touched and touched.intersection(included[f])}:
    touched |= more
entries = {entry["file"].removeprefix(root + "/"): entry for entry in json.load(open(database))}
for source, entry in sorted(entries.items(), key=lambda e: latest_first.get(e[0], len(latest_first))):
    if source in touched and source.split("/")[0] in ("base", "protocols", "recordings", "model", "daq", "server"):
        words = iter(w for w in shlex.split(entry["command"]) if w not in ("-MD", "-c"))
        print(shlex.join(w for w in words if w not in ("-MT", "-MF", "-o") or not next(words)),
              "-fsyntax-only -include", prelude)
end
}

# within SECONDS COUNT COMMAND...: lets the command look at COUNT sources; those that it does not come to are no failure.
within() {
  seconds=$1 count=$2
  shift 2
  timeout "$seconds" "$@"
  end=$?
  [ $end = 124 ] || return $end
  echo "not all of $count sources were looked at in the time there is"
}

alone() {
  commands >"$work/commands" || return 1
  [ -s "$work/commands" ] || { echo "no source has changed"; return 0; }
  echo '#include <nlohmann/json.hpp>' >"$work/json.h"
  # Any of the program's options will do, but they must be those of all.
  sh -c "$(head -n 1 "$work/commands" | sed 's/ [^ ]*\.cpp .*//') -x c++-header '$work/json.h' -o '$work/json.h.gch'"
  within 120 "$(wc -l <"$work/commands")" xargs -d '\n' -P "$jobs" -I {} sh -c '{}' <"$work/commands"
}

# Its files lie apart from those of the same tests that ctest runs beside it.
sanitizers() {
  mkdir -p "$work/tmp" && export TMPDIR="$work/tmp" &&
    configure "$work/sanitized" -DCMAKE_CXX_FLAGS_DEBUG="-O0 -g1" -DFERROBENCH_SANITIZE=address,undefined &&
    ninja -C "$work/sanitized" --quiet base_test protocols_test recordings_test &&
    ctest --test-dir "$work/sanitized/tests/base" --parallel "$jobs" --output-on-failure &&
    ctest --test-dir "$work/sanitized/tests/protocols" --parallel "$jobs" --output-on-failure &&
    ctest --test-dir "$work/sanitized/tests/recordings" --parallel "$jobs" --output-on-failure
}

tidy() {
  configure "$work/alone" -DCMAKE_CXX_FLAGS_DEBUG=-O0 -DFERROBENCH_UNITY=OFF -DCCACHE=OFF || return 1
  known=$(sed -n 's/^ *"file": "\(.*\)",*$/\1/p' "$work/alone/compile_commands.json")
  sources=$(changed |
    while read -r source; do
      printf '%s\n' "$known" | grep -qxF "$root/$source" && [ -f "$source" ] && echo "$source"
    done)
  [ -n "$sources" ] || { echo "no source has changed"; return 0; }
  printf '%s\n' "$sources" | within 90 "$(printf '%s\n' "$sources" | wc -l)" xargs -P "$jobs" -n 1 clang-tidy -p "$work/alone" --quiet \
    --extra-arg=-Wno-unknown-warning-option >"$work/tidy.found" 2>&1
  end=$?
  cat "$work/tidy.found"
  [ $end = 0 ] && ! grep -q 'warnings-as-errors' "$work/tidy.found"
}

failed=""
for check in format sanitizers alone tidy; do
  begin=$(date +%s)
  if ("$check") >"$work/$check.log" 2>&1; then end=passed; else end=FAILED failed="$failed $check"; fi
  echo "$check: $end, $(($(date +%s) - begin)) s"
  if [ "$end" = FAILED ] || [ "$check" = tidy ] || [ "$check" = alone ]; then grep -v ' warnings generated\.$' "$work/$check.log" | tail -n 60; fi
done
[ -z "$failed" ]

#!/bin/sh
# content.sh PYTHON PACKAGES: what the packages hold, says what the program says.
set -eu
python=$1
packages=$2
folder=$packages/content
rm -rf "$folder"
dpkg-deb -x "$packages"/ferrobench_*.deb "$folder"
usr=$folder/usr
bench=$usr/bin/ferrobench
fail() { echo "$*"; exit 1; }

depends=$(dpkg-deb -f "$packages"/ferrobench_*.deb Depends)
for library in libc6 libhdf5 libusb-1.0-0; do
  case $depends in *$library*) ;; *) fail "does not depend on $library: $depends" ;; esac
done
version=$(dpkg-deb -f "$packages"/ferrobench_*.deb Version)
"$bench" --version | grep -qF "ferrobench $version (" || fail "is not version $version: $("$bench" --version)"
case $version in
  $(dpkg-parsechangelog -l ../../server/packaging/changelog -S Version)*) ;;
  *) fail "the changelog does not begin with version $version" ;;
esac
grep -q 'has not chosen a licence' "$usr/share/doc/ferrobench/copyright"

# Each option of each command's help is in the manual page and is completed.
zcat "$usr/share/man/man1/ferrobench.1.gz" >"$folder/ferrobench.1"
if command -v groff >/dev/null; then
  warnings=$(groff -man -ww -z "$folder/ferrobench.1" 2>&1)
  [ -z "$warnings" ] || fail "$warnings"
fi
sed 's/\\-/-/g' "$folder/ferrobench.1" >"$folder/manual"
bash completion.sh "$bench" "$usr/share/bash-completion/completions/ferrobench" "$folder/manual"

"$python" content.py "$usr/share/ferrobench"
"$bench" --data "$folder/data" run stage-full-range --fast --quiet --out "$folder/run.h5" >/dev/null
printf 'time_s,field_V_per_m,displacement_m,current_A\n0,0,0,0\n1,1e6,2e-6,1e-7\n2,0,1e-7,0\n' >"$folder/table.csv"
"$bench" import "$folder/table.csv" --out "$folder/import.h5" --set length_m=0.01 --set area_m2=25e-6 --set layer_thickness_m=1e-4 >/dev/null
"$python" nexus_definition.py "$usr/share/ferrobench/nexus/ferrobench_recording.nxdl.xml" "$folder/run.h5" "$folder/import.h5"
PYTHONDONTWRITEBYTECODE=1 PYTHONPATH="$usr/lib/python3/dist-packages" "$python" -c \
  'import sys, ferrobench; assert ferrobench.open(sys.argv[1])["displacement"].unit == "m"' "$folder/run.h5"
for protocol in "$usr"/share/ferrobench/protocols/*.json; do "$bench" protocol validate "$protocol" >/dev/null; done

grep -qx 'ExecStart=/usr/bin/ferrobench .*' "$usr/lib/systemd/system/ferrobench.service"
[ -s "$usr/lib/udev/rules.d/60-ferrobench.rules" ] && [ -s "$usr/lib/sysusers.d/ferrobench.conf" ]
[ -s "$usr/share/ferrobench/web/index.html" ]

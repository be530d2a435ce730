#!/bin/sh
# One protocol through USB and on the virtual device: the reports must agree.
#   umockdev-wrapper sh through_usb.sh FERROBENCH EMULATOR PYTHON
set -eu
ferrobench=$1
emulator=$2
python=$3
here=$(cd "$(dirname "$0")" && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
export FERROBENCH_DATA="$folder"
cat > "$folder/unit.json" <<JSON
{"board": "bench", "fpga_loaded": true, "bench": {"fresh": true, "specimen": {"model": "mcl-op30", "seed": 7}}}
JSON
cat > "$folder/loops.json" <<JSON
{"format": "ferrobench-protocol", "version": 1, "name": "loops", "unit": "kV/mm", "start": 0, "sample_rate_Hz": 50,
 "segments": [{"kind": "triangle", "low": 0, "high": 1.5, "rate": 1, "cycles": 2, "first": "up"},
              {"kind": "ramp", "to": 1, "rate": 1},
              {"kind": "ramp", "to": 0.2, "rate": 1}, {"kind": "hold", "time": 2}, {"kind": "ramp", "to": 0, "rate": 1}]}
JSON
"$emulator" --config "$folder/unit.json" --device-config > "$folder/device.json"
"$emulator" --config "$folder/unit.json" -- "$ferrobench" run "$folder/loops.json" --device usb \
  --device-config "$folder/device.json" --set device.queue_ahead=0.5 --set device.update_rate=2000 \
  --out "$folder/usb.h5" --quiet
# The unit's specimen has fewer domains than the virtual device takes by itself.
"$ferrobench" run "$folder/loops.json" --model mcl-op30 --fast \
  --set device.domains=0 --set device.tolerance=1e-4 --out "$folder/virtual.h5" --quiet
for name in usb virtual; do
  "$ferrobench" report "$folder/$name.h5" --format json --out "$folder/$name.json"
done
"$python" "$here/compare_reports.py" "$folder/usb.json" "$folder/virtual.json"

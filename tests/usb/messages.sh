#!/bin/sh
# What is said without the unit, without permission, without its FPGA image: what is missing and what to do, and
# never a silent fall-back to the virtual device.
#   umockdev-wrapper sh messages.sh FERROBENCH EMULATOR
set -eu
ferrobench=$1
emulator=$2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
export FERROBENCH_DATA="$folder"

echo '{"board": "bench"}' > "$folder/empty.json"
echo '{"board": "bench", "fpga_loaded": true}' > "$folder/loaded.json"
echo '{"board": "bench", "fpga_loaded": true, "product": 309}' > "$folder/no_outputs.json"
"$emulator" --config "$folder/empty.json" --device-config > "$folder/device.json"
sed 's/^{/{ "serial_number": "99999999",/' "$folder/device.json" > "$folder/other.json"
sed 's/^{/{ "fpga_image": "image.rbf",/' "$folder/device.json" > "$folder/image.json"
head -c 73722 /dev/zero > "$folder/image.rbf"

# expect TEXT... -- COMMAND...: it fails, and says all of it.
expect() {
  : > "$folder/texts"
  while [ "$1" != -- ]; do
    printf '%s\n' "$1" >> "$folder/texts"
    shift
  done
  shift
  if "$@" > "$folder/said" 2>&1; then
    echo "this should have failed: $*" >&2
    exit 1
  fi
  while read -r text; do
    grep -qF -- "$text" "$folder/said" && continue
    echo "\"$text\" is not said by: $*" >&2
    cat "$folder/said" >&2
    exit 1
  done < "$folder/texts"
}
run_with() {
  set -- "$ferrobench" run full-loops --device usb --device-config "$folder/$1" --quiet
  "$@"
}

expect "no USB-1608GX-2AO is attached" "plug the unit in" -- run_with device.json
with() {
  unit=$1
  shift
  "$emulator" --config "$folder/$unit" -- "$ferrobench" run full-loops --device usb --device-config "$folder/$1" --quiet
}
expect "needs its FPGA image" "fpga_image" "USB_1608G_2.rbf" "github.com/mccdaq/uldaq" "v1.1.2" -- with empty.json device.json
expect "not the FPGA image" "SHA-256" "64381d54" -- with empty.json image.json
expect "no unit with this serial number" "01A2B3C4" -- with loaded.json other.json
expect "no analog output" -- with no_outputs.json device.json
if [ -n "$(find "$folder" -name '*.h5')" ]; then
  echo "something was recorded" >&2
  exit 1
fi

# A unit that is unplugged in the middle of a run: its user must act, and the recording says so.
echo '{"board": "bench", "fpga_loaded": true, "fault": "bus_loss", "fault_scans": 1000, "bench": {"specimen": {"model": "mcl-op30-linear"}}}' \
  > "$folder/lost.json"
expect "the run was aborted" "the output may not be at zero, switch the amplifier off" -- \
  "$emulator" --config "$folder/lost.json" -- "$ferrobench" run full-loops --device usb --device-config "$folder/device.json" \
  --set device.update_rate=2000 --set device.queue_ahead=0.5 --quiet --out "$folder/lost.h5"
"$ferrobench" report "$folder/lost.h5" > "$folder/report"
grep -q "switch the amplifier off" "$folder/report" || { cat "$folder/report" >&2; exit 1; }
echo "all is said"

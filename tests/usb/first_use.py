#!/usr/bin/env python3
"""The first use of daq/usb/README.md, as printed: its configuration, its commands, on an emulated unit with that wiring.

    first_use.py FERROBENCH EMULATOR README

Needs umockdev-wrapper around it.
"""

import json
import os
import re
import subprocess
import sys
import tempfile


def section(text, title):
    found = re.search(rf"^## {title}$(.*?)^## ", text, re.M | re.S)
    if not found:
        sys.exit(f"the README has no section {title}")
    return found[1]


def first_use(readme):
    """The configuration and the commands that name it."""
    text = section(open(readme).read(), "First use")
    block = re.search(r"^ {8}(\{.*?\}\})$", text, re.M | re.S)
    commands = [line.split("   ")[0].split() for line in re.findall(r"^ {7,8}(ferrobench .*)$", text, re.M)]
    if not block or not any("bench.json" in command for command in commands):
        sys.exit("the README has no configuration, or no command for it")
    return block[1], commands


def emulated(device):
    """The bench on which that configuration is true."""
    amplifier, full_scale = device["amplifier"], 10  # V
    sensor = {name: {"range": full_scale / abs(device[name]["sensitivity"])} for name in ("displacement", "force")}
    return {
        "board": "bench", "fpga_loaded": True, "patience": 10,
        "bench": {
            "fresh": True, "amplifier_gain": amplifier["gain"], "amplifier_range": amplifier["voltage_max"],
            "enable_line": amplifier["enable_bit"], "interlock_line": amplifier["interlock_bit"],
            "field_channel": device["field"]["channel"], "charge_channel": device["charge"]["channel"],
            "displacement_channel": device["displacement"]["channel"], "force_channel": device["force"]["channel"],
            "marker_channel": device["marker"]["channel"], "marker_level": device["marker"]["level"],
            "specimen": {"model": "mcl-op30-linear",
                         "field": {"range": full_scale * amplifier["monitor_ratio"] / device["specimen"]["layer_thickness"]},
                         "charge": {"range": full_scale * device["charge"]["capacitance"]}, **sensor}}}


def main(program, emulator, readme):
    program, emulator = os.path.abspath(program), os.path.abspath(emulator)
    text, commands = first_use(readme)
    with tempfile.TemporaryDirectory() as folder:
        open(f"{folder}/bench.json", "w").write(text)
        json.dump(emulated(json.loads(text)), open(f"{folder}/unit.json", "w"))
        env = dict(os.environ, FERROBENCH_DATA=f"{folder}/data")
        for command in commands:
            command[0] = program
            done = subprocess.run([emulator, "--config", f"{folder}/unit.json", "--", *command], cwd=folder, env=env,
                                  capture_output=True, text=True)
            print("$", *command[1:], done.stdout[-2000:], done.stderr[-2000:], sep="\n", flush=True)
            if done.returncode != 0:
                return f"this ended with {done.returncode}: {' '.join(command)}"
        recorded = [name for name in os.listdir(f"{folder}/data/recordings") if name.endswith(".h5")]
        return 0 if recorded else "nothing was recorded"


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))

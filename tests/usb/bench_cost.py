#!/usr/bin/env python3
"""What the process that holds the voltage takes of a core at 500 kS/s in and 125 kS/s out, on the emulated unit.

    umockdev-wrapper python3 bench_cost.py FERROBENCH EMULATOR [--seconds N] [--within PERCENT]

Prints the processor time of the bench process and of the daemon, and the most memory that the bench had, between two moments of the run.
Exit code 1 if the bench takes more than --within, or the run does not go on.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import safe_stops  # noqa: E402

ROWS = 125e3  # a second, of four inputs
# The loop-back and pattern of board "proof": 1 V of the unit is 2e5 V/m; the marker's input is left out.
CONFIG = {"amplifier": {"gain": 20, "voltage_min": -170, "voltage_max": 170, "monitor_ratio": 20, "current_limit": 1,
                        "slew_limit": 1e5, "stop_slew": 200},
          "specimen": {"length": 0.02, "area": 25e-6, "layer_thickness": 1e-4, "capacitance": 1e-6},
          "field": {"channel": 0}, "charge": {"channel": 1, "sensitivity": 1e5},
          "displacement": {"channel": 2, "sensitivity": 2e5}, "force": {"channel": 3, "sensitivity": 0.02},
          "monitor_check": {"tolerance": 2e4}, "queue_ahead": 0.5}


def spent(process):
    """Seconds of processor."""
    fields = open(f"/proc/{process}/stat").read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def most_memory(process):
    """MiB"""
    return next(int(line.split()[1]) for line in open(f"/proc/{process}/status") if line.startswith("VmHWM")) / 1024


def inside(program, folder, seconds, within):
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    bench = safe_stops.Bench(program, None, folder)
    bench.start()
    try:
        bench.call("limits.set", slew=1e9)
        bench.call("run.start", device="usb", config=CONFIG, protocol={
            "format": "ferrobench-protocol", "version": 1, "name": "cost", "unit": "kV/mm", "start": 0, "sample_rate_Hz": ROWS,
            "segments": [{"kind": "triangle", "low": 0, "high": 1, "rate": 20, "cycles": int(10 * (seconds + 60)), "first": "up"}]})
        while bench.call("run.status")["rows"] == 0:
            time.sleep(0.05)
        holder = bench.processes()[0]
        before, begin = (spent(holder), spent(bench.daemon.pid)), time.monotonic()
        time.sleep(seconds)
        took = time.monotonic() - begin
        share = [100 * (spent(process) - was) / took for process, was in zip((holder, bench.daemon.pid), before)]
        status = bench.call("run.status")
        print(f"{status['rows']} rows of 4, {took:.1f} s: the bench process took {share[0]:.1f} % of a core and at most "
              f"{most_memory(holder):.0f} MiB, the daemon {share[1]:.1f} %; the run is {status['state']} {status['reason']}")
        if status["state"] == "running":
            bench.call("run.abort")
        return 0 if status["state"] == "running" and share[0] <= within else 1
    finally:
        bench.end()


def main():
    options = argparse.ArgumentParser()
    options.add_argument("program")
    options.add_argument("emulator")
    options.add_argument("--seconds", type=float, default=60)
    options.add_argument("--within", type=float, default=15)
    options.add_argument("--folder", help=argparse.SUPPRESS)
    o = options.parse_args()
    if o.folder:
        return inside(o.program, o.folder, o.seconds, o.within)
    with tempfile.TemporaryDirectory() as folder:
        json.dump({"board": "proof", "fpga_loaded": True}, open(f"{folder}/unit.json", "w"))
        json.dump(CONFIG, open(f"{folder}/device.json", "w"))
        return subprocess.run([o.emulator, "--config", f"{folder}/unit.json", "--", sys.executable, *sys.argv, "--folder", folder],
                              env=dict(os.environ, FERROBENCH_DATA=f"{folder}/data"), preexec_fn=safe_stops.urgent).returncode


sys.exit(main())

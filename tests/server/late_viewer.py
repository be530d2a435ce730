#!/usr/bin/env python3
"""Who comes late to a run sees what was measured before and what is measured now.

    late_viewer.py FERROBENCH

A run in real time on the virtual device, whose samples the server has from the journal that the bench process writes. A viewer
comes after 2 s, another one while the first looks on, both while every core of the machine is busy: each has the beginning from the recording,
its first live samples within 2 s, no hole between the two, and live samples for as long as it looks.
"""

import os
import subprocess
import sys
import tempfile
import time

import daemon_client

RATE = 200  # Hz
PROGRAM = {"format": "ferrobench-protocol", "version": 1, "name": "late", "unit": "kV/mm", "sample_rate_Hz": RATE, "start": 1,
           "segments": [{"kind": "ramp", "to": -0.5, "rate": 1}, {"kind": "hold", "time": 200}]}
LOOKS = 3.0  # s
# The device gives its rows in pieces of 0.06 s, and the server sends at most 20 messages a second.
LEAST = 5 * LOOKS


def demand(fine, *what):
    if not fine:
        print("FAILED:", *what, file=sys.stderr)
        sys.exit(1)


class Viewer(daemon_client.Client):
    """Keeps the live samples that it hears."""

    def __init__(self, folder):
        self.live = []
        super().__init__(folder, 20, self.keep)

    def keep(self, message):
        if message["method"] == "samples":
            self.live.append((time.time(), message["params"]["columns"]["time"]))

    def look(self, name):
        begin = time.time()
        self.call("subscribe", topic="samples", max_rate_Hz=30)
        before = self.call("recording.read", name=name, max_points=20000)
        demand(before["command"]["first"][0] == 1e6, "it sees the beginning", before["command"]["first"][:3])
        end = time.time() + LOOKS
        while time.time() < end:
            self.message(end - time.time())
        demand(self.live, "no live samples come")
        times = [t for _, part in self.live for t in part]
        first = self.live[0][0] - begin
        demand(first < 2, f"the first live samples came after {first:.2f} s")
        demand(len(self.live) >= LEAST, f"{len(self.live)} live messages in {LOOKS} s")
        demand(times == sorted(times), "live samples are not in order")
        demand(times[0] <= before["time"][-1] + 1.5 / RATE, "between the recording and the live samples there is a hole",
               before["time"][-1], times[0])
        steps = [b - a for a, b in zip(times, times[1:])]
        demand(max(steps) < 0.5, f"live samples stop for {max(steps):.2f} s")
        print(f"first live samples after {first * 1e3:.0f} ms, then {len(self.live) / LOOKS:.0f} messages a second")


def main(program):
    with tempfile.TemporaryDirectory() as folder:
        log = open(f"{folder}/log", "w+")
        daemon = subprocess.Popen([program, "--data", folder, "serve", "--port", "0", "--token-file", f"{folder}/token"],
                                  stdout=log, stderr=log)
        busy = []
        try:
            for _ in range(400):
                if "Ctrl-C" in open(f"{folder}/log").read():
                    break
                time.sleep(0.05)
            control = Viewer(folder)
            name = control.call("run.start", protocol=PROGRAM, device="virtual")["recording"]
            time.sleep(2)
            busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2 * (os.cpu_count() or 1))]
            first = Viewer(folder)
            first.look(name)
            Viewer(folder).look(name)
            demand(control.call("run.status")["state"] == "running", "the run goes on", control.call("run.status"))
            control.call("run.abort")
        finally:
            for each in busy:
                each.kill()
                each.wait()
            daemon.terminate()
            daemon.wait(60)


if len(sys.argv) != 2:
    sys.exit(__doc__)
main(sys.argv[1])

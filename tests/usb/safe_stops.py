#!/usr/bin/env python3
"""Every way out of a run, on the emulated unit: how long until its output is at zero, and how steeply it got there.

    safe_stops.py FERROBENCH EMULATOR SHIM [WAY [TIMES]]     all ways; or those whose name has WAY in it, so many times

Needs umockdev-wrapper around it. Each way begins in a hold at 1.5 kV/mm. Exit code 1 if the output is not at zero in the
time allowed (what the way needs to be noticed, the ramp at stop_slew, and a second), or came there faster than that slew.
It is the limits', after a crash the amplifier's. Whatever does not end in its time is named, with the daemon's log. The shim
is that of tests/faults.
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "server"))
import daemon_client  # noqa: E402

TOP = 1.5e6  # V/m
STOP_SLEW = 1e6  # V/m/s, default of the limits
SLACK = 1.0  # s
ZERO = 100  # V/m, 0.5 mV of the unit: a code and a half
WINDOW = 0.05  # s; the device may be 0.01 s late with a step
CALL, START, END, WAY = 30, 20, 60, 90  # s, most that a call, a daemon's start, a program's end, and a whole way may take


@contextlib.contextmanager
def within(seconds, what, log=None):
    def late(*_):
        sys.exit(f"not within {seconds} s: {what}\n" + (open(log).read() if log else ""))
    signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)


def urgent():
    """What stands for hardware has its own time: where the system allows it, no other program delays it."""
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(20))


class Bench:
    def __init__(self, program, shim, folder):
        self.program, self.shim, self.folder = program, shim, folder
        self.config = json.load(open(f"{folder}/device.json"))
        self.config.update(update_rate=2000)
        self.field = self.config["amplifier"]["gain"] / self.config["specimen"]["layer_thickness"]  # V/m per V
        self.own_slew = self.config["amplifier"]["stop_slew"] / self.config["specimen"]["layer_thickness"]  # V/m/s
        self.emulator = int(os.environ["FERROBENCH_USB_EMULATOR"])
        self.daemon = None
        self.trigger = None
        self.output_seen = 0  # bytes of the output's log that output() passes over

    def start(self, fault=None):
        """A daemon; its writes to the data folder fail in that way once the trigger is there."""
        env = dict(os.environ)
        if fault:
            self.trigger = f"{self.folder}/trigger"
            if os.path.exists(self.trigger):
                os.remove(self.trigger)
            env.update(FAULT_FOLDER=f"{self.folder}/data/recordings", FAULT_KIND=fault, FAULT_WHEN=self.trigger,
                       LD_PRELOAD=f"{self.shim}:{env.get('LD_PRELOAD', '')}")
        self.log = f"{self.folder}/daemon.log"
        with open(self.log, "a") as log:
            self.daemon = subprocess.Popen([self.program, "serve", "--port", "0", "--token-file", f"{self.folder}/token"],
                                           env=env, stdout=log, stderr=log)
        with within(START, "the daemon answers", self.log):
            while not daemon_client.answers(f"{self.folder}/data"):
                if self.daemon.poll() is not None:
                    sys.exit(f"the daemon has ended ({self.daemon.returncode}):\n" + open(self.log).read())
                time.sleep(0.05)

    def ended(self, process, what):
        with within(END, what, self.log):
            process.wait()

    def end(self):
        if self.daemon and self.daemon.poll() is None:
            self.daemon.terminate()
            self.ended(self.daemon, "the daemon ends after SIGTERM")
        self.daemon = None

    def call(self, method, **params):
        try:
            return daemon_client.ask(f"{self.folder}/data", method, CALL, **params)
        except (OSError, daemon_client.Refused) as failure:
            sys.exit(f"{method}: {failure}\n{open(self.log).read()}")

    def processes(self):
        return daemon_client.bench_processes(f"{self.folder}/data")

    def output(self):
        """[(unit's time in s, time of day in s, field in V/m)]"""
        rows = []
        log = open(f"{self.folder}/output.log")
        log.seek(self.output_seen)
        for line in log:
            fields = line.split()
            if len(fields) == 3 and line.endswith("\n"):
                rows.append((float(fields[0]), float(fields[1]), float(fields[2]) * self.field))
        return rows

    def level(self):
        rows = self.output()
        return rows[-1][2] if rows else 0.0

    def at_top(self, level=TOP):
        for _ in range(400):
            if abs(self.level() - level) < 0.01 * TOP:
                return
            time.sleep(0.05)
        sys.exit(f"the run does not come to its hold: {self.call('run.status')}\n" + open(self.log).read())

    def run(self):
        with within(END, "the run before, which this daemon may have taken over, is over", self.log):
            while self.call("run.status")["state"] not in ("idle", "complete", "aborted"):
                time.sleep(0.05)
        self.call("run.start", protocol=json.load(open(f"{self.folder}/hold.json")), device="usb", config=self.config)
        self.at_top()
        time.sleep(0.3)


def by_abort(bench):
    bench.run()
    begin = time.time()
    bench.call("run.abort")
    return begin, 0


def by_test_abort(bench):
    device = bench.call("device.open", device="usb", config=bench.config)["device"]
    test = subprocess.Popen([bench.program, "call", "device.selftest", json.dumps({"device": device})],
                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    bench.at_top(5e4)
    begin = time.time()
    bench.call("run.abort")
    bench.ended(test, "the self-test's command ends")
    bench.call("device.close", device=device)
    return begin, 0


def by_client(bench):
    run = subprocess.Popen([bench.program, "run", f"{bench.folder}/hold.json", "--device", "usb", "--device-config",
                            f"{bench.folder}/device.json", "--set", "device.update_rate=2000", "--quiet"],
                           stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    bench.at_top()
    time.sleep(0.3)
    begin = time.time()
    run.send_signal(signal.SIGINT)
    bench.ended(run, "ferrobench run ends after Ctrl-C")
    return begin, 0


def by_lost_client(bench):
    bench.run()
    begin = time.time()
    bench.call("lease.acquire", duration_s=1, stop_run=True)
    return begin, 1


def by_sigterm(bench):
    bench.run()
    begin = time.time()
    bench.daemon.terminate()
    bench.ended(bench.daemon, "the daemon ends after SIGTERM")
    return begin, 0


def by_sigkill(bench):
    bench.run()
    begin = time.time()
    bench.daemon.kill()
    bench.ended(bench.daemon, "the daemon ends after SIGKILL")
    return begin, 0


def by_sigstop(bench):
    bench.run()
    begin = time.time()
    bench.daemon.send_signal(signal.SIGSTOP)
    while time.time() < begin + 6 + TOP / STOP_SLEW:
        time.sleep(0.1)
    bench.daemon.send_signal(signal.SIGCONT)
    return begin, 5


def by_bench_sigkill(bench):
    bench.run()
    begin = time.time()
    os.kill(bench.processes()[0], signal.SIGKILL)
    return begin, 1  # the start of another one


def by_abort_of_hanging_bench(bench):
    bench.run()
    os.kill(bench.processes()[0], signal.SIGSTOP)
    begin = time.time()
    bench.call("run.abort")
    return begin, 3  # 2 s for the stop to be taken, and the start of another one


def by_both_sigkill(bench):
    bench.run()
    bench.daemon.kill()
    for process in bench.processes():
        os.kill(process, signal.SIGKILL)
    bench.ended(bench.daemon, "the daemon ends after SIGKILL")
    time.sleep(1)
    if abs(bench.level()) < 0.9 * TOP:
        sys.exit(f"after SIGKILL of both the output is at {bench.level()} V/m: this shows nothing")
    begin = time.time()
    bench.start()
    return begin, 1  # the daemon's start


def by_full_disk(bench):
    bench.run()
    begin = time.time()
    open(bench.trigger, "w").close()
    return begin, 0


def by_hanging_writer(bench):
    begin, _ = by_full_disk(bench)
    return begin, 10


def by_unplug(bench):
    bench.run()
    begin = time.time()
    os.kill(bench.emulator, signal.SIGUSR1)
    return begin, 0


WAYS = [("run.abort", by_abort, None), ("Ctrl-C of ferrobench run", by_client, None),
        ("self-test, run.abort", by_test_abort, None), ("lost client, lease of 1 s", by_lost_client, None),
        ("SIGTERM of the daemon", by_sigterm, None), ("SIGKILL of the daemon", by_sigkill, None),
        ("SIGSTOP of the daemon, patience 5 s", by_sigstop, None),
        ("SIGKILL of the bench process", by_bench_sigkill, None),
        ("run.abort, bench process in SIGSTOP", by_abort_of_hanging_bench, None),
        ("SIGKILL of both, the next start", by_both_sigkill, None),
        ("disk full", by_full_disk, "full"), ("disk hangs, patience 10 s", by_hanging_writer, "hang"),
        ("unplugged (no power: 0 V)", by_unplug, None)]


def steepest(rows):
    """Of the change in WINDOW, V/m/s, by the unit's time; the voltage stays between two rows."""
    found, k = 0.0, 0
    for i in range(1, len(rows)):
        while rows[k + 1][0] <= rows[i][0] - WINDOW:
            k += 1
        found = max(found, abs(rows[i][2] - rows[k][2]) / WINDOW)
    return found


def judge(bench, name, way, fault):
    bench.start(fault)
    begin, notice = way(bench)
    high = next(row[2] for row in reversed(bench.output()) if row[1] <= begin)
    slew = bench.own_slew if way in (by_bench_sigkill, by_abort_of_hanging_bench, by_both_sigkill) else STOP_SLEW
    allowed = notice + abs(high) / slew + SLACK
    while abs(bench.level()) > ZERO and time.time() < begin + allowed + 10:
        time.sleep(0.05)
    rows = bench.output()
    after = [row for row in rows if row[1] > begin]
    away = [row for row in after if abs(row[2]) > ZERO]
    seconds = next((row[1] for row in after if not away or row[1] > away[-1][1]), begin) - begin
    slope = steepest([(after[0][0] - 1e-3, begin, high)] + after) if after else 0.0
    unplugged = way is by_unplug
    # A step may come late by 0.01 s, and what is missing then comes in one.
    bounded = unplugged or slope <= slew * (1 + 0.01 / WINDOW) + ZERO / WINDOW
    good = abs(rows[-1][2]) <= ZERO and seconds <= allowed and bounded
    print(f"{name:38s} {high / 1e6:8.3f} {seconds:8.2f} {allowed:8.2f} "
          f"{'-' if unplugged else format(slope / 1e6, '.2f'):>8s} {'-' if unplugged else format(slew / 1e6, '.2f'):>8s}  {'' if good else 'NOT GOOD'}", flush=True)
    if unplugged:
        os.kill(bench.emulator, signal.SIGUSR2)
    bench.end()
    return good


def inside(program, shim, folder, name, times):
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))  # the emulator alone is urgent
    bench = Bench(program, shim, folder)
    ways = [way for way in WAYS if name in way[0]] * int(times)
    print(f"{'way out':38s} {'kV/mm':>8s} {'T [s]':>8s} {'allowed':>8s} {'kV/mm/s':>8s} {'allowed':>8s}")
    try:
        good = [judge(bench, *way) for way in ways]
    finally:
        bench.end()
    return 0 if all(good) else 1


def main(program, emulator, shim, name="", times="1"):
    with tempfile.TemporaryDirectory() as folder:
        unit = {"board": "bench", "fpga_loaded": True, "output_log": f"{folder}/output.log",
                "bench": {"fresh": True, "specimen": {"model": "mcl-op30"}}}
        json.dump(unit, open(f"{folder}/unit.json", "w"))
        json.dump({"format": "ferrobench-protocol", "version": 1, "name": "hold", "unit": "kV/mm", "start": 0,
                   "sample_rate_Hz": 100,
                   "segments": [{"kind": "ramp", "to": TOP / 1e6, "rate": 2}, {"kind": "hold", "time": 120},
                                {"kind": "ramp", "to": 0, "rate": 1}]}, open(f"{folder}/hold.json", "w"))
        with open(f"{folder}/device.json", "w") as out:
            subprocess.run([emulator, "--config", f"{folder}/unit.json", "--device-config"], stdout=out, check=True)
        env = dict(os.environ, FERROBENCH_DATA=f"{folder}/data")
        whole = subprocess.Popen([emulator, "--config", f"{folder}/unit.json", "--", sys.executable, __file__, "--inside",
                                  program, shim, folder, name, times], env=env, preexec_fn=urgent)
        with within(WAY * len(WAYS) * int(times), "the emulator and what it runs end", f"{folder}/daemon.log"):
            whole.wait()
        if whole.returncode not in (0, 1):
            print(f"the emulator ended with {whole.returncode}", file=sys.stderr)
        return whole.returncode


if __name__ == "__main__":
    arguments = sys.argv[1:]
    if arguments and arguments[0] == "--inside":
        sys.exit(inside(*arguments[1:]))
    if not 3 <= len(arguments) <= 5:
        sys.exit(__doc__)
    sys.exit(main(*arguments))

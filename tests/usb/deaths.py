#!/usr/bin/env python3
"""Server or bench process dies or hangs at a random moment of a run, on emulated units, several at once.

    deaths.py FERROBENCH EMULATOR [--runs N] [--at-once N] [--seed N] [--slack S]

Needs umockdev-wrapper around it. The server is killed (SIGKILL), stopped (SIGSTOP for 7 s) or crashes (SIGSEGV), or the
bench process is killed or stopped; then the next server, or the same, takes over. What must hold for every run:

- the output is at zero in the time that the way needs to be noticed (5 s of silence, else none), that the slew needs from the
  level where it was, and --slack (1 s: for another bench process to start, or a busy machine);
- every row that the status had called on the disk is in the recording's file;
- the run is over for the next server, its file is made, its journal gone;
- no voltage comes back.

Prints a line for each way: runs, of which the next server found under way or over; the time to zero less what slew and
notice need; the time until the next bench process moved the output; rows acknowledged and lost. Exit code 1 if something did
not hold.
"""

import argparse
import collections
import json
import os
import random
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import safe_stops  # noqa: E402
from safe_stops import daemon_client  # noqa: E402

RAMP = 3e6  # V/m/s, of the program
HOLD = 1.0  # s
SILENCE = 5.0  # s, of a process that hangs
WAYS = ["server killed", "server stopped", "server crashed", "bench killed", "bench stopped"]


class Failure(Exception):
    pass


def until(true, seconds, what):
    end = time.time() + seconds
    while time.time() < end:
        if value := true():
            return value
        time.sleep(0.02)
    raise Failure(f"not within {seconds:.0f} s: {what}")


class Deaths(safe_stops.Bench):
    def __init__(self, program, folder):
        super().__init__(program, None, folder)
        self.log = f"{folder}/daemon.log"

    def ask(self, method, **params):
        return daemon_client.ask(f"{self.folder}/data", method, **params)

    def serve(self):
        with open(self.log, "a") as log:
            self.daemon = subprocess.Popen([self.program, "serve", "--port", "0", "--token-file", f"{self.folder}/token"],
                                           stdout=log, stderr=log)
        until(lambda: daemon_client.answers(f"{self.folder}/data"), 60, "the daemon answers")

    def one(self, way, chance):
        """notice: s until the death can be known; seconds: to zero; slew: s that the way to zero takes; acknowledged, rows:
        on the disk before, and in the file; found: by the next server; step: s until the next bench process moved the output."""
        if self.daemon is None or self.daemon.poll() is not None:
            self.serve()
        top = chance.uniform(0.2, 1.5) * 1e6
        moment = chance.uniform(0, 2 * top / RAMP + HOLD)
        program = {"format": "ferrobench-protocol", "version": 1, "name": "death", "unit": "kV/mm", "start": 0,
                   "sample_rate_Hz": 1000, "segments": [{"kind": "ramp", "to": top / 1e6, "rate": RAMP / 1e6},
                                                        {"kind": "hold", "time": HOLD},
                                                        {"kind": "ramp", "to": 0, "rate": RAMP / 1e6}]}
        limits = {"slew": RAMP * 1.1}  # a corner falls on the next sample, so a short ramp is steeper
        self.ask("limits.set", **limits)
        status = self.ask("run.start", protocol=program, device="usb", config=self.config)
        run = status["run"]
        time.sleep(moment)
        before = self.ask("run.status")
        path, acknowledged = before["path"], before["rows_on_disk"]
        server = way.startswith("server")
        number = {"killed": signal.SIGKILL, "stopped": signal.SIGSTOP, "crashed": signal.SIGSEGV}[way.split()[1]]
        victim = self.daemon.pid if server else self.bench()
        begin = time.time()
        os.kill(victim, number)
        if server and number != signal.SIGSTOP:
            self.daemon.wait()
            time.sleep(chance.choice([0, 0, 0.5, 3]))
            self.serve()
        elif server:
            time.sleep(SILENCE + 2)
            self.daemon.send_signal(signal.SIGCONT)
        elif number == signal.SIGSTOP:  # also where the run had ended before
            until(lambda: victim not in self.processes(), 2 * SILENCE, "the bench process that hangs is ended")
        over = until(lambda: self.over(), 60, "the run is over")
        taken = over["run"] == run
        until(lambda: abs(self.level()) <= safe_stops.ZERO, 10, "the output is at zero")
        seconds, high, step = self.to_zero(begin)
        # A run that its program ends, or that stops by the limits, goes by their slew; one that another bench finds by the amplifier's.
        slew = safe_stops.STOP_SLEW if server else self.own_slew
        notice = SILENCE if number == signal.SIGSTOP else 0
        if over["warning"] or not over["output_at_zero"]:
            raise Failure(f"the status says {over}")
        rows = 0
        if os.path.exists(path):
            rows = self.ask("recording.info", name=os.path.basename(path)[:-3])["rows"]
        if os.path.exists(path + ".journal"):
            raise Failure("the journal is left")
        os.path.exists(path) and os.remove(path)
        return {"notice": notice, "seconds": seconds, "slew": high / slew, "acknowledged": acknowledged, "rows": rows,
                "found": taken, "step": None if server else step}

    def over(self):
        status = self.ask("run.status")
        return status if status["state"] in ("idle", "complete", "aborted") else None

    def bench(self):
        return until(self.processes, 10, "there is a bench process")[0]

    def to_zero(self, begin):
        """Seconds from `begin` until the output was at zero for good, the highest level after it, seconds until the output
        moved again after the longest time in which it did not."""
        rows = self.output()
        before = [row for row in rows if row[1] <= begin]
        after = [row for row in rows if row[1] > begin]
        high = max([abs(before[-1][2])] if before else [0.0])
        away = [row[1] for row in after if abs(row[2]) > safe_stops.ZERO]
        high = max([high] + [abs(row[2]) for row in after])
        if not away:
            return 0.0, high, None
        zero = next(row[1] for row in after if row[1] > away[-1])
        times = [begin] + [row[1] for row in after if row[1] <= zero]
        _, moved = max((b - a, b) for a, b in zip(times, times[1:]))
        return zero - begin, high, moved - begin


def worker(program, folder, ways, seed):
    """Prints a line of JSON for each way."""
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))  # the emulator alone is urgent
    bench = Deaths(program, folder)
    chance = random.Random(seed)
    for way in ways:
        try:
            result = {"way": way, **bench.one(way, chance)}
        except (Failure, OSError, daemon_client.Refused, StopIteration) as failure:
            log = open(bench.log).read()[-2000:]
            result = {"way": way, "failure": f"{type(failure).__name__}: {failure}", "log": log}
        print(json.dumps(result), flush=True)
        if "failure" in result:
            if bench.daemon:
                bench.daemon.send_signal(signal.SIGCONT)
            break
        bench.output_seen = os.path.getsize(f"{folder}/output.log")
    bench.end()


def start(program, emulator, ways, seed, results):
    with tempfile.TemporaryDirectory() as folder:
        unit = {"board": "bench", "fpga_loaded": True, "output_log": f"{folder}/output.log",
                "bench": {"fresh": True, "specimen": {"model": "mcl-op30"}}}
        json.dump(unit, open(f"{folder}/unit.json", "w"))
        with open(f"{folder}/device.json", "w") as out:
            subprocess.run([emulator, "--config", f"{folder}/unit.json", "--device-config"], stdout=out, check=True)
        env = dict(os.environ, FERROBENCH_DATA=f"{folder}/data")
        process = subprocess.Popen([emulator, "--config", f"{folder}/unit.json", "--", sys.executable, __file__, "--worker",
                                    program, folder, json.dumps(ways), str(seed)],
                                   env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=safe_stops.urgent)
        said = collections.deque(maxlen=20)
        listener = threading.Thread(target=lambda: said.extend(process.stderr), daemon=True)
        listener.start()
        done = 0
        for line in process.stdout:
            results.append(json.loads(line))
            done += 1
        process.wait()
        if done < len(ways) and "failure" not in (results[-1] if results else {}):
            listener.join(10)
            results.append({"way": ways[done], "failure": f"the emulator or its worker ended with {process.returncode}",
                            "log": "".join(said)})


def main():
    options = argparse.ArgumentParser()
    options.add_argument("program")
    options.add_argument("emulator")
    options.add_argument("--runs", type=int, default=1000)
    options.add_argument("--at-once", type=int, default=4)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--slack", type=float, default=1.0)
    options.add_argument("--ways", default="", help="those that have this in their name")
    options.add_argument("--log", help="a file to which each run's result is added as a line of JSON")
    o = options.parse_args()
    o.ways = [way for way in WAYS if o.ways in way]
    ways = [o.ways[i % len(o.ways)] for i in range(o.runs)]
    random.Random(o.seed).shuffle(ways)
    results, threads = [], []
    for i in range(o.at_once):
        mine = ways[i::o.at_once]
        if mine:
            threads.append(threading.Thread(target=start, args=(o.program, o.emulator, mine, o.seed * 1000 + i, results)))
    for each in threads:
        each.start()
    logged = 0
    while any(each.is_alive() for each in threads) or logged < len(results):
        time.sleep(5)
        print(f"{len(results)} of {o.runs}", file=sys.stderr, flush=True)
        fresh = results[logged:]
        logged += len(fresh)
        if o.log:
            with open(o.log, "a") as log:
                log.writelines(json.dumps(result) + "\n" for result in fresh)
    return table(results, o)


def table(results, o):
    good = len(results) == o.runs
    print(f"{'':16s} {'':5s} {'':6s} {'beyond notice and slew [s]':>26s} {'':8s} {'first step of the next [s]':>26s}")
    print(f"{'way':16s} {'runs':>5s} {'found':>6s} {'median':>8s} {'99 %':>8s} {'max':>8s} {'allowed':>8s} "
          f"{'median':>8s} {'99 %':>8s} {'max':>8s} {'acknowledged':>13s} {'lost':>5s} {'failed':>7s}")
    for way in o.ways:
        mine = [r for r in results if r["way"] == way]
        done = [r for r in mine if "failure" not in r]
        beyond = [max(0.0, r["seconds"] - r["notice"] - r["slew"]) for r in done] or [0.0]
        steps = [r["step"] - r["notice"] for r in done if r["step"] is not None] or [0.0]
        lost = sum(max(0, r["acknowledged"] - r["rows"]) for r in done)
        good = good and len(done) == len(mine) and not lost and max(beyond) <= o.slack
        print(f"{way:16s} {len(mine):5d} {sum(r['found'] for r in done):6d} {spread(beyond)} {o.slack:8.2f} {spread(steps)} "
              f"{sum(r['acknowledged'] for r in done):13d} {lost:5d} {len(mine) - len(done):7d}")
    for result in results:
        if "failure" in result:
            print(f"{result['way']}: {result['failure']}\n{result['log']}")
    return 0 if good else 1


def spread(values):
    values = sorted(values)
    return f"{statistics.median(values):8.3f} {values[int(0.99 * (len(values) - 1))]:8.3f} {values[-1]:8.3f}"


if __name__ == "__main__":
    if sys.argv[1:2] == ["--worker"]:
        worker(sys.argv[2], sys.argv[3], json.loads(sys.argv[4]), int(sys.argv[5]))
    else:
        sys.exit(main())

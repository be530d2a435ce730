#!/usr/bin/env python3
"""Server or bench process dies, hangs or is stopped in the middle of a run.

    bench_deaths.py FERROBENCH                       each way once
    bench_deaths.py FERROBENCH --runs 1000 --seed 1  any way, at random moments

What must hold: the output is at zero by a safe stop, no row that was acknowledged is lost, the next server finds the run
and makes its file, and a file without an end says so. On the virtual device; tests/usb/safe_stops.py has the ways on the emulated unit.
"""

import argparse
import contextlib
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time

import daemon_client

HOLD = {"format": "ferrobench-protocol", "version": 1, "name": "hold", "unit": "kV/mm", "sample_rate_Hz": 200,
        "segments": [{"kind": "ramp", "to": 0.5, "time": 0.2}, {"kind": "hold", "time": 60}]}
SHORT = dict(HOLD, name="short", unattended=True,
             segments=[{"kind": "ramp", "to": 0.5, "time": 0.2}, {"kind": "hold", "time": 2},
                       {"kind": "ramp", "to": 0, "time": 0.2}])
STOP_TIME = 0.5  # s from 0.5 kV/mm at the usual stop_slew


class Daemon:
    def __init__(self, program, folder):
        self.program, self.folder = program, folder
        self.env = dict(os.environ, FERROBENCH_DATA=folder)
        self.log = f"{folder}/log"
        self.process = None

    def start(self):
        self.process = subprocess.Popen([self.program, "serve", "--port", "0", "--token-file", f"{self.folder}/token"],
                                        env=self.env, stdout=open(self.log, "a"), stderr=subprocess.STDOUT)
        self.until(lambda: daemon_client.answers(self.folder), 20, "the daemon answers")

    def ask(self, method, **params):
        return daemon_client.ask(self.folder, method, **params)

    def until(self, true, seconds, what):
        end = time.time() + seconds
        while time.time() < end:
            if true():
                return
            time.sleep(0.02)
        fail(f"not within {seconds} s: {what}\n{open(self.log).read()}")

    def run(self, protocol=HOLD):
        started = self.ask("run.start", protocol=protocol, model="soft-pzt")
        self.until(lambda: self.ask("run.status")["rows_on_disk"] > 0, 10, "rows come")
        return started["run"]

    def status(self):
        return self.ask("run.status")

    def over(self, run, seconds=15):
        self.until(lambda: self.status()["state"] in ("complete", "aborted"), seconds, "the run is over")
        status = self.status()
        if status["run"] != run:
            fail(f"another run: {status}")
        return status

    def bench(self):
        return daemon_client.bench_processes(self.folder)

    def kill(self, number=signal.SIGKILL):
        self.process.send_signal(number)
        if number == signal.SIGKILL:
            self.process.wait()

    def end(self):
        if self.process and self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.terminate()
            self.process.wait(60)

    def file(self, status):
        """Status, reason and rows of the recording, and its last command."""
        name = status["recording"]
        info = self.ask("recording.info", name=name)
        table = subprocess.run([self.program, "export", name, "--format", "csv"], env=self.env, capture_output=True,
                               text=True).stdout.splitlines()
        lines = [line for line in table if line and not line.startswith("#")]
        names = lines[0].split(",")
        column = next(i for i, n in enumerate(names) if n.startswith("command"))
        return info, len(lines) - 1, float(lines[-1].split(",")[column])


def fail(what):
    print("FAILED:", what, file=sys.stderr)
    sys.exit(1)


def demand(fine, what, *more):
    if not fine:
        fail(f"{what} {more}")


def whole(daemon, status, acknowledged, state, reason=""):
    demand(status["state"] == state, "the state", status)
    demand(reason in status["reason"], "the reason", reason, status)
    demand(status["output_at_zero"] and not status["warning"], "the output", status)
    info, rows, last = daemon.file(status)
    demand(rows >= acknowledged, "acknowledged rows are missing", acknowledged, rows)
    demand(rows == status["rows"], "the rows of the file", rows, status)
    demand(not [n for n in os.listdir(f"{daemon.folder}/recordings") if "journal" in n], "the journal is still there")
    return info, last


def server_killed(daemon):
    run = daemon.run()
    acknowledged = daemon.status()["rows_on_disk"]
    demand(len(daemon.bench()) == 1, "there is one bench process", daemon.bench())
    daemon.kill()
    daemon.start()
    status = daemon.over(run)
    info, last = whole(daemon, status, acknowledged, "aborted", "the server has ended")
    demand(last == 0, "the recording ends at zero", last)
    demand("had lost its server" in open(daemon.log).read(), "the log says so")
    # The next run is on the same bench.
    demand(len(daemon.bench()) == 1, "there is one bench process", daemon.bench())
    run = daemon.run()
    daemon.ask("run.abort")
    daemon.over(run)


def server_killed_and_late(daemon):
    run = daemon.run()
    acknowledged = daemon.status()["rows_on_disk"]
    daemon.kill()
    time.sleep(STOP_TIME + 1.5)
    sockets = [n for n in os.listdir(daemon.folder) if n.startswith("bench-")]
    demand(len(sockets) == 1, "it waits for a server", sockets)
    demand(os.stat(f"{daemon.folder}/{sockets[0]}").st_mode & 0o777 == 0o600, "the mode of its socket")
    daemon.start()
    whole(daemon, daemon.over(run), acknowledged, "aborted", "the server has ended")


def next_server_while_bench_stands(daemon, then):
    """The server dies and the next one starts; the bench stands still and gets the signal `then` after a second."""
    bench = daemon.bench()[0]
    os.kill(bench, signal.SIGSTOP)
    daemon.kill()
    later = threading.Timer(1, lambda: os.kill(bench, then))
    later.start()
    daemon.start()
    later.join()


def server_killed_and_bench_slow(daemon):
    """The next server is there before the bench has seen that it lost the last one."""
    run = daemon.run()
    acknowledged = daemon.status()["rows_on_disk"]
    next_server_while_bench_stands(daemon, signal.SIGCONT)
    info, last = whole(daemon, daemon.over(run), acknowledged, "aborted", "the server has ended")
    demand(last == 0, "the recording ends at zero", last)


def both_killed_and_bench_slow(daemon):
    """The next server is there before the bench has died."""
    daemon.run()
    acknowledged = daemon.status()["rows_on_disk"]
    name = daemon.status()["recording"]
    next_server_while_bench_stands(daemon, signal.SIGKILL)
    demand(f"recovered {name}" in open(daemon.log).read(), "the log says what was made")
    info, rows, last = daemon.file({"recording": name})
    demand(rows >= acknowledged and info["status"] == "recovered", "the file", rows, info["status"])


def server_killed_for_good(daemon):
    daemon.run()
    acknowledged = daemon.status()["rows_on_disk"]
    name = daemon.status()["recording"]
    daemon.kill()
    daemon.until(lambda: not daemon.bench(), STOP_TIME + 15, "the bench process ends by itself")
    demand(not [n for n in os.listdir(daemon.folder) if n.startswith("bench-")], "its socket is gone")
    daemon.start()
    demand(f"completed {name}" in open(daemon.log).read(), "the log says what was made")
    info, rows, last = daemon.file({"recording": name})
    demand(rows >= acknowledged and last == 0 and info["status"] == "aborted", "the file", rows, last, info["status"])


def unattended(daemon):
    run = daemon.run(SHORT)
    daemon.kill()
    time.sleep(0.5)
    daemon.start()
    info, last = whole(daemon, daemon.over(run), 1, "complete")
    demand(last == 0, "it ends at zero", last)


def server_stopped(daemon):
    run = daemon.run()
    daemon.kill(signal.SIGSTOP)
    time.sleep(5 + STOP_TIME + 1.5)
    daemon.kill(signal.SIGCONT)
    info, last = whole(daemon, daemon.over(run, 3), 1, "aborted", "the server did not answer for 5 s")
    demand(last == 0, "the recording ends at zero", last)
    demand(len(daemon.bench()) == 1, "the bench process is still there", daemon.bench())


def server_stopped_for_a_moment(daemon):
    run = daemon.run(SHORT)
    daemon.kill(signal.SIGSTOP)
    time.sleep(1)
    daemon.kill(signal.SIGCONT)
    whole(daemon, daemon.over(run), 1, "complete")


def bench_killed(daemon):
    run = daemon.run()
    acknowledged = daemon.status()["rows_on_disk"]
    begin = time.time()
    os.kill(daemon.bench()[0], signal.SIGKILL)
    status = daemon.over(run, 5)
    demand(time.time() - begin < 3, "the server says so at once")
    info, last = whole(daemon, status, acknowledged, "aborted", "the bench process has died")
    demand(info["status"] == "recovered", "the file says that it broke off", info["status"])
    run = daemon.run()  # on another one
    daemon.ask("run.abort")
    daemon.over(run)


def bench_stopped(daemon):
    run = daemon.run()
    bench = daemon.bench()[0]
    os.kill(bench, signal.SIGSTOP)
    status = daemon.over(run, 10)
    whole(daemon, status, 1, "aborted", "did not answer for 5 s")
    demand(bench not in daemon.bench(), "it was ended")


def aborted_while_bench_hangs(daemon):
    run = daemon.run()
    acknowledged = daemon.status()["rows_on_disk"]
    bench = daemon.bench()[0]
    os.kill(bench, signal.SIGSTOP)
    begin = time.time()
    told = daemon.ask("run.abort")
    demand(told["state"] in ("stopping", "aborted") and "did not take a stop within 2 s" in told["reason"], "what is told", told)
    status = daemon.over(run, 5)
    demand(time.time() - begin < 5, "it ends within 5 s", time.time() - begin)
    whole(daemon, status, acknowledged, "aborted", "did not take a stop within 2 s and was ended")
    demand(bench not in daemon.bench(), "it was ended")
    run = daemon.run()  # on another one
    daemon.ask("run.abort")
    daemon.over(run)


WAYS = [server_killed, server_killed_and_late, server_killed_and_bench_slow, both_killed_and_bench_slow,
        server_killed_for_good, unattended, server_stopped, server_stopped_for_a_moment, bench_killed, bench_stopped,
        aborted_while_bench_hangs]


def at_random(program, runs, seed):
    """Kills and stops at any moment of a run: before its first row, in it, on its way to zero, after its end."""
    chance = random.Random(seed)
    taken, killed = 0, 0
    with tempfile.TemporaryDirectory() as folder:
        daemon = Daemon(program, folder)
        daemon.start()
        for number in range(runs):
            protocol = dict(SHORT, unattended=chance.random() < 0.3)
            run = daemon.ask("run.start", protocol=protocol, model="soft-pzt")["run"]
            time.sleep(chance.uniform(0, 3))
            if chance.random() < 0.3:
                with contextlib.suppress(daemon_client.Refused):  # it may be over
                    daemon.ask("run.abort")
            status = daemon.status()
            path, acknowledged = status["path"], status["rows_on_disk"]
            way = chance.choice(["server", "server", "bench", "both"])
            killed += 1
            if way != "server":
                for process in daemon.bench():
                    os.kill(process, signal.SIGKILL)
            if way != "bench":
                daemon.kill()
                time.sleep(chance.choice([0, 0, 0.3, 1, 3]))
                daemon.start()
            daemon.until(lambda: daemon.status()["state"] in ("idle", "complete", "aborted"), 20, "it is over")
            status = daemon.status()
            taken += way == "server" and status["run"] == run
            demand(status["output_at_zero"] and not status["warning"], "the output", way, status)
            if os.path.exists(path):
                info, rows, last = daemon.file({"recording": os.path.basename(path)[:-3]})
                demand(rows >= acknowledged, "rows are missing", way, acknowledged, rows)
                demand(info["status"] == "recovered" or last == 0, "the end is not at zero", way, last, info["status"])
            else:
                demand(acknowledged == 0, "the file is missing", way, acknowledged, path, status)
            demand(not os.path.exists(path + ".journal"), "the journal is left", way)
        daemon.end()
    print(f"{killed} deaths; {taken} runs were taken over by the next server; no acknowledged row is missing")


def main():
    options = argparse.ArgumentParser()
    options.add_argument("program")
    options.add_argument("--runs", type=int, default=0)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--way", default="")
    o = options.parse_args()
    if o.runs:
        return at_random(o.program, o.runs, o.seed)
    for way in WAYS:
        if o.way and way.__name__ != o.way:
            continue
        with tempfile.TemporaryDirectory() as folder:
            daemon = Daemon(o.program, folder)
            daemon.start()
            try:
                way(daemon)
            finally:
                daemon.end()
        print("as it should be:", way.__name__, flush=True)


if __name__ == "__main__":
    main()

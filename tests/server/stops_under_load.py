"""How long run.abort takes while others keep the daemon busy.

    python3 stops_under_load.py PROGRAM [--rows N] [--runs N] [--calls N] [--within MS] [--ramp-within MS] [--discover]
                                [--hanging-disk SHIM]
    umockdev-wrapper python3 stops_under_load.py PROGRAM --emulator EMULATOR ...

8 viewers ask for HTML reports of a long recording, 50 clients subscribe to everything, 64 strangers hold connections and
come again when they are dropped; with --discover a discovery computes on all cores as well. With --hanging-disk, which takes the
library of tests/faults, no call that writes to the data folder returns from 0.2 s before a stop until its calls are over.
Meanwhile run.abort is called by HTTP, each time by a new connection: on so many runs under way, and again while they end and
have ended. Prints the times from connecting to the reply, and to the first step of the ramp to zero: on the virtual device by
its samples, on the emulated unit by the unit's own output.
Whoever presses stop sits at another machine: that is a process of its own here, with real-time priority where that is allowed.
Fails if the 99.9th percentile of one is above --within or --ramp-within.
"""
import argparse
import atexit
import http.client
import json
import multiprocessing
import os
import random
import socket
import subprocess
import sys
import tempfile
import threading
import time

parser = argparse.ArgumentParser()
parser.add_argument("program")
parser.add_argument("--rows", type=int, default=2_000_000)
parser.add_argument("--runs", type=int, default=300)
parser.add_argument("--calls", type=int, default=3000)
parser.add_argument("--within", type=float, default=50)
parser.add_argument("--ramp-within", type=float, default=100)
parser.add_argument("--discover", action="store_true")
parser.add_argument("--hanging-disk", metavar="SHIM", type=os.path.abspath, help="library that holds what writes to the disk")
parser.add_argument("--emulator", help="of the unit on which the runs are, else they are on the virtual device")
parser.add_argument("--folder", help=argparse.SUPPRESS)  # of the unit, within the emulator
options = parser.parse_args()

if options.emulator and not options.folder:  # this script once more, where there is a unit
    folder = tempfile.mkdtemp(dir="/dev/shm")  # the unit waits for no disk
    unit = {"board": "bench", "fpga_loaded": True, "output_log": f"{folder}/output.log",
            "bench": {"fresh": True, "specimen": {"model": "mcl-op30"}}}
    json.dump(unit, open(f"{folder}/unit.json", "w"))
    with open(f"{folder}/device.json", "w") as out:
        subprocess.run([options.emulator, "--config", f"{folder}/unit.json", "--device-config"], stdout=out, check=True)

    def urgent():  # what stands for hardware has its own time
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(20))
    sys.exit(subprocess.run([options.emulator, "--config", f"{folder}/unit.json", "--", sys.executable, *sys.argv,
                             "--folder", folder], preexec_fn=urgent).returncode)
if options.emulator:
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))

folder = tempfile.mkdtemp()
token_file = os.path.join(folder, "token")
disk_hangs = folder + ".hangs"  # while this file is there
environment = dict(os.environ)
if options.hanging_disk:
    preloaded = [options.hanging_disk, *environment.get("LD_PRELOAD", "").split()]  # the emulated unit has a library as well
    environment.update(LD_PRELOAD=" ".join(preloaded), FAULT_FOLDER=folder, FAULT_KIND="held", FAULT_WHEN=disk_hangs)
daemon = subprocess.Popen([options.program, "--data", folder, "serve", "--port", "0", "--token-file", token_file],
                          stdout=subprocess.PIPE, text=True, env=environment)
for line in daemon.stdout:
    if "JSON-RPC" in line:
        port = int(line.split("://")[1].split("/")[0].split(":")[1])
    if "Ctrl-C" in line:
        break
token = open(token_file).read().strip()
atexit.register(daemon.kill)


def call(method, params=None, timeout=600):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=timeout)
    body = json.dumps({"jsonrpc": "2.0", "method": method, "params": params or {}, "id": 1})
    connection.request("POST", "/rpc", body,
                       {"Authorization": f"Bearer {token}", "Content-Type": "application/json"})
    reply = json.loads(connection.getresponse().read())
    connection.close()
    return reply


def protocol(seconds, rate):
    return {"format": "ferrobench-protocol", "version": 1, "name": "load", "title": "Load", "unit": "kV/mm",
            "sample_rate_Hz": rate, "start": 0,
            "segments": [{"kind": "ramp", "to": 0.05, "time": 0.01}, {"kind": "hold", "time": seconds},
                         {"kind": "ramp", "to": 0, "time": 0.01}]}


def wait_for(*states):
    while (status := call("run.status")["result"])["state"] not in states:
        time.sleep(0.02)
    return status


def begin_run(**asked):
    reply = call("run.start", asked)
    if "result" not in reply or (status := wait_for("running", "complete", "aborted"))["state"] != "running":
        raise SystemExit(f"a run does not begin: {reply if 'result' not in reply else status}")


rate = 100_000
call("run.start", {"protocol": protocol(options.rows / rate, rate), "fast": True, "set": {"device.domains": 16}})
name = wait_for("complete", "aborted")["recording"]
reports = multiprocessing.Value("l", 0)


def view():
    while True:
        reply = call("recording.report", {"name": name, "format": "html"})
        with reports:
            reports.value += "result" in reply


def listen():
    with socket.socket(socket.AF_UNIX) as s:
        s.connect(os.path.join(folder, "daemon.sock"))
        for topic in ("run", "samples", "events", "job"):
            s.sendall(json.dumps({"jsonrpc": "2.0", "method": "subscribe", "params": {"topic": topic}, "id": 1}).encode() + b"\n")
        while s.recv(1 << 16):
            pass


def crowd():
    there = []
    while True:
        for s in list(there):
            s.setblocking(False)
            try:
                gone = s.recv(1) == b""
            except BlockingIOError:
                gone = False
            except OSError:
                gone = True
            if gone:
                s.close()
                there.remove(s)
        while len(there) < 64:
            there.append(socket.create_connection(("127.0.0.1", port)))
        time.sleep(0.2)


def discoverable():
    call("run.start", {"protocol": "creep-6-holds-fast", "fast": True, "set": {"device.domains": 16}})
    return wait_for("complete", "aborted")["recording"]


def discover():
    while True:
        job = call("discrepancy.start", {"recordings": [short]})["result"]["job"]
        while call("job.status", {"job": job})["result"]["state"] == "running":
            time.sleep(0.5)
        call("job.cancel", {"job": job})


def others():
    threads = [threading.Thread(target=what, daemon=True)
               for what in [view] * 8 + [listen] * 50 + [crowd] + [discover] * options.discover]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


short = discoverable() if options.discover else None
load = multiprocessing.Process(target=others, daemon=True)
load.start()
time.sleep(2)
try:
    os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(10))
except PermissionError:
    print("no real-time priority: the times hold what this process waits for the processor")

times, ramps = [], []


def timed_abort():
    begin = time.monotonic()
    reply = call("run.abort", {"reason": "measured"})
    times.append(1e3 * (time.monotonic() - begin))
    return begin, reply


def first_sample():
    """When the first sample of the run under way was taken: not later than by any of its samples seen."""
    soonest = float("inf")
    until = time.monotonic() + 0.3
    while time.monotonic() < until:
        status = call("run.status")["result"]
        if status["rows"]:
            soonest = min(soonest, time.monotonic() - (status["rows"] - 1) / status["sample_rate_Hz"])
        time.sleep(0.001)
    return soonest


LEVEL = 0.05e6  # V/m, of protocol()
if options.emulator:
    config = json.load(open(f"{options.folder}/device.json"))
    config.update(update_rate=2000)  # the emulated unit computes its specimen at each tick
    volt = config["amplifier"]["gain"] / config["specimen"]["layer_thickness"]  # V/m per V of the unit
    asked = {"device": "usb", "config": config}
else:
    asked = {"set": {"device.domains": 16}}


def outputs():
    """[(time of day in s, V/m)] of the unit."""
    rows = [line.split() for line in open(f"{options.folder}/output.log") if line.endswith("\n")]
    return [(float(row[1]), float(row[2]) * volt) for row in rows]


stopped, broken = 0, []
for _ in range(options.runs):
    begin_run(protocol=protocol(60, 1000), **asked)
    while options.emulator and (not outputs() or outputs()[-1][1] < 0.99 * LEVEL):
        time.sleep(0.02)
        if (status := call("run.status")["result"])["state"] != "running":
            raise SystemExit(f"the run broke off: {status['reason']}")
    start = first_sample()
    time.sleep(random.uniform(0, 0.1))  # anywhere in a piece
    if options.hanging_disk:
        open(disk_hangs, "w").close()
        time.sleep(0.2)  # until what writes every 50 ms has met it
        on_disk = call("run.status")["result"]["rows_on_disk"]
    pressed = time.time()
    begin, reply = timed_abort()
    for _ in range(options.calls // options.runs - 1):
        time.sleep(0.002)
        timed_abort()
    if options.hanging_disk:
        if call("run.status")["result"]["rows_on_disk"] != on_disk:
            raise SystemExit("the disk was to hang, and took samples")
        os.remove(disk_hangs)
    status = wait_for("aborted")
    if not status["reason"].endswith("measured"):
        broken.append(status["reason"])
        continue
    stopped += "result" in reply
    recording = status["recording"]
    if options.emulator:  # a step of eight codes or more
        while not (steps := [at for at, level in outputs() if at > pressed and level < LEVEL - 500]):
            time.sleep(0.02)
        ramps.append(1e3 * (steps[0] - pressed))
    else:
        ramps.append((recording, begin - start))
load.kill()
load.join()


def ramp(recording, stop):
    """From the stop to the ramp, in ms; the ramp begins at the last sample at the program's level."""
    read = call("recording.read", {"name": recording, "max_points": 20000})["result"]
    level = max(read["command"]["first"])
    return 1e3 * (max(t for t, e in zip(read["time"], read["command"]["first"]) if e == level) - stop)


def show(what, values):
    values.sort()
    at = lambda share: values[min(len(values) - 1, int(share * len(values)))]
    print(f"{what}: median {at(0.5):.1f} ms, 99 % {at(0.99):.1f} ms, 99.9 % {at(0.999):.1f} ms, longest {values[-1]:.1f} ms")
    return at(0.999)


print(f"{len(times)} calls of run.abort, {stopped} of them on a run under way; {reports.value} reports meanwhile; load of the "
      f"machine {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
for reason in broken:
    print("a run broke off by itself:", reason)
late = show("to the reply", times) > options.within
late |= show("to the ramp", ramps if options.emulator else [ramp(*each) for each in ramps]) > options.ramp_within
daemon.terminate()
daemon.wait()
raise SystemExit(late)

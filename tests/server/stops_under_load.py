"""How long run.abort takes while others keep the daemon busy.

    python3 stops_under_load.py PROGRAM [--rows N] [--runs N] [--calls N] [--within MS] [--ramp-within MS] [--discover]

8 viewers ask for HTML reports of a long recording, 50 clients subscribe to everything, 64 strangers hold connections and
come again when they are dropped; with --discover a discovery computes on all cores as well. Meanwhile run.abort is called by
HTTP, each time by a new connection: on so many runs under way on the virtual device, and between them. Prints the times from
connecting to the reply, and to the first sample of the ramp to zero (the device gives its samples in pieces of 0.1 s); fails if
the 99.9th percentile of one is above --within or --ramp-within.
"""
import argparse
import http.client
import json
import os
import random
import socket
import subprocess
import tempfile
import threading
import time

parser = argparse.ArgumentParser()
parser.add_argument("program")
parser.add_argument("--rows", type=int, default=2_000_000)
parser.add_argument("--runs", type=int, default=300)
parser.add_argument("--calls", type=int, default=3000)
parser.add_argument("--within", type=float, default=50)
parser.add_argument("--ramp-within", type=float, default=120)  # such a piece, and 20 ms
parser.add_argument("--discover", action="store_true")
options = parser.parse_args()

folder = tempfile.mkdtemp()
token_file = os.path.join(folder, "token")
daemon = subprocess.Popen([options.program, "--data", folder, "serve", "--port", "0", "--token-file", token_file],
                          stdout=subprocess.PIPE, text=True)
for line in daemon.stdout:
    if "JSON-RPC" in line:
        port = int(line.split("://")[1].split("/")[0].split(":")[1])
    if "Ctrl-C" in line:
        break
token = open(token_file).read().strip()
over = threading.Event()


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


rate = 100_000
call("run.start", {"protocol": protocol(options.rows / rate, rate), "fast": True, "set": {"device.domains": 16}})
name = wait_for("complete", "aborted")["recording"]
reports = 0


def view():
    global reports
    while not over.is_set():
        try:
            reply = call("recording.report", {"name": name, "format": "html"})
        except (OSError, http.client.HTTPException):
            if over.is_set():
                return  # the daemon has gone
            raise
        reports += "result" in reply


def listen():
    with socket.socket(socket.AF_UNIX) as s:
        s.connect(os.path.join(folder, "daemon.sock"))
        for topic in ("run", "samples", "events", "job"):
            s.sendall(json.dumps({"jsonrpc": "2.0", "method": "subscribe", "params": {"topic": topic}, "id": 1}).encode() + b"\n")
        s.settimeout(0.5)
        while not over.is_set():
            try:
                s.recv(1 << 16)
            except TimeoutError:
                pass


def crowd():
    there = []
    while not over.is_set():
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
    while not over.is_set():
        job = call("discrepancy.start", {"recordings": [short]})["result"]["job"]
        while not over.is_set() and call("job.status", {"job": job})["result"]["state"] == "running":
            time.sleep(0.5)
        call("job.cancel", {"job": job})


work = [view] * 8 + [listen] * 50 + [crowd]
for what in work:
    threading.Thread(target=what, daemon=True).start()
if options.discover:
    short = discoverable()
    threading.Thread(target=discover, daemon=True).start()
time.sleep(2)

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


stopped = 0
for _ in range(options.runs):
    call("run.start", {"protocol": protocol(60, 1000), "set": {"device.domains": 16}})
    wait_for("running")
    start = first_sample()
    time.sleep(random.uniform(0, 0.1))  # anywhere in a piece
    begin, reply = timed_abort()
    stopped += "result" in reply
    ramps.append((wait_for("aborted")["recording"], begin - start))
    for _ in range(options.calls // options.runs - 1):
        timed_abort()
        time.sleep(0.002)
over.set()


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


print(f"{len(times)} calls of run.abort, {stopped} of them on a run under way; {reports} reports meanwhile; load of the "
      f"machine {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
late = show("to the reply", times) > options.within
late |= show("to the ramp", [ramp(*each) for each in ramps]) > options.ramp_within
daemon.terminate()
daemon.wait()
raise SystemExit(late)

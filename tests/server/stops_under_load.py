"""How long run.abort takes while others keep the daemon busy.

    python3 stops_under_load.py PROGRAM [--rows N] [--calls N] [--within MS]

8 viewers ask for HTML reports of a long recording, 50 clients subscribe to everything, 64 strangers hold connections and
come again when they are dropped. Meanwhile run.abort is called by HTTP, each time by a new connection: on runs under way, and
between them. Prints the times from connecting to the reply; fails if the 99.9th percentile is above --within.
"""
import argparse
import http.client
import json
import os
import socket
import subprocess
import tempfile
import threading
import time

parser = argparse.ArgumentParser()
parser.add_argument("program")
parser.add_argument("--rows", type=int, default=2_000_000)
parser.add_argument("--calls", type=int, default=2000)
parser.add_argument("--within", type=float, default=50)
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


work = [view] * 8 + [listen] * 50 + [crowd]
for what in work:
    threading.Thread(target=what, daemon=True).start()
time.sleep(2)

times = []


def timed_abort():
    begin = time.monotonic()
    reply = call("run.abort", {"reason": "measured"})
    times.append(1e3 * (time.monotonic() - begin))
    return reply


stopped = 0
while len(times) < options.calls:
    call("run.start", {"protocol": protocol(60, 1000), "set": {"device.domains": 16}})
    wait_for("running")
    stopped += "result" in timed_abort()
    wait_for("aborted")
    for _ in range(49):
        timed_abort()
        time.sleep(0.002)
over.set()
times.sort()
at = lambda share: times[min(len(times) - 1, int(share * len(times)))]
print(f"{len(times)} calls of run.abort, {stopped} of them on a run under way; {reports} reports meanwhile")
print(f"median {at(0.5):.1f} ms, 99 % {at(0.99):.1f} ms, 99.9 % {at(0.999):.1f} ms, longest {times[-1]:.1f} ms")
daemon.terminate()
daemon.wait()
raise SystemExit(at(0.999) > options.within)

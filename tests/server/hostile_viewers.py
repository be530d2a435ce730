"""A run is stopped, and the daemon ends, whatever viewers, pictures and files do meanwhile.

    python3 hostile_viewers.py PROGRAM
"""
import base64
import http.client
import json
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

program = sys.argv[1]
folder = pathlib.Path(tempfile.mkdtemp())
token_file = folder / "token"
# A gnuplot that hangs, and does not go when it is asked to.
(folder / "bin").mkdir()
gnuplot = folder / "bin" / "gnuplot"
gnuplot.write_text(f"#!/bin/sh\nls -l /proc/$$/fd >>{folder}/descriptors\necho $$ >>{folder}/pids\ntrap '' TERM INT HUP\n"
                   "while :; do :; done\n")
gnuplot.chmod(0o755)
prompt = 3  # s, on machines that have other things to do; nothing here takes that long by itself


def demand(fine, what):
    if not fine:
        raise SystemExit("FAILED: " + what)


class Daemon:
    def __init__(self, port=0):
        path = f"{folder}/bin:{os.environ['PATH']}"
        self.process = subprocess.Popen(
            [program, "--data", folder / "data", "serve", "--port", str(port), "--token-file", token_file],
            stdout=subprocess.PIPE, text=True, env={**os.environ, "PATH": path})
        for line in self.process.stdout:
            if "JSON-RPC" in line:
                self.port = int(line.split("://")[1].split("/")[0].split(":")[1])
            if "Ctrl-C" in line:
                break
        demand(self.process.poll() is None, "the daemon does not start")
        self.token = token_file.read_text().strip()

    def call(self, method, params=None, timeout=60):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=timeout)
        connection.request("POST", "/rpc", json.dumps({"jsonrpc": "2.0", "method": method, "params": params or {}, "id": 1}),
                           {"Authorization": f"Bearer {self.token}", "Content-Type": "application/json"})
        reply = json.loads(connection.getresponse().read())
        connection.close()
        return reply

    def run(self, seconds, **more):
        program = {"format": "ferrobench-protocol", "version": 1, "name": "hold", "title": "Hold", "unit": "kV/mm",
                   "sample_rate_Hz": 1000, "start": 0,
                   "segments": [{"kind": "ramp", "to": 0.05, "time": 0.01}, {"kind": "hold", "time": seconds},
                                {"kind": "ramp", "to": 0, "time": 0.01}]}
        reply = self.call("run.start", {"protocol": program, "set": {"device.domains": 16}, **more})
        demand("result" in reply, f"no run starts: {reply}")

    def wait_for(self, *states):
        while (status := self.call("run.status")["result"])["state"] not in states:
            time.sleep(0.02)
        return status

    def websocket(self):
        s = socket.create_connection(("127.0.0.1", self.port))
        s.sendall((f"GET /rpc HTTP/1.1\r\nHost: 127.0.0.1:{self.port}\r\nAuthorization: Bearer {self.token}\r\n"
                   "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                   f"Sec-WebSocket-Key: {base64.b64encode(os.urandom(16)).decode()}\r\n\r\n").encode())
        demand(b" 101 " in s.recv(4096), "no WebSocket opens")
        return s

    def local(self):
        s = socket.socket(socket.AF_UNIX)
        s.connect(str(folder / "data" / "daemon.sock"))
        s.settimeout(60)
        return s


def seconds_of(action):
    begin = time.monotonic()
    action()
    return time.monotonic() - begin


def stopped_promptly(daemon, what):
    daemon.run(60)
    daemon.wait_for("running")
    took = seconds_of(lambda: demand("result" in daemon.call("run.abort"), f"{what}: the stop is refused"))
    demand(took < prompt, f"{what}: a stop took {took:.1f} s")
    demand(daemon.wait_for("aborted")["output_at_zero"], f"{what}: the output is not at zero")


def view(daemon, name):
    def ask():
        try:
            daemon.call("recording.report", {"name": name, "format": "html"})
        except OSError:
            pass  # the daemon went
        except http.client.HTTPException:
            pass
    threading.Thread(target=ask, daemon=True).start()


def drawn(count):
    """Waits until so many pictures are being drawn."""
    pids = folder / "pids"
    for _ in range(600):
        if pids.exists() and len(pids.read_text().split()) >= count:
            return [int(pid) for pid in pids.read_text().split()]
        time.sleep(0.05)
    raise SystemExit("FAILED: no picture is drawn")


def lives(pid):
    try:
        return ") Z " not in pathlib.Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False


def gone(pids, what):
    until = time.monotonic() + prompt
    while any(lives(pid) for pid in pids):
        demand(time.monotonic() < until, f"{what}: gnuplot lives on")
        time.sleep(0.02)


try:
    daemon = Daemon()
    daemon.run(2, fast=True)
    name = daemon.wait_for("complete")["recording"]

    for i in range(8):
        view(daemon, name)
    pids = drawn(2)
    stopped_promptly(daemon, "pictures that hang")
    demand("socket:" not in (folder / "descriptors").read_text(), "gnuplot inherits a socket")
    took = seconds_of(lambda: (daemon.process.terminate(), daemon.process.wait()))
    demand(took < prompt, f"with pictures that hang, SIGTERM took {took:.1f} s")
    gone(pids, "SIGTERM")

    (folder / "pids").unlink()
    daemon = Daemon(daemon.port)
    view(daemon, name)
    pids = drawn(1)
    daemon.process.kill()
    daemon.process.wait()
    gone(pids, "SIGKILL")
    daemon = Daemon(daemon.port)

    for place in ("models/pipe.json", "recordings/pipe.h5", "recordings/other.h5.journal"):
        os.mkfifo(folder / "data" / place)
    os.symlink("/dev/zero", folder / "data" / "models" / "endless.json")
    for method in ("model.list", "recording.list", "recording.recover"):
        took = seconds_of(lambda: demand("result" in daemon.call(method), f"pipes: {method} fails"))
        demand(took < prompt, f"pipes: {method} took {took:.1f} s")

    crowd = [daemon.websocket() for _ in range(64)]
    took = seconds_of(lambda: daemon.call("run.abort"))
    demand("error" in daemon.call("run.abort"), "a full house: the stop is refused")  # there is no run to stop
    demand(took < prompt, f"a full house: a stop took {took:.1f} s")
    crowd += [daemon.local() for _ in range(100)]
    last = daemon.local()
    last.sendall(b'{"jsonrpc":"2.0","method":"run.status","id":1}\n')
    demand(b'"result"' in last.recv(65536), "a full Unix socket: run.status is refused")
    for s in crowd:
        s.close()
    time.sleep(0.2)

    for _ in range(80):  # viewers who do not wait for what they asked for
        connection = http.client.HTTPConnection("127.0.0.1", daemon.port)
        connection.request("POST", "/rpc", json.dumps({"jsonrpc": "2.0", "method": "recording.report",
                                                       "params": {"name": name, "format": "html"}, "id": 1}),
                           {"Authorization": f"Bearer {daemon.token}", "Content-Type": "application/json"})
        connection.close()
    stopped_promptly(daemon, "viewers who left")
    demand(daemon.call("limits.set", {"stop_slew": 1})["error"]["data"]["problems"][0]["path"] == "/stop_slew",
           "a stop may take weeks")
    took = seconds_of(lambda: (daemon.process.send_signal(signal.SIGTERM), daemon.process.wait()))
    demand(took < prompt, f"SIGTERM took {took:.1f} s")
finally:
    daemon.process.kill()
    shutil.rmtree(folder, ignore_errors=True)

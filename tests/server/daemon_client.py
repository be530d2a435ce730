"""What the tests in Python share: a client of the daemon at its Unix socket, and the bench processes of a data folder."""

import json
import os
import socket
import time


class Refused(Exception):
    """The daemon answered with an error, which is this exception's only argument."""


class Client:
    """A connection that stays. Notifications that come between are given to `heard`."""

    def __init__(self, data, seconds=30, heard=lambda message: None):
        self.seconds, self.heard = seconds, heard
        self.calls, self.bytes = 0, b""
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(seconds)
        self.socket.connect(f"{data}/daemon.sock")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def message(self, seconds):
        """The next message, or None if none comes in that time. OSError if the daemon has closed the connection."""
        end = time.monotonic() + seconds
        while b"\n" not in self.bytes:
            left = end - time.monotonic()
            if left <= 0:
                return None
            self.socket.settimeout(left)
            try:
                more = self.socket.recv(1 << 20)
            except TimeoutError:
                return None
            if not more:
                raise OSError("the daemon has closed the connection")
            self.bytes += more
        line, self.bytes = self.bytes.split(b"\n", 1)
        message = json.loads(line)
        if "method" in message:
            self.heard(message)
        return message

    def call(self, method, **params):
        """The result. Refused; OSError if there is no answer in time, or no daemon."""
        self.calls += 1
        request = {"jsonrpc": "2.0", "id": self.calls, "method": method, "params": params}
        self.socket.sendall(json.dumps(request).encode() + b"\n")
        end = time.monotonic() + self.seconds
        while message := self.message(end - time.monotonic()):
            if message.get("id") == self.calls:
                if "result" not in message:
                    raise Refused(message["error"])
                return message["result"]
        raise TimeoutError(f"{method} is not answered within {self.seconds} s")


def ask(data, method, seconds=30, **params):
    """The result of one call, by a connection of its own."""
    with Client(data, seconds) as client:
        return client.call(method, **params)


def answers(data):
    """Whether a daemon answers there."""
    try:
        return bool(ask(data, "system.info"))
    except OSError:
        return False


def bench_processes(data):
    """The processes that hold the voltage for this data folder; those of a server that has died, too. The oldest is first."""
    out = []
    for name in os.listdir("/proc"):
        try:
            if (open(f"/proc/{name}/cmdline", "rb").read().startswith(b"ferrobench: holds the voltage")
                    and f"FERROBENCH_DATA={data}\0".encode() in open(f"/proc/{name}/environ", "rb").read()):
                out.append((os.stat(f"/proc/{name}").st_ctime, int(name)))
        except OSError:
            pass
    return [process for _, process in sorted(out)]

"""A connection to the daemon over which calls go out, and replies and notifications come back.

Over the Unix socket of a daemon on this machine a message is a line; to other machines it is a text frame of a WebSocket
(RFC 6455). Nothing but the standard library is used.
"""
from __future__ import annotations

import base64
import collections
import hashlib
import http.client
import json
import os
import select
import socket
import ssl
import struct
import time
import urllib.parse
from collections.abc import Callable
from typing import Any

from . import api
from ._errors import ConnectionLost, Error, problem_of

# The daemon gives up a client that does not take its reply for 30 s; connecting takes no longer.
CONNECT_TIMEOUT = 10.0  # s


def failure_of(error: dict[str, Any]) -> Error:
    """The exception for a JSON-RPC error or a refusal {name, message, hint}."""
    data = error.get("data") or {}
    kind = api.ERRORS.get(data.get("name", error.get("name", "")))
    if kind is None:  # of JSON-RPC itself: -32600, -32601, -32700
        kind = next((e for e in api.ERRORS.values() if e.code == error.get("code")), Error)
    problems = [problem_of(p) for p in data.get("problems", [])]
    if hint := data.get("hint", error.get("hint")):
        problems.append(problem_of({"hint": hint}))
    return kind(data.get("message", error.get("message", "the daemon gave no reason")), problems)


def written(message: dict[str, Any]) -> str:
    """As JSON; numbers and arrays of numpy as numbers and lists."""
    try:
        return json.dumps(message, allow_nan=False, default=lambda value: value.tolist())
    except ValueError:
        raise api.InvalidParams("a number that was given is not finite") from None
    except AttributeError as error:
        raise api.InvalidParams(f"what was given cannot be written as JSON: {error}") from None


class UnixSocket:
    """Messages as lines."""

    def __init__(self, path: str):
        self._path, self._socket, self._bytes = path, socket.socket(socket.AF_UNIX, socket.SOCK_STREAM), b""
        self._socket.settimeout(CONNECT_TIMEOUT)
        try:
            self._socket.connect(path)
        except OSError as error:
            self._socket.close()
            raise ConnectionLost(f"no daemon answers at {path}: {error.strerror or error}", [problem_of({
                "hint": "start one with 'ferrobench serve', or give connect() its data folder or its address"})]) from None

    def send(self, text: str) -> None:
        self._socket.settimeout(None)
        self._socket.sendall(text.encode() + b"\n")

    def receive(self, timeout: float | None) -> str | None:
        """The next message; None if none comes in time. EOFError: the other side is gone."""
        end = None if timeout is None else time.monotonic() + timeout
        while b"\n" not in self._bytes:
            if not readable(self._socket, end):
                return None
            more = self._socket.recv(1 << 18)
            if not more:
                raise EOFError
            self._bytes += more
        line, _, self._bytes = self._bytes.partition(b"\n")
        return line.decode()

    def close(self) -> None:
        self._socket.close()


class WebSocket:
    """Messages as text frames. Pings are answered while a message is waited for."""

    def __init__(self, url: str, token: str, context: ssl.SSLContext | None):
        self._bytes = b""
        self._parts: list[bytes] = []
        key = base64.b64encode(os.urandom(16)).decode()
        self._http = open_http(url, context)
        try:
            self._http.request("GET", "/rpc", headers={
                "Authorization": f"Bearer {token}", "Connection": "Upgrade", "Upgrade": "websocket",
                "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": key})
            # Its buffer takes no bytes of a frame: the daemon says nothing before it is asked.
            reply = self._http.getresponse()
        except (OSError, http.client.HTTPException) as error:
            self._http.close()
            raise ConnectionLost(f"no daemon answers at {url}: {error}") from None
        accept = base64.b64encode(hashlib.sha1((key + "258EAFA5-E914-47DA-95CA-C5AB0DC85B11").encode()).digest()).decode()
        if reply.status != 101 or reply.getheader("Sec-WebSocket-Accept") != accept:
            refusal = read_refusal(reply)
            self._http.close()
            raise refusal
        self._socket = self._http.sock

    def send(self, text: str) -> None:
        self._frame(1, text.encode())

    def _frame(self, kind: int, body: bytes) -> None:
        size = len(body)
        head = bytes([0x80 | kind])
        head += bytes([0x80 | size]) if size < 126 else struct.pack("!BH", 0x80 | 126, size) if size < 1 << 16 \
            else struct.pack("!BQ", 0x80 | 127, size)
        mask = os.urandom(4)
        whole = int.from_bytes(body, "big") ^ int.from_bytes((mask * (size // 4 + 1))[:size], "big")
        self._socket.settimeout(None)
        self._socket.sendall(head + mask + whole.to_bytes(size, "big"))

    def _need(self, count: int, end: float | None) -> bool:
        while len(self._bytes) < count:
            if not readable(self._socket, end):
                return False
            more = self._socket.recv(1 << 18)
            if not more:
                raise EOFError
            self._bytes += more
        return True

    def receive(self, timeout: float | None) -> str | None:
        end = None if timeout is None else time.monotonic() + timeout
        while True:
            # Bytes are taken away by the whole frame, so that a wait may end anywhere within one.
            if not self._need(2, end):
                return None
            size, start = self._bytes[1] & 0x7F, 2
            if size >= 126:
                start = 4 if size == 126 else 10
                if not self._need(start, end):
                    return None
                size = int.from_bytes(self._bytes[2:start], "big")
            if not self._need(start + size, end):
                return None
            first, body = self._bytes[0], self._bytes[start:start + size]
            self._bytes = self._bytes[start + size:]
            kind = first & 0x0F
            if kind == 8:
                raise EOFError
            if kind == 9:
                self._frame(10, body)
            if kind in (0, 1):
                self._parts.append(body)
                if first & 0x80:
                    text = b"".join(self._parts).decode()
                    self._parts = []
                    return text

    def close(self) -> None:
        try:
            self._frame(8, struct.pack("!H", 1000))
        except OSError:
            pass
        self._http.close()


def readable(source: socket.socket, end: float | None) -> bool:
    """Waits until there is something to receive, or until `end`. TLS may have taken it off the socket already."""
    if isinstance(source, ssl.SSLSocket) and source.pending():
        return True
    left = None if end is None else max(0.0, end - time.monotonic())
    return bool(select.select([source], [], [], left)[0])


def open_http(url: str, context: ssl.SSLContext | None) -> http.client.HTTPConnection:
    """Connected, or ConnectionLost."""
    parts = urllib.parse.urlsplit(url)
    host, port = parts.hostname or "", parts.port
    connection = (http.client.HTTPSConnection(host, port or 443, timeout=CONNECT_TIMEOUT, context=context)
                  if parts.scheme == "https" else http.client.HTTPConnection(host, port or 80, timeout=CONNECT_TIMEOUT))
    try:
        connection.connect()
    except OSError as error:
        raise ConnectionLost(f"no daemon answers at {url}: {error}", [problem_of({
            "hint": "see whether the daemon runs, which address it listens at, and which certificate it shows"})]) from None
    return connection


def read_refusal(reply: http.client.HTTPResponse) -> Error:
    """The exception for a reply that is not the one hoped for."""
    try:
        return failure_of(json.loads(reply.read()))
    except (ValueError, OSError, AttributeError):
        return ConnectionLost(f"what answers there is no ferrobench daemon (HTTP status {reply.status})")


class Connection:
    """Calls, and the notifications that come between their replies. One thread at a time.

    `open_line` makes the line of messages: when first needed, and again when the daemon has closed it meanwhile (one that
    is silent for a minute is closed). `greet` is called with each new line, before anything else is asked. A subscription ends
    with its line, so where there is one (`subscribed`) a line that was closed is an error.
    """

    subscribed = False

    def __init__(self, open_line: Callable[[], UnixSocket | WebSocket], greet: Callable[[Callable[..., Any]], None] | None = None):
        self._open, self._greet = open_line, greet
        self._line: Any = None  # None: not open
        self._last = 0  # number of the last call
        self.notifications: collections.deque[tuple[str, dict[str, Any]]] = collections.deque()

    def call(self, method: str, params: dict[str, Any], timeout: float | None = None) -> Any:
        """The result, or the Error that the daemon answers. Raises ConnectionLost if it goes away."""
        self._be_open()
        try:
            return self._ask(method, params, timeout)
        except TimeoutError:
            raise
        except (EOFError, OSError) as error:
            self.close()
            if method not in api.VIEWING:
                raise ConnectionLost(f"the daemon went away during {method}, which may have been carried out",
                                     [problem_of({"hint": "ask for run.status, and look at the daemon's log"})]) from error
        self._be_open()  # what only looks is asked once more
        try:
            return self._ask(method, params, timeout)
        except (EOFError, OSError) as error:
            self.close()
            raise ConnectionLost(f"the daemon went away during {method}") from error

    def _be_open(self) -> None:
        if self._line is not None:
            try:
                while (text := self._line.receive(0)) is not None:
                    self._take(json.loads(text))
                return
            except (EOFError, OSError):
                self.close()
        if self.subscribed:
            raise ConnectionLost("the daemon has closed the connection of a subscription", [problem_of({
                "hint": "read what comes, or subscribe again"})])
        self._line = self._open()
        if self._greet:
            self._greet(self._ask)

    def _ask(self, method: str, params: dict[str, Any], timeout: float | None = None) -> Any:
        self._last += 1
        mine = self._last
        text = written({"jsonrpc": "2.0", "id": mine, "method": method, "params": params})
        end = None if timeout is None else time.monotonic() + timeout
        try:
            self._line.send(text)
            while True:
                text = self._line.receive(None if end is None else max(0.0, end - time.monotonic()))
                if text is None:
                    raise TimeoutError(f"no reply to {method} within {timeout} s")
                reply = json.loads(text)
                if reply.get("id") == mine or ("error" in reply and reply.get("id") is None):
                    break
                self._take(reply)  # or the reply to a call that was waited for in vain, which is passed over
        except KeyboardInterrupt:
            self.close()  # anywhere in a message: the next call has a connection of its own
            raise
        if "error" in reply:
            raise failure_of(reply["error"])
        return reply["result"]

    def _take(self, message: dict[str, Any]) -> None:
        if "method" in message:
            self.notifications.append((message["method"], message.get("params", {})))

    def next(self, timeout: float | None) -> tuple[str, dict[str, Any]] | None:
        """The next notification (topic, params); None if none comes in time. "gap" {topic, lost} tells what was missed."""
        end = None if timeout is None else time.monotonic() + timeout
        while not self.notifications:
            try:
                text = self._line.receive(None if end is None else max(0.0, end - time.monotonic()))
            except (EOFError, OSError) as error:
                self.close()
                raise ConnectionLost("the daemon went away") from error
            if text is None:
                return None
            self._take(json.loads(text))
        return self.notifications.popleft()

    def close(self) -> None:
        if self._line is not None:
            self._line.close()
            self._line = None

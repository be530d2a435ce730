"""The bench: a ferrobench daemon, on this machine or another one."""
from __future__ import annotations

import json
import os
import pathlib
import shutil
import ssl
import tempfile
import threading
import urllib.parse
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from . import api
from ._connection import Connection, UnixSocket, WebSocket, open_http, read_refusal
from ._errors import ConnectionLost, Error, Problem
from .recording import Recording
from .run import INTERRUPTED, HeldInterrupt, Job, Progress, Run
from .table import Table


def _data_folder(given: str | os.PathLike | None) -> pathlib.Path:
    return pathlib.Path(given or os.environ.get("FERROBENCH_DATA") or "~/.local/share/ferrobench").expanduser()


def _token(file: str | os.PathLike | None) -> str:
    state = pathlib.Path(os.environ.get("XDG_STATE_HOME") or "~/.local/state").expanduser()
    path = pathlib.Path(file) if file else state / "ferrobench" / "token"
    try:
        return path.expanduser().read_text().strip()
    except OSError as error:
        raise api.Unauthorized(f"the token cannot be read from {path}: {error.strerror}", [Problem(
            hint="copy the daemon's token file here (mode 0600), and name it by token_file=")]) from None


def connect(url: str | None = None, *, data: str | os.PathLike | None = None, token_file: str | os.PathLike | None = None,
            ca: str | os.PathLike | None = None) -> "Bench":
    """A bench. Without arguments: the daemon of this user on this machine.

    Parameters
    ----------
    url
        of a daemon on another machine: "https://bench.lab:8377", or "http://127.0.0.1:8377" through a tunnel
    data
        without a url: the daemon's data folder; default FERROBENCH_DATA, else ~/.local/share/ferrobench
    token_file
        with a url: the daemon's token; default ~/.local/state/ferrobench/token
    ca
        with https: PEM file of the certificate that the daemon's is signed by; default: what the system trusts

    Raises
    ------
    ConnectionLost
        no daemon answers there
    Unauthorized
        the token is wrong or missing
    """
    if url is None:
        socket = _data_folder(data) / "daemon.sock"
        bench = Bench(lambda: UnixSocket(os.fspath(socket)))
    else:
        parts = urllib.parse.urlsplit(url)
        loopback = parts.hostname in ("127.0.0.1", "localhost", "::1")
        if parts.scheme not in ("http", "https") or not parts.hostname:
            raise api.InvalidParams(f"{url!r} is no address of a daemon", [Problem(hint='for example "https://bench.lab:8377"')])
        if parts.scheme == "http" and not loopback:
            raise api.InvalidParams(f"{url} would carry the token in plain text", [Problem(
                hint="use https, or a tunnel: ssh -L 8377:127.0.0.1:8377 HOST")])
        site, token = url, _token(token_file)
        context = ssl.create_default_context(cafile=ca) if parts.scheme == "https" else None
        bench = Bench(lambda: WebSocket(site, token, context), remote=(site, token, context))
    try:
        bench.methods.system.info()
    except BaseException:
        bench.close()
        raise
    return bench


class Lease:
    """The right to be the only one who controls, while the block goes on. Renewed in the background."""

    def __init__(self, bench: "Bench", duration: float, stop_run: bool):
        self._bench, self._duration = bench, duration
        told = bench.methods.lease.acquire(duration_s=duration, stop_run=stop_run)
        self.id: str = told["lease"]
        self.lost: Error | None = None
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._renew, name="ferrobench lease", daemon=True)
        self._thread.start()

    def _renew(self) -> None:
        # A connection of its own: a long call on the other one keeps nobody from renewing. A third of the time leaves two
        # more attempts before the lease runs out.
        connection = self._bench.new_connection()
        tries = 0
        while not self._done.wait(self._duration / 3):
            try:
                connection.call("lease.renew", {"lease": self.id, "duration_s": self._duration}, timeout=self._duration / 3)
                tries = 0
            except (Error, OSError) as error:
                tries += 1
                if isinstance(error, api.NotController) or tries == 3:
                    self.lost = error if isinstance(error, Error) else ConnectionLost(str(error))
                    break
        connection.close()

    def release(self) -> None:
        self._done.set()
        self._thread.join()
        self._bench._lease = None
        if self.lost is None:
            self._bench.call("lease.release", lease=self.id)

    def __enter__(self) -> "Lease":
        return self

    def __exit__(self, kind, error, trace) -> None:
        try:
            self.release()
        except Error:
            if kind is None:
                raise


class Bench:
    """A connection to a daemon; `connect()` makes one. For one thread; other threads connect for themselves.

    Attributes
    ----------
    methods : api.Methods
        every method of the daemon as it is: bench.methods.run.start(protocol="full-loops", set={"rate": 10})
    """

    def __init__(self, open_line: Callable[[], UnixSocket | WebSocket], remote: tuple[str, str, ssl.SSLContext | None] | None = None):
        self._open_line, self._remote = open_line, remote
        self._lease: Lease | None = None
        self._connection = self.new_connection()
        self._downloads: tempfile.TemporaryDirectory | None = None
        self.methods = api.Methods(self._call)

    # What is asked and how.

    def _call(self, method: str, params: Mapping[str, Any]) -> Any:
        if self._lease and self._lease.lost and method not in api.VIEWING:
            raise api.NotController("the lease was lost", [Problem(message=str(self._lease.lost), hint="acquire it again")])
        return self._connection.call(method, {key: value for key, value in params.items() if value is not None})

    def call(self, method: str, **params: Any) -> Any:
        """Any method by name: bench.call("run.status"). None leaves a parameter to the daemon."""
        return self._call(method, params)

    def new_connection(self) -> Connection:
        """One more connection of the same rights, for another thread or for subscriptions."""
        return Connection(self._open_line, self._present)

    def _present(self, ask: Callable[..., Any]) -> None:
        if self._lease and not self._lease.lost:
            try:
                ask("lease.present", {"lease": self._lease.id})
            except api.NotController as error:
                self._lease.lost = error  # told by the next call that controls

    def subscribed(self, *topics: str, max_rate: float | None = None) -> Connection:
        """A connection of its own on which the notifications of these topics come. `max_rate` is that of "samples" [Hz]."""
        connection = self.new_connection()
        try:
            for topic in topics:
                rate = {"max_rate_Hz": max_rate} if max_rate is not None and topic == "samples" else {}
                connection.call("subscribe", {"topic": topic, **rate})
                connection.subscribed = True
        except BaseException:
            connection.close()
            raise
        return connection

    def listen(self, *topics: str, timeout: float | None = None) -> Iterator[tuple[str, dict[str, Any]]]:
        """Notifications (topic, what it says) as they come: for topic, told in bench.listen("events", "run").

        api.TOPICS has the topics; "gap" {topic, lost} tells of messages that were dropped because they were not read in time.
        Ends when none comes for `timeout` [s].
        """
        connection = self.subscribed(*topics)
        try:
            while (message := connection.next(timeout)) is not None:
                yield message
        finally:
            connection.close()

    def control(self, duration: float = 60.0, stop_run: bool = False) -> Lease:
        """The lease: while the block goes on nobody else may start runs or change anything.

            with bench.control(stop_run=True):
                bench.run("full-loops", rate=10)

        It is renewed in the background and given back at the end of the block.

        Parameters
        ----------
        duration
            [s] without renewal, after which it runs out: how long a program that crashed keeps others away
        stop_run
            if it runs out, the run under way is stopped safely

        Raises
        ------
        NotController
            somebody else holds it
        """
        self._lease = Lease(self, duration, stop_run)
        return self._lease

    # Runs.

    def start(self, protocol: str | Mapping[str, Any] | os.PathLike, *, device: str | None = None,
              config: Mapping[str, Any] | None = None, model: str | Mapping[str, Any] | None = None, fast: bool | None = None,
              seed: int | None = None, notes: str | None = None, set: Mapping[str, Any] | None = None, live: bool = False,
              **settings: Any) -> Run:
        """Checks a field program against the limits, starts it and returns at once.

        Parameters
        ----------
        protocol
            name of a protocol (see protocols()), a protocol as a dictionary, or a pathlib.Path of its JSON file
        device
            "virtual" (default), "usb", "replay:NAME", or the id of an open device
        config
            of a device that is opened for this run
        model
            of the virtual device: name, or a model as a dictionary
        fast
            virtual device and replay: as fast as it can go, not in real time
        seed
            of the virtual device's noise: the same seed gives the same bytes
        notes
            kept in the recording
        set
            settings whose names are no Python names: {"material.barrier": ...}
        live
            samples() gives all samples, from the first one
        **settings
            parameters of the protocol, and prestress_MPa, prestress_Pa [Pa], spring_stiffness_N_per_m, sample_rate_Hz

        Raises
        ------
        LimitExceeded
            the program goes beyond what the guard lets pass; nothing was started
        Busy
            another run is under way
        InvalidParams, NotFound, BadProtocol, BadModel, DeviceUnavailable, InterlockOpen, NotController, ...
        """
        if isinstance(protocol, os.PathLike):
            protocol = _json_file(protocol)
        connection = self.subscribed("run", "samples") if live else None
        try:
            with HeldInterrupt() as interrupt:
                # With a key the start can be told again without a second run, should the daemon's reply get lost.
                status = self._start(protocol=protocol, device=device, config=config, model=model, fast=fast, seed=seed,
                                     notes=notes, set={**(set or {}), **settings} or None, idempotency_key=uuid.uuid4().hex)
        except BaseException:
            if connection:
                connection.close()
            raise
        run = Run(self, status, connection)
        if interrupt.came:
            run.stop(INTERRUPTED)
            raise KeyboardInterrupt
        return run

    def _start(self, **params: Any) -> api.RunStatus:
        try:
            return self.methods.run.start(**params)
        except ConnectionLost:
            return self.methods.run.start(**params)

    def run(self, protocol: str | Mapping[str, Any] | os.PathLike, *, progress: Progress = None, **settings: Any) -> Recording:
        """Plays a field program and returns its recording: bench.run("full-loops", rate=10, prestress_MPa=8).

        Takes what start() takes. Ctrl-C stops the run safely, with the output at zero, before KeyboardInterrupt goes on.

        Parameters
        ----------
        progress
            True or False: a line on stderr, or none; a function: is called with each status; default: a line on a terminal

        Raises
        ------
        RunFailed
            the run was aborted; and whatever start() raises
        """
        with self.start(protocol, **settings) as run:
            return run.wait(progress)

    def replay(self, recording: str | Recording, *, speed: float | None = None, fast: bool | None = None,
               progress: Progress = None, **more: Any) -> Recording:
        """Runs a recording of this bench again as it was measured, into a new recording; parameters as methods.replay.start."""
        status = self.methods.replay.start(_name(recording), speed=speed, fast=fast, **more)
        with Run(self, status) as run:
            return run.wait(progress)

    @property
    def status(self) -> api.RunStatus:
        """Of the latest run."""
        return self.methods.run.status()

    # What is there.

    def recording(self, name: str) -> Recording:
        """A recording by its name. Its file is read where it is, or fetched if the daemon is on another machine."""
        info = self.methods.recording.info(name)
        if info["status"] == "running":
            raise api.BadState(f"{name} has no file yet, which is made at the end of its run", [Problem(
                hint="Run.wait() waits for it, Run.samples() has what comes, methods.recording.read what has come; where the run "
                     "broke off, methods.recording.recover makes it")])
        path = pathlib.Path(info["path"])
        if self._remote:
            path = self._fetch(name)
        return Recording(path, self, name)

    def _fetch(self, name: str) -> pathlib.Path:
        assert self._remote
        url, token, context = self._remote
        if self._downloads is None:
            self._downloads = tempfile.TemporaryDirectory(prefix="ferrobench-")
        target = pathlib.Path(self._downloads.name) / f"{name}.h5"
        connection = open_http(url, context)
        try:
            connection.request("GET", "/recordings/" + urllib.parse.quote(name + ".h5"),
                               headers={"Authorization": f"Bearer {token}"})
            reply = connection.getresponse()
            if reply.status != 200:
                raise read_refusal(reply)
            with open(target, "wb") as file:
                shutil.copyfileobj(reply, file)
            if reply.length:
                raise ConnectionLost(f"the connection broke while {name} was fetched", [Problem(hint="ask for it again")])
        except OSError as error:
            if isinstance(error, Error):
                raise
            raise ConnectionLost(f"{name} could not be fetched: {error}") from None
        finally:
            connection.close()
        return target

    def recordings(self) -> Table:
        """The recordings of this bench, newest first: name, title, status, rows, duration [s], start, protocol, model."""
        return _table("recordings", self.methods.recording.list()["recordings"],
                      {"name": "", "title": "", "status": "", "rows": "", "duration_s": "s", "start_time": "", "protocol": "",
                       "model": ""})

    def protocols(self) -> Table:
        """The field programs that start() knows by name, with the parameters that can be set."""
        return _table("protocols", self.methods.protocol.list()["protocols"], {"name": "", "title": "", "parameters": "", "unit": ""})

    def models(self) -> Table:
        """The models that are known by name."""
        return _table("models", self.methods.model.list()["models"], {"name": "", "title": "", "notes": ""})

    def effects(self) -> Table:
        """The catalogue of effects that a model may hold beside its physics, with parameters, units and plausible ranges."""
        def in_words(p: api.ModelEffectsEffectParameter) -> str:
            return f"{p['name']} [{p['unit']}] {p['low']:g} to {p['high']:g}"

        rows = [dict(e.items()) | {"parameters": ", ".join(map(in_words, e["parameters"]))}
                for e in self.methods.model.effects()["effects"]]
        return _table("effects", rows, {"id": "", "family": "", "equation": "", "parameters": "", "shows": ""})

    @property
    def limits(self) -> api.Limits:
        """What the guard lets pass; set by bench.methods.limits.set(field_max=1.8e6)."""
        return self.methods.limits.get()

    # Models.

    def simulate(self, recording: str | Recording, model: str | Mapping[str, Any] | None = None, *, progress: Progress = None,
                 **more: Any) -> Recording:
        """Plays a recording's field through a model, without noise, into a new recording."""
        job = Job(self, self.methods.model.simulate(_name(recording), model=model, **more))
        return self.recording(job.wait(progress)["recording"])

    def fit(self, recordings: Sequence[str | Recording], model: str | Mapping[str, Any] | None = None, *,
            progress: Progress = None, **more: Any) -> dict[str, Any]:
        """Fits a model to recordings; parameters as methods.model.fit (free, starts, iterations, name, ...).

        Returns the fit as the daemon gives it: its "model" is one for start() or simulate().
        """
        return Job(self, self.methods.model.fit(recordings=[_name(r) for r in recordings], model=model, **more)).wait(progress)

    def discover(self, recordings: Sequence[str | Recording], model: str | Mapping[str, Any] | None = None, *,
                 progress: Progress = None, **more: Any) -> api.DiscrepancyResult:
        """Finds what a model misses in recordings, names it, and proves it on recordings that were locked away."""
        job = Job(self, self.methods.discrepancy.start(recordings=[_name(r) for r in recordings], model=model, **more))
        job.wait(progress)
        found = self.methods.discrepancy.result(job.id)
        assert not isinstance(found, str)  # only in another format
        return found

    def published_table(self, table: str, recordings: Sequence[str | Recording] | None = None, *, progress: Progress = None,
                        **more: Any) -> Table:
        """A table of the source ("3.11") beside the same cells measured: in recordings, or by its experiments run anew."""
        if recordings is not None:
            return Table(self.methods.table.compare(table, [_name(r) for r in recordings]))
        return _compared(Job(self, self.methods.table.run(table, **more)).wait(progress))

    def close(self) -> None:
        """Closes the connection and removes what was fetched. Runs and jobs go on."""
        self._connection.close()
        if self._downloads is not None:
            self._downloads.cleanup()
            self._downloads = None

    def __enter__(self) -> "Bench":
        return self

    def __exit__(self, *_) -> None:
        self.close()


def _name(recording: str | Recording) -> str:
    return recording.name if isinstance(recording, Recording) else recording


def _table(title: str, rows: Sequence[Mapping[str, Any]], units: dict[str, str]) -> Table:
    return Table({"title": title, "columns": [{"key": key, "title": key.removesuffix("_s").replace("_", " "), "unit": unit}
                                              for key, unit in units.items()], "rows": rows})


def _compared(told: dict[str, Any]) -> Table:
    """What table.run gives, in the columns of table.compare."""
    rows = [{**cell, "error_percent": None if cell["error"] is None else 100 * cell["error"]} for cell in told["cells"]]
    ours = ("quantity", "measured", "measured_uncertainty", "published", "error", "error_percent", "doubtful", "clipped")
    where = [key for key in rows[0] if key not in ours] if rows else []
    columns = [{"key": key} for key in ["quantity", *where]]
    columns += [{"key": "measured", "uncertainty": "measured_uncertainty"}, {"key": "published"},
                {"key": "error_percent", "title": "error", "unit": "%"}, {"key": "doubtful", "title": "print doubtful"}]
    return Table({"title": told["title"], "columns": columns, "rows": rows})


def _json_file(path: str | os.PathLike) -> dict[str, Any]:
    try:
        return json.loads(pathlib.Path(path).read_text())
    except OSError as error:
        raise api.NotFound(f"{path} cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise api.BadProtocol(f"{path} is not JSON: {error}") from None

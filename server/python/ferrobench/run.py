"""Runs and jobs that are under way, and the samples that go by."""
from __future__ import annotations

import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Union

import numpy as np

from . import api
from ._errors import ConnectionLost, Problem, RunFailed, problem_of
from .units import Channel

if TYPE_CHECKING:
    from ._connection import Connection
    from .bench import Bench
    from .recording import Recording

# None: a line on a terminal or in a notebook, nothing elsewhere. A function is given each status.
Progress = Union[None, bool, Callable[[dict[str, Any]], None]]

UNITS = {"time": "s", "command": "V/m", "field": "V/m", "charge": "C", "displacement": "m", "force": "N"}
INTERRUPTED = "Ctrl-C in Python"  # what a recording says of why its run was stopped
_OVER = ("complete", "aborted")
# Short runs are asked about often; nobody sees the difference of half a second in a long one.
_FIRST_WAIT, _LONGEST_WAIT = 0.02, 0.5  # s


class HeldInterrupt:
    """While it lasts Ctrl-C is only noted (`came`), so that a start ends in a run that can be stopped. A second one goes through."""

    came = False

    def __enter__(self) -> "HeldInterrupt":
        self._before: Any = signal.getsignal(signal.SIGINT) if threading.current_thread() is threading.main_thread() else None
        if callable(self._before):
            signal.signal(signal.SIGINT, self._note)
        return self

    def _note(self, number, frame) -> None:
        if self.came:
            self._before(number, frame)
        self.came = True

    def __exit__(self, *_) -> None:
        if callable(self._before):
            signal.signal(signal.SIGINT, self._before)


class Watch:
    """Tells of each status: by a line that is redrawn, or by the function that the caller gave."""

    def __init__(self, progress: Progress):
        self._tell: Callable[[dict[str, Any]], None] | None = progress if callable(progress) else None
        self._line = progress is True or (progress is None and (sys.stderr.isatty() or "ipykernel" in sys.modules))
        self._open = False

    def show(self, status: Any) -> None:
        if self._tell:
            self._tell(status)
        elif self._line:
            left = status.get("time_left_s")
            text = f"{status.get('stage') or status['state']} {100 * status['progress']:3.0f} %"
            print(f"\r{text}{'' if left is None else f', {left:.0f} s left'}".ljust(60), end="", file=sys.stderr, flush=True)
            self._open = True

    def end(self) -> None:
        if self._open:
            print(file=sys.stderr)


class Samples:
    """What came since the last one, joined into at most 200 stretches of rows.

    Attributes
    ----------
    time : Channel
        [s] of the first row of each stretch
    lost : int
        messages that were dropped before this one, because they were not read in time; the recording has all rows

    `samples["displacement"]` is the first value of each stretch, `samples.low[...]` and `samples.high[...]` the smallest and the
    largest. SI units.
    """

    def __init__(self, columns: dict[str, Any], lost: int):
        def column(name: str, values: list) -> Channel:
            return Channel(name, UNITS[name], np.array([np.nan if v is None else v for v in values], float))

        self.lost = lost
        self.time = column("time", columns["time"])
        parts = {name: value for name, value in columns.items() if isinstance(value, dict)}
        self._first, self.low, self.high = ({name: column(name, part[of]) for name, part in parts.items()}
                                            for of in ("first", "min", "max"))

    def __getitem__(self, name: str) -> Channel:
        return self.time if name == "time" else self._first[name]

    def __contains__(self, name: str) -> bool:
        return name == "time" or name in self._first

    def __len__(self) -> int:
        return len(self.time)


class Run:
    """A run that was started.

    Used as a context manager, it is stopped safely where the block is left by an exception or Ctrl-C:

        with bench.start("full-loops", rate=10) as run:
            for samples in run.samples():
                print(samples.time[-1], samples["displacement"].to("µm")[-1])
        recording = run.wait()
    """

    def __init__(self, bench: "Bench", status: api.RunStatus, live: Connection | None = None):
        self.bench, self.id, self._live = bench, status["run"], live

    @property
    def status(self) -> api.RunStatus:
        """Asked anew each time: state, progress, rows, time_left_s, recording, reason, ..."""
        return self.bench.methods.run.status(run=self.id)

    @property
    def over(self) -> bool:
        return self.status["state"] in _OVER

    def pause(self) -> api.RunStatus:
        """Waits in the next hold, which gets longer; samples keep coming."""
        return self.bench.methods.run.pause(run=self.id)

    def resume(self) -> api.RunStatus:
        return self.bench.methods.run.resume(run=self.id)

    def abort(self, reason: str = "") -> api.RunStatus:
        """The emergency stop: the output ramps to zero. Returns at once; a second one hastens it.

        It goes over a connection of its own, so that nothing that was asked before is in its way.
        """
        connection = self.bench.new_connection()
        try:
            return connection.call("run.abort", {"run": self.id, "reason": reason})
        finally:
            connection.close()

    def stop(self, reason: str = "stopped from Python") -> api.RunStatus:
        """Aborts the run and waits until the output is at zero and the recording is whole; Ctrl-C meanwhile hastens it."""
        asked = 0
        while True:
            try:
                if asked < 1:
                    asked = 1
                    self._abort_if_on(reason)
                return self._until_over(Watch(False))
            except KeyboardInterrupt:
                self._abort_if_on(reason)

    def _abort_if_on(self, reason: str) -> None:
        try:
            self.abort(reason)
        except api.BadState:
            pass  # it has ended by itself

    def _until_over(self, watch: Watch) -> api.RunStatus:
        pause = _FIRST_WAIT
        while True:
            status = self.status
            watch.show(status)
            if status["state"] in _OVER:
                watch.end()
                return status
            time.sleep(pause)
            pause = min(1.5 * pause, _LONGEST_WAIT)

    def wait(self, progress: Progress = None) -> "Recording":
        """The recording, when the run is over. Ctrl-C stops the run safely first.

        Raises
        ------
        RunFailed
            it was aborted: by a limit, a device that was lost, or somebody. `status["recording"]` has what was measured.
        """
        try:
            status = self._until_over(Watch(progress))
        except KeyboardInterrupt:
            self.stop(INTERRUPTED)
            raise
        finally:
            self._close_live()
        if status["state"] != "complete":
            problems = [Problem(hint=status["warning"])] if status.get("warning") else []
            raise RunFailed(f"the run was aborted: {status['reason']}", dict(status), problems)
        return self.bench.recording(status["recording"])

    def samples(self, max_rate: float | None = None) -> Iterator[Samples]:
        """The samples as they come, from now on (with start(..., live=True): from the first one), until the run is over.

        Parameters
        ----------
        max_rate
            [Hz] messages in between are merged to so many a second; at most 20 come
        """
        connection = self._live or self.bench.subscribed("run", "samples", max_rate=max_rate)
        self._live = None
        lost = 0
        try:
            # Asked after the subscription, so that no end is missed.
            over = connection.call("run.status", {"run": self.id})["state"] in _OVER
            # What was sent before the end may still be on its way.
            while (message := connection.next(0.1 if over else None)) is not None:
                topic, told = message
                if topic == "gap":
                    lost += told.get("lost", 0)
                elif told.get("run") != self.id:
                    continue
                elif topic == "samples":
                    yield Samples(told["columns"], lost)
                    lost = 0
                elif told["state"] in _OVER:
                    over = True
        finally:
            connection.close()

    def _close_live(self) -> None:
        if self._live is not None:
            self._live.close()
            self._live = None

    def __enter__(self) -> "Run":
        return self

    def __exit__(self, kind, error, trace) -> None:
        self._close_live()
        if kind is None:
            return
        try:
            if not self.over:
                self.stop(INTERRUPTED if kind is KeyboardInterrupt else f"{kind.__name__} in Python")
        except ConnectionLost as lost:
            warnings.warn(f"run {self.id} could not be stopped, and may go on: {lost}", stacklevel=2)

    def __repr__(self) -> str:
        return f"<run {self.id!r}>"


class Job:
    """Something long that is no run: a fit, a search, a simulation, a published table. It goes on if Python ends."""

    def __init__(self, bench: "Bench", status: api.JobStatus):
        self.bench, self.id = bench, status["job"]

    @property
    def status(self) -> api.JobStatus:
        return self.bench.methods.job.status(self.id)

    def cancel(self) -> api.JobStatus:
        return self.bench.methods.job.cancel(self.id)

    def wait(self, progress: Progress = None) -> Any:
        """The result, when it is there. Ctrl-C cancels the job.

        Raises
        ------
        Error
            of the class that its name says, if the job failed; Cancelled if it was cancelled without a result
        """
        watch, pause = Watch(progress), _FIRST_WAIT
        try:
            while (status := self.status)["state"] == "running":
                watch.show(status)
                time.sleep(pause)
                pause = min(1.5 * pause, _LONGEST_WAIT)
        except KeyboardInterrupt:
            self.cancel()
            raise
        watch.show(status)
        watch.end()
        if status["state"] == "failed":
            error = status.get("error") or {}
            kind = api.ERRORS.get(error.get("name", ""), api.Internal)
            raise kind(error.get("message", "the job failed"), [problem_of(p) for p in error.get("problems", [])])
        if status["state"] == "cancelled" and not status.get("result"):
            raise api.Cancelled("the job was cancelled")
        return status["result"]

    def __repr__(self) -> str:
        return f"<job {self.id!r}>"

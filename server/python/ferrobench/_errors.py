"""What a failure is. The class of each error of the daemon is in api.py."""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


_MOST = 20  # names that a message lists; `allowed` has them all


@dataclass(frozen=True)
class Problem:
    """One thing wrong with what was given. `path` is a JSON pointer into it ("/segments/3/rate"); "": the whole."""

    path: str = ""
    message: str = ""
    given: Any = None
    allowed: Any = None
    unit: str = ""
    hint: str = ""

    def __str__(self) -> str:
        out = " ".join(part for part in (self.path, self.message) if part)
        if self.given is not None:
            out += f" (given: {self.given}{self.unit and ' ' + self.unit})"
        if isinstance(self.allowed, dict) and self.allowed.keys() == {"from", "to"}:
            out += f"; allowed: {self.allowed['from']:g} to {self.allowed['to']:g}{self.unit and ' ' + self.unit}"
        elif isinstance(self.allowed, list):
            out += f"; allowed: {', '.join(map(str, self.allowed[:_MOST]))}"
            out += f" and {len(self.allowed) - _MOST} more" if len(self.allowed) > _MOST else ""
        elif self.allowed is not None:
            out += f"; allowed: {self.allowed}{self.unit and ' ' + self.unit}"
        return out + (f"; {self.hint}" if self.hint else "")


class Error(Exception):
    """Whatever ferrobench says no to. A class of its own for each name: NotFound, LimitExceeded, Busy, ...

    Attributes
    ----------
    name : str
        the stable name, for example "limit_exceeded"
    code : int
        of JSON-RPC
    message : str
        in one sentence
    problems : list of Problem
        each thing that is wrong, with its place, what was given, what is allowed, and what to do
    """

    name, code = "error", -32000

    def __init__(self, message: str, problems: list[Problem] | None = None):
        self.message, self.problems = message, problems or []
        super().__init__(message)

    @property
    def hint(self) -> str:
        """What to do, where the daemon knows it."""
        return "; ".join(problem.hint for problem in self.problems if problem.hint)

    def __str__(self) -> str:
        return "\n  ".join([self.message, *map(str, self.problems)])


class ConnectionLost(Error, ConnectionError):
    """The daemon cannot be reached, or went away. What it was asked last may have been carried out."""

    name = "connection_lost"


class RunFailed(Error):
    """A run or a job did not end as planned. `status` is its last status; a run's recording has what was measured."""

    name = "run_failed"

    def __init__(self, message: str, status: dict[str, Any], problems: list[Problem] | None = None):
        super().__init__(message, problems)
        self.status = status


def problem_of(told: Mapping[str, Any]) -> Problem:
    """From {path, message, ...} as the daemon writes it; what a later version adds is left out."""
    return Problem(**{key: value for key, value in told.items() if key in Problem.__dataclass_fields__})

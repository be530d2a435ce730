"""A recording as arrays with units: a file of one's own, or one of a bench."""
from __future__ import annotations

import json
import os
import pathlib
import shutil
import subprocess
from typing import Any

import h5py
import numpy as np

from . import api
from ._errors import Error, Problem
from .table import Table, pandas
from .units import Channel

CHANNELS = ("time", "command", "field", "charge", "displacement", "force")


def _plain(value: Any) -> Any:
    return value.decode() if isinstance(value, bytes) else value.item() if isinstance(value, np.generic) else value


class Recording:
    """What a run measured. SI units.

    `recording["displacement"]` is a Channel, an array with its unit:

    ============== ======= ================================================================================
    "time"         s       from the first sample
    "command"      V/m     the field that was asked for
    "field"        V/m     the field as measured at the amplifier's monitor output
    "charge"       C       on the electrodes; zero at the first sample unless `charge_is_absolute`
    "displacement" m       of the stack; zero at rest, longer is positive
    "force"        N       on the load cell: prestress times area, and the spring's; compression is positive
    "strain"       1       displacement over the active length
    "polarization" C/m^2   charge over the area of all electrodes
    ============== ======= ================================================================================

    What an imported file has beside these has the name that the file gives it. NaN stands where a gap is. A channel that
    was not measured is not there: `"force" in recording`.
    """

    def __init__(self, file: str | os.PathLike, bench=None, name: str = ""):
        self.path = pathlib.Path(file)
        self.name = name or self.path.stem
        self._bench = bench
        self._cache: dict[str, Any] = {}  # channels by name, and the report under ""
        self._read_header()

    def _open(self) -> h5py.File:
        try:
            return h5py.File(self.path, "r")
        except FileNotFoundError:
            raise api.NotFound(f"there is no file {self.path}") from None
        except OSError as error:
            raise api.BadRecording(f"{self.path} cannot be read: {error}") from None

    def _read_header(self) -> None:
        with self._open() as file:
            entry = file.get("entry")
            if entry is None or "definition" not in entry or _plain(entry["definition"][()]) != "ferrobench_recording":
                raise api.BadRecording(f"{self.path} is no recording", [Problem(
                    hint="'ferrobench import' makes one of what another program measured")])

            def get(place: str, otherwise: Any = None) -> Any:
                return _plain(entry[place][()]) if place in entry else otherwise

            def document(place: str) -> dict[str, Any] | None:
                text = get(place)
                return json.loads(text) if text else None

            self.title: str = get("title", "")
            self.status: str = get("status", "complete")
            self.identifier: str = get("entry_identifier", "")
            self.start_time: str = get("start_time", "")
            self.protocol, self.model = document("protocol"), document("model")
            self.device = document("instrument/device")
            self.specimen = {key: _plain(item[()]) for key, item in entry["sample"].items() if isinstance(item, h5py.Dataset)}
            self.load = {key: _plain(item[()]) for key, item in entry["load"].items()}
            data = entry["data"]
            self.channels: list[str] = [name for name in CHANNELS if name in data]
            self.others: list[str] = [name for name in entry.get("others", ()) if name != "time"]
            self.charge_is_absolute = "charge" in data and _plain(data["charge"].attrs.get("reference", "")) == "absolute"
            self._length = len(data["time"])

    def __len__(self) -> int:
        return self._length

    def __contains__(self, name: str) -> bool:
        return (name in self.channels or name in self.others or (name == "strain" and "displacement" in self.channels)
                or (name == "polarization" and "charge" in self.channels))

    def __getitem__(self, name: str) -> Channel:
        if name not in self:
            raise KeyError(f"{name!r} was not measured; there are {', '.join([*self.channels, *self.others])}")
        if name not in self._cache:
            self._cache[name] = self._read(name)
        return self._cache[name]

    def _read(self, name: str) -> Channel:
        if name == "strain":
            return Channel(name, "1", self["displacement"] / self.specimen["length_m"])
        if name == "polarization":
            electrodes = self.specimen["area_m2"] * self.specimen["layer_count"]
            return Channel(name, "C/m^2", self["charge"] / electrodes)
        with self._open() as file:
            dataset = file["entry/data" if name in self.channels else "entry/others"][name]
            return Channel(name, _plain(dataset.attrs["units"]), dataset[()], _plain(dataset.attrs.get("long_name", name)))

    def _listed(self, group: str, title: str, keys: dict[str, str]) -> Table:
        with self._open() as file:
            there = file["entry"].get(group, {})
            columns = {key: [_plain(v) for v in there[key][()]] for key in keys if key in there}
            rows = [dict(zip(columns, row)) for row in zip(*columns.values())]
        return Table({"title": title, "columns": [{"key": key, "unit": unit} for key, unit in keys.items()], "rows": rows})

    @property
    def segments(self) -> Table:
        """Ramps and holds of the program: the rows from start_sample to before end_sample, level [V/m], rate [V/m/s]."""
        return self._listed("segments", "segments", {"label": "", "kind": "", "start_sample": "", "end_sample": "",
                                                     "level": "V/m", "rate": "V/m/s"})

    @property
    def events(self) -> Table:
        """What was noted: limit trips, gaps, pauses, stops, notes; time [s]."""
        return self._listed("events", "events", {"time": "s", "kind": "", "message": ""})

    @property
    def noise(self) -> dict[str, float]:
        """Standard deviation of each channel in its unit, where it is known."""
        with self._open() as file:
            return {key: float(item[()]) for key, item in file["entry"].get("noise", {}).items()}

    def segment(self, which: int | str) -> slice:
        """The rows of a segment, by its number from 0 or its label: recording["displacement"][recording.segment("hold 1")]."""
        table = self.segments
        labels = [row["label"] for row in table.rows]
        if isinstance(which, str):
            if which not in labels:
                raise KeyError(f"{which!r} is no segment; there are {', '.join(labels)}")
            which = labels.index(which)
        row = table.rows[which]
        return slice(row["start_sample"], row["end_sample"])

    def report(self) -> dict[str, Any]:
        """Stroke, hysteresis, creep, rates, minor loops, pulses and the small-signal response, as the daemon or the program `ferrobench` makes them."""
        if "" not in self._cache:
            self._cache[""] = (self._bench.methods.recording.report(self.name, format="json") if self._bench
                               else _report_by_program(self.path))
        return self._cache[""]

    @property
    def tables(self) -> list[str]:
        """The names of the report's tables: "stroke", "hysteresis", ..."""
        return list(self.report()["order"]["tables"])

    def table(self, name: str) -> Table:
        """A table of the report: recording.table("hysteresis")["coercive_positive_kV_per_mm"]."""
        if name not in self.tables:
            raise KeyError(f"the report has no table {name!r}, but {', '.join(self.tables)}")
        return Table(self.report()[name])

    def to_pandas(self, *names: str):
        """A pandas.DataFrame of the channels named (none: all that were measured) over time [s], SI units.

        Its attrs have "units" by channel, "title" and "name".
        """
        chosen = [n for n in names or [*self.channels, *self.others] if n != "time"]
        index = pandas().Index(self["time"].values, name="time")
        frame = pandas().DataFrame({n: self[n].values for n in chosen}, index=index)
        frame.attrs.update(units={n: self[n].unit for n in ["time", *chosen]}, title=self.title, name=self.name)
        return frame

    def save(self, file: str | os.PathLike) -> pathlib.Path:
        """Copies the recording's file; one that is there already is left alone."""
        target = pathlib.Path(file)
        if target.exists():
            raise api.InvalidParams(f"{target} is there already; remove it, or choose another name")
        shutil.copyfile(self.path, target)
        return target

    def __repr__(self) -> str:
        return f"<recording {self.name!r}: {self.title}, {len(self)} rows of {', '.join(self.channels)}, {self.status}>"


def _report_by_program(path: pathlib.Path) -> dict[str, Any]:
    program = os.environ.get("FERROBENCH", "ferrobench")
    try:
        done = subprocess.run([program, "report", os.fspath(path), "--format", "json"], capture_output=True, text=True, check=False)
    except FileNotFoundError:
        raise Error("reports of a file are made by the program 'ferrobench', which was not found", [Problem(
            hint="put it on the PATH, name it by the variable FERROBENCH, or ask a bench for the recording")]) from None
    if done.returncode != 0:
        raise api.BadRecording(done.stderr.strip().removeprefix("ferrobench: "))
    return json.loads(done.stdout)

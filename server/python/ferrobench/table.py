"""A table of a report, of a comparison or of a list."""
from __future__ import annotations

import html
from collections.abc import Mapping
from typing import Any

import numpy as np

from ._errors import Error
from .units import Channel


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, float) and np.isnan(value)):
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


class Table:
    """Columns with units, and rows.

    Attributes
    ----------
    title : str
    columns : dict of str
        the title of each column by its key, in order
    units : dict of str
        the unit of each column by its key, as people read it ("µm", "kV/mm"); "" where it has none
    rows : list of dict
        as the daemon gives them, by key
    notes : list of str
        how the values were measured

    `table["stroke_um"]` is a Channel. `table["stroke_um_uncertainty"]` is the standard uncertainty of it, where one is
    stated.
    """

    def __init__(self, told: Mapping[str, Any]):
        self.title: str = told.get("title", "")
        self.rows: list[dict[str, Any]] = told["rows"]
        self.notes: list[str] = told.get("notes", [])
        self.columns = {c["key"]: c.get("title", c["key"]) for c in told["columns"]}
        self.units = {c["key"]: c.get("unit", "") for c in told["columns"]}
        self._hidden = {c["uncertainty"]: c for c in told["columns"] if c.get("uncertainty")}

    def __getitem__(self, key: str) -> Channel:
        if key in self._hidden:
            of = self._hidden[key]
            title, unit = f"standard uncertainty of {of['title']}", of.get("unit", "")
        elif key in self.columns:
            title, unit = self.columns[key], self.units[key]
        else:
            raise KeyError(f"{key!r} is no column of {self.title!r}, which has {', '.join([*self.columns, *self._hidden])}")
        values = [row.get(key) for row in self.rows]
        if all(v is None or isinstance(v, (int, float)) for v in values):
            return Channel(key, unit, np.array([np.nan if v is None else v for v in values], float), title)
        return Channel(key, unit, np.array(["" if v is None else v for v in values], object), title)

    def __len__(self) -> int:
        return len(self.rows)

    def to_pandas(self):
        """A pandas.DataFrame by key; its attrs have "title", "units" and "notes"."""
        frame = pandas().DataFrame({key: self[key].values for key in [*self.columns, *self._hidden]})
        frame.attrs.update(title=self.title, units=dict(self.units), notes=list(self.notes))
        return frame

    def _texts(self) -> list[list[str]]:
        heads = [f"{title} [{self.units[key]}]" if self.units[key] else title for key, title in self.columns.items()]
        return [heads] + [[_cell(row.get(key)) for key in self.columns] for row in self.rows]

    def __str__(self) -> str:
        texts = self._texts()
        wide = [max(map(len, column)) for column in zip(*texts)]
        lines = ["  ".join(cell.rjust(w) for cell, w in zip(row, wide)) for row in texts]
        return "\n".join([self.title, *lines] if self.title else lines)

    def __repr__(self) -> str:
        return f"<table {self.title!r}, {len(self)} rows>"

    def _repr_html_(self) -> str:  # what a notebook shows
        head, *rows = [[html.escape(cell) for cell in row] for row in self._texts()]
        return (f"<table><caption>{html.escape(self.title)}</caption><tr><th>" + "</th><th>".join(head) + "</th></tr>" +
                "".join("<tr><td>" + "</td><td>".join(row) + "</td></tr>" for row in rows) + "</table>")


def pandas():
    """The module, or an Error that says what to install."""
    try:
        import pandas as module
    except ImportError:
        raise Error("pandas is not installed; on Debian: apt install python3-pandas") from None
    return module

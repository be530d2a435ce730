"""Values with their unit.

A `Channel` is what a recording or a table has in a column. It goes wherever numpy or matplotlib take an array, and
calculations with it give plain arrays, because a unit that was carried along through them would soon be wrong.
"""
from __future__ import annotations

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from ._errors import Error

_PREFIXES = {"": 0, "n": -9, "u": -6, "µ": -6, "μ": -6, "m": -3, "c": -2, "k": 3, "M": 6, "G": 9}
_BASES = ("Pa", "Hz", "V", "m", "s", "C", "N", "A", "J", "K")


def _split(unit: str) -> tuple[tuple[str, ...], int]:
    """The factors of a unit without their prefixes, sorted, each with its power, and the power of ten before them."""
    powers: dict[str, int] = {}
    ten = 0
    for place, part in enumerate(unit.replace(" ", "*").replace("²", "^2").split("/")):
        side = 1 if place == 0 else -1
        for factor in filter(None, part.split("*")):
            symbol, _, power = factor.partition("^")
            if symbol == "1":
                continue
            if symbol == "%":
                ten -= 2 * side
                continue
            for base in _BASES:
                if symbol.endswith(base) and symbol[:-len(base)] in _PREFIXES:
                    break
            else:
                raise ValueError(symbol)
            exponent = side * int(power or 1)
            powers[base] = powers.get(base, 0) + exponent
            ten += exponent * _PREFIXES[symbol[:-len(base)]]
    return tuple(f"{base}^{power}" for base, power in sorted(powers.items()) if power), ten


def factor(unit: str, to: str) -> float:
    """What values in `unit` are multiplied by to be in `to`.

    Products by blank or *, quotients by /, powers by ^, prefixes from n to G: "kV/mm", "uC/cm^2", "µm". Raises Error
    where one does not measure what the other does.
    """
    try:
        have, want = _split(unit), _split(to)
        if have[0] == want[0]:
            ten = have[1] - want[1]
            return 10.0 ** ten if ten >= 0 else 1 / 10.0 ** -ten
    except ValueError as unknown:
        raise Error(f"{to!r} cannot be compared with {unit!r}: {unknown} is no unit known here") from None
    raise Error(f"values in {unit!r} have no value in {to!r}: the two measure different things")


class Channel(NDArrayOperatorsMixin):
    """A column of values.

    Attributes
    ----------
    name : str
        "displacement", or a table's key
    unit : str
        of the values as they stand; SI for the channels of a recording
    values : numpy array
        NaN where nothing was measured
    label : str
        for an axis: what it is, and its unit in brackets
    """

    def __init__(self, name: str, unit: str, values, title: str = ""):
        self.name, self.unit, self.values, self.title = name, unit, np.asarray(values), title or name

    def to(self, unit: str) -> "Channel":
        """The same in another unit: recording["displacement"].to("µm"), recording["field"].to("kV/mm")."""
        return Channel(self.name, unit, self.values * factor(self.unit, unit), self.title)

    @property
    def label(self) -> str:
        return f"{self.title} [{self.unit}]" if self.unit else self.title

    def __array__(self, dtype=None, copy=None):  # `copy` is given by numpy 2
        return np.array(self.values, dtype) if copy else np.asarray(self.values, dtype)

    def __array_ufunc__(self, ufunc, method, *inputs, **kwargs):
        plain = [x.values if isinstance(x, Channel) else x for x in inputs]
        return getattr(ufunc, method)(*plain, **kwargs)

    def __getattr__(self, name):
        # max(), mean(), shape, dtype, ...: those of the array.
        if name.startswith("_") or name == "values":
            raise AttributeError(name)
        return getattr(self.values, name)

    def __getitem__(self, where):
        return self.values[where]

    def __len__(self) -> int:
        return len(self.values)

    def __iter__(self):
        return iter(self.values)

    def __repr__(self) -> str:
        return f"<{self.label}, {len(self.values)} values>"

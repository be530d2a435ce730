"""Bench software for ferroelectric actuators, from Python.

    import ferrobench

    bench = ferrobench.connect()
    recording = bench.run("full-loops", rate=10, prestress_MPa=8)
    recording["displacement"].to("µm").max()
    recording.table("stroke").to_pandas()

`connect` gives a Bench, runs give a Recording; `open` reads the file of one without any daemon. Whatever fails raises an Error of
a class of its own: LimitExceeded, NotFound, Busy, ... SI units unless the name says otherwise.
"""
from . import api, units
from ._errors import ConnectionLost, Error, Problem, RunFailed
from .api import *  # noqa: F403  the errors
from .bench import Bench, Lease, connect
from .recording import Recording
from .run import Job, Run, Samples
from .table import Table
from .units import Channel


def open(file) -> Recording:  # noqa: A001  as one says h5py.File, numpy.load, ferrobench.open
    """A recording from its file. Its reports need the program `ferrobench`."""
    return Recording(file)


__all__ = ["Bench", "Channel", "ConnectionLost", "Error", "Job", "Lease", "Problem", "Recording", "Run", "RunFailed", "Samples",
           "Table", "api", "connect", "open", "units", *api.__all__]

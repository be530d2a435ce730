"""Looks at a recording as a NeXus viewer does, with h5py alone. Exit 77: there is no h5py here."""

import json
import sys

try:
    import h5py
except ImportError:
    sys.exit(77)


def text(value):
    return value.decode() if isinstance(value, bytes) else str(value)


with h5py.File(sys.argv[1], "r") as file:
    expected = json.loads(sys.argv[2])

    # The default plot: each group names the next, the last one its signal and axis.
    assert text(file.attrs["NX_class"]) == "NXroot"
    entry = file[text(file.attrs["default"])]
    assert text(entry.attrs["NX_class"]) == "NXentry"
    data = entry[text(entry.attrs["default"])]
    assert text(data.attrs["NX_class"]) == "NXdata"
    assert text(data.attrs["signal"]) == expected["signal"]
    assert text(data.attrs["axes"]) == "time"
    signal, axis = data[data.attrs["signal"]], data[data.attrs["axes"]]
    assert signal.shape == axis.shape == (expected["rows"],)

    units = {"time": "s", "command": "V/m", "field": "V/m", "charge": "C", "displacement": "m", "force": "N"}
    assert set(data) == set(expected["columns"]) | {"time"}
    for name, column in data.items():
        assert text(column.attrs["units"]) == units[name], name
        assert text(column.attrs["long_name"]), name
        assert column.shape == axis.shape, name
        assert column.chunks and column.shuffle and column.compression == "gzip", name
    assert abs(float(axis[-1]) - expected["duration"]) < 1e-12

    assert text(file.attrs["creator"]) == "ferrobench" and text(file.attrs["creator_version"])
    assert text(entry["definition"][()]) == "ferrobench_recording"
    assert int(entry["definition"].attrs["version"]) == 1
    assert text(entry["status"][()]) == "complete"
    assert text(entry["sample"].attrs["NX_class"]) == "NXsample"
    assert text(entry["load"].attrs["NX_class"]) == "NXcollection"
    assert text(entry["instrument"].attrs["NX_class"]) == "NXinstrument"
    assert json.loads(text(entry["instrument/device"][()]))["driver"] == "test"
    assert int(entry["sample/layer_count"][()]) == 100
    segments = entry["segments"]
    assert len({len(column) for column in segments.values()}) == 1
    assert [text(kind) for kind in segments["kind"][()]] == ["ramp", "hold", "ramp"]
    assert [text(message) for message in entry["events/message"][()]] == expected["messages"]

"""`make FOLDER`: recordings as other programs write them, FOLDER/KIND.h5 for every kind. `read FILES`: reads all of each
and prints a line with its channels. With h5py alone; exit 77: there is no h5py here."""

import sys

try:
    import h5py
    import numpy
except ImportError:
    sys.exit(77)

rows = 2500


def read(path):
    with h5py.File(path, "r") as file:
        data = file["entry/data"]
        lengths = {name: column[()].shape[0] for name, column in data.items()}
        assert len(set(lengths.values())) == 1, lengths
        assert data.attrs["signal"] in data, data.attrs["signal"]
        print(" ".join(sorted(set(data) - {"time"})))


def make(path, number="f8", whole="i8", text=str, texts=None, chunks=None, version=1, libver=None, compression=None):
    """number, whole: dtypes of samples and of whole numbers; text, texts: how one and several texts are written."""
    texts = texts or (lambda values: numpy.array(values, h5py.string_dtype()))
    with h5py.File(path, "w", libver=libver) as file:
        entry = file.create_group("entry")
        entry["definition"] = text("ferrobench_recording")
        entry["definition"].attrs["version"] = version
        entry["title"] = text("made with h5py")
        entry["status"] = text("complete")
        entry["sample/name"] = text("a stack")
        for name, value in (("length_m", 0.01), ("area_m2", 2.5e-5), ("layer_thickness_m", 1e-4)):
            entry["sample/" + name] = numpy.array(value, "f8")
        entry["sample/layer_count"] = numpy.array(100, whole)
        entry["load/spring_stiffness_N_per_m"] = numpy.array(2.5e6, "f8")
        entry["load/prestress_Pa"] = numpy.array(8e6, "f8")
        data = entry.create_group("data")
        steps = numpy.arange(rows)
        for name, period in (("time", rows), ("field", 90), ("charge", 80), ("displacement", 50), ("force", 20)):
            dtype = "f8" if name == "time" and numpy.dtype(number).itemsize < 2 or number == "f2" else number
            column = (steps % period).astype(number if name != "time" else dtype)
            data.create_dataset(name, data=column, chunks=chunks, compression=compression)
        data["charge"].attrs["reference"] = text("absolute")
        segments, events = entry.create_group("segments"), entry.create_group("events")
        segments["start_sample"] = numpy.array([0, 1000], whole)
        segments["end_sample"] = numpy.array([1000, 2000], whole)
        segments["level"] = segments["rate"] = numpy.array([1e3, 0], "f4")
        segments["kind"], segments["label"] = texts(["ramp", "hold"]), texts(["up", "down"])
        events["time"] = numpy.array([1.0], "f4")
        events["kind"], events["message"] = texts(["note"]), texts(["by hand"])


def fixed(encoding):
    kind = h5py.string_dtype(encoding, 64)
    return {"text": lambda value: numpy.array(value.encode(), kind),
            "texts": lambda values: numpy.array([value.encode() for value in values], kind)}


kinds = {
    "float64": {},
    "float32": {"number": "f4"},
    "float16": {"number": "f2"},
    "int16": {"number": "i2", "whole": "i2"},
    "int32": {"number": "i4", "whole": "i4"},
    "uint16": {"number": "u2", "whole": "u2"},
    "int8": {"number": "i1"},
    "big_endian_float64": {"number": ">f8", "whole": ">i8"},
    "big_endian_float32": {"number": ">f4"},
    "big_endian_int16": {"number": ">i2", "whole": ">i2"},
    "version_as_text": {"version": "1"},
    "version_as_float": {"version": 1.0},
    "numpy_bytes": {"text": numpy.bytes_},
    "fixed_ascii": fixed("ascii"),
    "fixed_utf8": fixed("utf-8"),
    "variable_ascii": {"text": lambda value: numpy.array(value, h5py.string_dtype("ascii")),
                       "texts": lambda values: numpy.array(values, h5py.string_dtype("ascii"))},
    "chunked": {"chunks": (100,)},
    "one_chunk": {"chunks": (rows,)},
    "gzip": {"chunks": True, "compression": "gzip"},
    "lzf": {"chunks": True, "compression": "lzf"},
    "latest": {"libver": "latest"},
    "latest_chunked": {"libver": "latest", "chunks": (64,), "number": "f4"},
}

if sys.argv[1] == "read":
    for path in sys.argv[2:]:
        read(path)
else:
    for kind, how in kinds.items():
        make(f"{sys.argv[2]}/{kind}.h5", **how)

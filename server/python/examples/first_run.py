"""Runs full loops on the virtual device and shows what came out: figures, and a picture if matplotlib is there."""
import numpy as np

import ferrobench

bench = ferrobench.connect()
recording = bench.run("full-loops", rate=10, prestress_MPa=8, fast=True, notes="first run from Python")

displacement = recording["displacement"].to("µm")
field = recording["field"].to("kV/mm")
print(recording)
print(f"stroke {np.ptp(displacement):.2f} µm over {np.ptp(field):.2f} kV/mm")

hysteresis = recording.table("hysteresis")
print(hysteresis)
print("coercive field, rising:", hysteresis["coercive_positive_kV_per_mm"][0], hysteresis.units["coercive_positive_kV_per_mm"])

try:
    import matplotlib
except ImportError:
    print("python3-matplotlib is not installed: no picture")
else:
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    plt.plot(field, displacement)
    plt.xlabel(field.label)
    plt.ylabel(displacement.label)
    plt.title(recording.title)
    plt.savefig("loops.png")
    print("loops.png")

"""How far is a model from a measurement? The measured field is played through it, and the difference taken by channel."""
import numpy as np

import ferrobench

bench = ferrobench.connect()
measured = bench.run("full-loops", rate=10, fast=True, seed=3)
simulated = bench.simulate(measured, "soft-pzt")

for name in ("charge", "displacement", "force"):
    difference = measured[name] - simulated[name]
    rms = np.sqrt(np.nanmean(difference**2))
    print(f"{name:12} rms {rms:.3g} {measured[name].unit}, {100 * rms / np.ptp(measured[name]):.1f} % of its range")

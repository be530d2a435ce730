"""The same loops at three rates and two prestresses, and the stroke against both as a table (CSV)."""
import pandas

import ferrobench

bench = ferrobench.connect()
rows = []
with bench.control(stop_run=True):  # nobody else starts anything in between
    for prestress in (4.0, 16.0):
        for rate in (1.0, 10.0, 100.0):
            recording = bench.run("full-loops", rate=rate, prestress_MPa=prestress, fast=True)
            stroke = recording.table("stroke")
            rows.append({"rate [kV/mm/s]": rate, "prestress [MPa]": prestress, "stroke [µm]": stroke["stroke_um"][1],
                         "u(stroke) [µm]": stroke["stroke_um_uncertainty"][1], "recording": recording.name})

table = pandas.DataFrame(rows)
table.to_csv("sweep.csv", index=False)
print(table.pivot(index="rate [kV/mm/s]", columns="prestress [MPa]", values="stroke [µm]"))

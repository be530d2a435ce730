"""Looks at a run in real time, and stops it when the stack gets longer than it should."""
import ferrobench

HIGHEST = 22.0  # µm; the loop of the virtual stack goes from about -4 µm to 23 µm

bench = ferrobench.connect()
with bench.start("full-loops", rate=5, live=True) as run:
    for samples in run.samples():
        longest = samples.high["displacement"].to("µm").max()
        print(f"{samples.time[-1]:6.2f} s  {samples['field'].to('kV/mm')[-1]:6.2f} kV/mm  {longest:6.2f} µm")
        if samples.time[0] > 0.5 and longest > HIGHEST:
            status = run.stop(f"longer than {HIGHEST} µm")
            print("stopped:", status["reason"])
            break

status = run.status
recording = bench.recording(status["recording"])
print(recording, "output at zero:", status["output_at_zero"])

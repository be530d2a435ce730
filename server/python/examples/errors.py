"""What a program can do when the bench says no."""
import ferrobench

bench = ferrobench.connect()
program = {"format": "ferrobench-protocol", "version": 1, "name": "too-high", "unit": "kV/mm", "start": 0,
           "segments": [{"kind": "ramp", "to": 3, "rate": 10}, {"kind": "ramp", "to": 0, "rate": 10}]}
try:
    bench.run(program, fast=True)
except ferrobench.LimitExceeded as refused:
    for problem in refused.problems:
        print(problem.path, problem.given, problem.unit, "but at most", bench.limits["field_max"], "V/m")

try:
    bench.run("full-loop", fast=True)
except ferrobench.NotFound as error:
    print(error.hint)

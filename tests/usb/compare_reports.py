"""compare_reports.py A.json B.json: two reports (ferrobench report --format json) of one protocol, number by number.
Exit code 1 if they differ by more than the noise of the sensors makes of it."""

import json
import sys

# Share of a number's scale above which a difference is no longer noise. The sensors' noise is 5e-5 of ranges that are a
# few times what is measured; areas and widths multiply it, and so do the steps of an output that a real unit has.
ALLOWED = 0.02

# What is small beside something else is compared with that: (table, beginning of the key) -> (table, key).
SCALES = {
    ("stroke", "field_"): ("stroke", "field_high_kV_per_mm"),
    ("creep", "displacement_"): ("stroke", "stroke_um"),
    ("creep", "polarization_"): ("hysteresis", "remanent_falling_C_per_m2"),
    ("creep_readings_displacement", "after_"): ("stroke", "stroke_um"),
    ("creep_readings_polarization", "after_"): ("hysteresis", "remanent_falling_C_per_m2"),
}
# A specimen on a real device waits for its first field, and depoles under its prestress meanwhile: what the first cycle
# begins with says how long.
FIRST_CYCLE = ("hysteresis", "cycle", 1)
# How long a drift of hardly more than the noise takes to come to its half says nothing.
LEFT_OUT = ("_time_to_half_s",)
# What happened to a run, a slow disk of a busy computer for one, is no measurement. It is printed, to read a difference by.
EVENTS = "events"


def rows_of(report):
    return {
        name: table["rows"]
        for name, table in report.items()
        if isinstance(table, dict) and "rows" in table and name != EVENTS
    }


def scale_of(report, table, key):
    for (where, beginning), found in SCALES.items():
        if table == where and key.startswith(beginning):
            table, key = found
            break
    return max(abs(row[key]) for row in report[table] if isinstance(row.get(key), float))


def main():
    with open(sys.argv[1]) as a, open(sys.argv[2]) as b:
        reports = json.load(a), json.load(b)
    for file, report in zip(sys.argv[1:], reports):
        for event in report.get(EVENTS, {}).get("rows", []):
            print(f"{file}: {event['time_s']} s, {event['kind']}: {event['message']}")
    first, second = map(rows_of, reports)
    if first.keys() != second.keys():
        sys.exit(f"one has the tables {sorted(first)}, the other {sorted(second)}")
    if not first:
        sys.exit("there is nothing to compare")
    apart = 0
    numbers = 0
    for name, rows in first.items():
        others = second[name]
        if len(rows) != len(others):
            sys.exit(f"{name}: {len(rows)} rows against {len(others)}")
        for row, other in zip(rows, others):
            if name == FIRST_CYCLE[0] and row.get(FIRST_CYCLE[1]) == FIRST_CYCLE[2]:
                continue
            for key, value in row.items():
                if not isinstance(value, float) or not isinstance(other.get(key), float):
                    if type(value) is not type(other.get(key)):
                        sys.exit(f"{name}: {key} is {value} against {other.get(key)}")
                    continue
                if key.endswith(LEFT_OUT):
                    continue
                numbers += 1
                scale = scale_of(first, name, key)
                if abs(value - other[key]) > ALLOWED * scale:
                    apart += 1
                    print(f"{name}: {key} is {value:.6g} against {other[key]:.6g}")
    print(f"{numbers} numbers in {len(first)} tables, {apart} further apart than noise")
    sys.exit(1 if apart or not numbers else 0)


main()

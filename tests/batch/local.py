"""local.py PROGRAM: a batch on one machine, by the program as a user has it.

Whatever is killed, changed or damaged on the way, the tables in the end are those of an undisturbed batch, to the byte.
"""
import csv
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import h5py

program = str(pathlib.Path(sys.argv[1]).resolve())
root = pathlib.Path(tempfile.mkdtemp())
environment = dict(os.environ, FERROBENCH_DATA=str(root / "data"))
MERGED = "table.csv", "table.h5", "index.html"


def check(condition, what):
    if not condition:
        sys.exit(f"FAILED: {what}")


def call(*words, code=0):
    done = subprocess.run([program, *map(str, words)], env=environment, capture_output=True, text=True, check=False)
    check(done.returncode == code, f"{words} ended with {done.returncode}: {done.stdout}{done.stderr}")
    return done.stdout + done.stderr


def manifest(name, items, **others):
    (root / name).write_text(json.dumps({"items": items, **others}))
    return root / name


def contents(folder):
    """All that a batch leaves, but who worked when, and how it was cut into tasks."""
    files = [folder / name for name in MERGED] + sorted(p for p in (folder / "items").rglob("*") if p.is_file())
    return {str(f.relative_to(folder)): f.read_bytes() for f in files}


def check_same(a, b):
    left, right = contents(root / a), contents(root / b)
    check(left.keys() == right.keys(), f"{a} and {b} do not hold the same: {left.keys() ^ right.keys()}")
    for name, bytes_ in left.items():
        check(bytes_ == right[name], f"{name} of {a} and {b} differ")


def worked_on(folder):
    """Items in the order in which they were finished."""
    lines = [json.loads(line) for log in (root / folder / "log").glob("*.jsonl") for line in log.read_text().splitlines()
             if line.startswith("{")]
    return [line["item"] for line in lines if "seconds" in line]


def results(folder):
    return sum(1 for _ in (root / folder / "items").glob("*.json"))


def children(process):
    return [int(p) for p in pathlib.Path(f"/proc/{process}/task/{process}/children").read_text().split()]


def start(*words):
    return subprocess.Popen([program, *map(str, words)], env=environment, stdout=subprocess.DEVNULL,
                            stderr=subprocess.DEVNULL)


def wait_until(condition, what):
    for _ in range(3000):
        if condition():
            return
        time.sleep(0.01)
    sys.exit(f"FAILED: {what} did not come to pass")


def record(name, seed, protocol="stage-full-range"):
    call("run", protocol, "--model", "soft-pzt", "--fast", "--quiet", "--seed", seed, "--out", root / name)


def problems():
    wrong = manifest("wrong.json", [
        {"id": "a", "recordings": ["a.h5"]},
        {"id": "a", "recordings": ["a.h5", "./a.h5"]},
        {"id": "../b", "recordings": ["none.h5"], "held_out": ["c"]},
        {"id": "c", "recordings": ["a.h5"], "held_out": ["a"], "model": "soft-pzz", "options": {"floor": 0}},
        {"id": "d"}], model="soft-pzt")
    said = call("batch", "discover", wrong, "--out", root / "wrong", code=1)
    for place in ("/items/1/id", "/items/1/recordings/1", "/items/2/id", "/items/2/recordings/0", "/items/2/held_out/0",
                  "/items/3/held_out", "/items/3/model", "/items/3/options/floor", "/items/4/recordings"):
        check(place in said, f"{place} is not complained of: {said}")
    check("soft-pzt" in said, "the nearest model is not named")
    check(not (root / "wrong").exists(), "something was begun")
    call("batch", "fit", manifest("no.json", []), "--out", root / "wrong", code=1)
    call("batch", "fit", manifest("no.json", [{"id": "a", "recordings": ["a.h5"]}]), "--out", root / "wrong", code=1)
    call("batch", "report", manifest("no.json", [{"id": "a", "files": ["a.h5"]}]), "--out", root / "wrong", code=1)
    call("batch", "report", root / "nowhere.json", "--out", root / "wrong", code=1)
    (root / "no.json").write_text("{")
    call("batch", "report", root / "no.json", "--out", root / "wrong", code=1)


def reports():
    # Pages take most of the time: one is enough.
    fleet = manifest("reports.json", [{"id": f"stack-{i}", "options": {"report": i == 0}, "recordings": [f"{'abc'[i % 3]}.h5", "b.h5"][:2 - (i % 3 == 1)]}
                                      for i in range(6)],
                     options={"report": False})
    call("batch", "report", fleet, "--local", 1, "--out", root / "one")
    call("batch", "report", fleet, "--local", 2, "--chunk", 4, "--out", root / "two")
    check_same("one", "two")
    rows = list(csv.DictReader((root / "one/table.csv").open()))
    check(len(rows) == 10 and all(r["state"] == "done" for r in rows), f"the table is wrong: {rows}")
    stroke = [float(r["stroke.stroke_um"]) for r in rows]
    with h5py.File(root / "one/table.h5") as file:
        check(list(file["table/stroke.stroke_um"][:]) == stroke and file["table/stroke.stroke_um"].attrs["units"] == b"um",
              "CSV and HDF5 differ")
        check([n.decode() for n in file["columns"][:]] == list(rows[0]), "the columns of CSV and HDF5 differ")
    page = (root / "one/index.html").read_text()
    check('href="items/stack-0/a.html"' in page and "Over the fleet" in page, "the page lacks something")

    # Killed in the middle, and begun again.
    batch = start("batch", "report", fleet, "--local", 2, "--out", root / "killed")
    wait_until(lambda: results("killed") > 0 if (root / "killed/items").exists() else False, "a first result")
    workers = children(batch.pid)
    batch.kill()
    batch.wait()
    wait_until(lambda: not any(pathlib.Path(f"/proc/{w}").exists() for w in workers), "the end of the children")
    call("batch", "report", fleet, "--local", 2, "--out", root / "killed")
    check_same("one", "killed")
    check(len(worked_on("killed")) <= 7, "what was there was done again")

    # A child is killed: its item is done again at once.
    batch = start("batch", "report", fleet, "--local", 1, "--out", root / "child")
    wait_until(lambda: children(batch.pid), "a child")
    os.kill(children(batch.pid)[0], signal.SIGKILL)
    check(batch.wait() == 0, "a killed child was not made up for")
    check_same("one", "child")

    # Nothing is left to do; then one input changes, and one option.
    call("batch", "report", fleet, "--out", root / "one")
    check(len(worked_on("one")) == 6, "what was done was done again")
    shutil.copy(root / "c.h5", root / "kept.h5")
    shutil.copy(root / "d.h5", root / "c.h5")
    call("batch", "report", fleet, "--out", root / "one")
    check(worked_on("one")[6:] == ["stack-2", "stack-5"], "not what has other inputs was done again")
    (root / "c.h5").write_bytes(b"no recording")
    said = call("batch", "report", fleet, "--out", root / "one", code=1)
    check("4 of 6 done, 2 failed" in said, f"failures are not told: {said}")
    rows = [r for r in csv.DictReader((root / "one/table.csv").open()) if r["state"] == "failed"]
    check([r["id"] for r in rows] == ["stack-2", "stack-5"] and rows[0]["error"], "failures are not in the table")
    shutil.copy(root / "kept.h5", root / "c.h5")
    call("batch", "report", fleet, "--out", root / "one")
    check_same("one", "two")

    # Results of another commit are not mixed with those of this one.
    result = root / "one/items/stack-3.json"
    other = json.loads(result.read_text())
    other["asked"]["commit"] = "0" * 40
    result.write_text(json.dumps(other))
    said = call("batch", "report", fleet, "--out", root / "one", code=1)
    check("commit" in said and "--replace" in said, f"another commit is not told: {said}")
    call("batch", "report", fleet, "--out", root / "one", "--replace")
    check_same("one", "two")
    call("batch", "fit", manifest("fit.json", [{"id": "a", "recordings": ["a.h5"]}], model="soft-pzt"), "--out",
         root / "one", code=1)

    # One command at a time in a folder.
    batch = start("batch", "report", fleet, "--out", root / "busy")
    wait_until((root / "busy/batch.json").exists, "its plan")
    batch.send_signal(signal.SIGSTOP)
    said = call("batch", "report", fleet, "--out", root / "busy", code=1)
    check("another command" in said, f"two work in one folder: {said}")
    batch.send_signal(signal.SIGCONT)
    check(batch.wait() == 0, "it did not go on")
    check_same("busy", "two")


def others():
    call("export", root / "a.h5", "--out", root / "a.csv")
    fleet = manifest("imports.json", [{"id": f"i{k}", "files": ["a.csv"], "options": {"map": {"length_m": 0.01 + 0.001 * k}}}
                                      for k in range(3)],
                     options={"map": {"area_m2": 25e-6, "layer_thickness_m": 1e-4}})
    call("batch", "import", fleet, "--out", root / "imported")
    call("batch", "import", fleet, "--local", 2, "--out", root / "imported-2")
    check_same("imported", "imported-2")
    call("report", root / "imported/items/i2/a.h5")

    fleet = manifest("fits.json", [{"id": name, "recordings": [f"{name}.h5"]} for name in "ab"], model="soft-pzt",
                     options={"free": ["material.barrier"], "starts": 1, "iterations": 2})
    call("batch", "fit", fleet, "--out", root / "fitted")
    call("batch", "fit", fleet, "--local", 2, "--out", root / "fitted-2")
    check_same("fitted", "fitted-2")
    call("model", "show", root / "fitted/items/a/fitted.json")

    fleet = manifest("benches.json", [{"id": name, "recordings": [f"{name}.h5", "d.h5"], "held_out": ["d"]} for name in "ab"],
                     model="soft-pzt", options={"candidates": ["domain_wall_drag"]})
    call("batch", "discover", fleet, "--out", root / "found")
    call("batch", "discover", fleet, "--local", 2, "--threads", 2, "--out", root / "found-2")
    check_same("found", "found-2")
    rows = list(csv.DictReader((root / "found/table.csv").open()))
    check([r["state"] for r in rows] == ["done", "done"] and rows[0]["verdict"], f"nothing was found: {rows}")


try:
    for seed, name in enumerate("abcd"):
        record(f"{name}.h5", seed)
    problems()
    reports()
    others()
finally:
    shutil.rmtree(root)

"""slurm.py PROGRAM [--items N] [--keep FOLDER]: a batch by Slurm and on one machine: the same bytes.

Without --items a few reports and what there is to test of submitting, joining and cancelling. With it so many
discoveries of short benches, while tasks are killed and the node is lost and comes back; then overhead and scaling.
"""
import argparse
import concurrent.futures
import json
import os
import pathlib
import random
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time

import node

parser = argparse.ArgumentParser()
parser.add_argument("program")
parser.add_argument("--items", type=int, default=0)
parser.add_argument("--keep", default="")
arguments = parser.parse_args()
if not node.is_possible():
    print("skipped: needs root, and Debian's slurmctld slurmd slurm-client munge")
    sys.exit(77)
program = str(pathlib.Path(arguments.program).resolve())
root = pathlib.Path(arguments.keep or tempfile.mkdtemp()).resolve()
root.mkdir(parents=True, exist_ok=True)
environment = dict(os.environ, FERROBENCH_DATA=str(root / "data"))
MERGED = "table.csv", "table.h5", "index.html"


def check(condition, what):
    if not condition:
        sys.exit(f"FAILED: {what}")


def start(*words):
    return subprocess.Popen([program, *map(str, words)], env=environment, stdout=subprocess.PIPE,
                            stderr=subprocess.STDOUT, text=True)


def call(*words, code=0):
    process = start(*words)
    said = process.communicate()[0]
    check(process.returncode == code, f"{words} ended with {process.returncode}: {said}")
    return said


def check_same(a, b):
    names = [*MERGED, *(str(p.relative_to(root / a)) for p in sorted((root / a / "items").rglob("*")) if p.is_file())]
    others = [*MERGED, *(str(p.relative_to(root / b)) for p in sorted((root / b / "items").rglob("*")) if p.is_file())]
    check(names == others, f"{a} and {b} do not hold the same files")
    for name in names:
        check((root / a / name).read_bytes() == (root / b / name).read_bytes(), f"{name} of {a} and {b} differ")
    return len(names)


def wait_until(condition, what, seconds=60):
    end = time.monotonic() + seconds
    while not condition():
        check(time.monotonic() < end, f"{what} did not come to pass")
        time.sleep(0.02)


def results(folder):
    return sum(1 for _ in (root / folder / "items").glob("*.json")) if (root / folder / "items").exists() else 0


def task_runners(slurm):
    """What a task's script has become: the program with 'batch work' and no item of its own."""
    out = []
    for process in slurm.processes("ferrobench"):
        try:
            words = pathlib.Path(f"/proc/{process}/cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if slurm.is_of_a_task(process) and b"work" in words and b"--item" not in words:
            out.append(process)
    return out


def small(slurm):
    def logs():
        return {p.name for p in (root / "slurm/log").glob("slurm-*.txt")}

    call("run", "stage-full-range", "--model", "soft-pzt", "--fast", "--quiet", "--out", root / "a.h5")
    fleet = root / "fleet.json"
    fleet.write_text(json.dumps({"items": [{"id": f"stack-{i}", "recordings": ["a.h5"]} for i in range(6)],
                                 "options": {"report": False}}))
    call("batch", "report", fleet, "--out", root / "local")
    # By an array of three tasks, submitted and left, joined, and merged.
    said = call("batch", "report", fleet, "--slurm", "--chunk", 2, "--no-wait", "--out", root / "slurm")
    check("goes on" in said, f"it does not say that the job goes on: {said}")
    call("batch", "report", fleet, "--slurm", "--chunk", 2, "--out", root / "slurm")
    check_same("local", "slurm")
    check(logs() == {"slurm-1_0.txt", "slurm-1_1.txt", "slurm-1_2.txt"}, f"it was submitted twice: {logs()}")
    call("batch", "report", fleet, "--slurm", "--chunk", 2, "--out", root / "slurm")
    check(len(logs()) == 3, f"there was nothing to do, and it was submitted: {logs()}")
    # What is missing is all that is submitted again: the last task.
    (root / "slurm/items/stack-5.json").unlink()
    call("batch", "report", fleet, "--slurm", "--chunk", 2, "--out", root / "slurm")
    check(len(logs()) == 4 and all(name[-6:] == "_2.txt" for name in logs() if "-1_" not in name), f"not what is missing was submitted: {logs()}")
    check_same("local", "slurm")
    # Refused by Slurm, with its words.
    said = call("batch", "report", fleet, "--slurm", "--partition", "none", "--out", root / "refused", code=1)
    check("invalid partition" in said, f"what Slurm says is not told: {said}")
    # Work in another way while a job waits is refused; a job that is cancelled is not submitted again.
    call("batch", "report", fleet, "--slurm", "--sbatch-option=--hold", "--no-wait", "--out", root / "held")
    said = call("batch", "report", fleet, "--out", root / "held", code=1)
    check("at work" in said, f"two work in one folder: {said}")
    job = (root / "held/job").read_text().strip()
    waiting = start("batch", "report", fleet, "--slurm", "--out", root / "held")
    time.sleep(1)
    waiting.send_signal(signal.SIGINT)
    said = waiting.communicate()[0]
    check(waiting.returncode == 130 and f"scancel {job}" in said, f"it does not say how to end the job: {said}")
    waiting = start("batch", "report", fleet, "--slurm", "--out", root / "held")
    time.sleep(1)
    slurm.run("scancel", job)
    said = waiting.communicate()[0]
    check(waiting.returncode == 1 and "was cancelled" in said and "6 missing" in said, f"cancelled, and says {said}")
    check((root / "held/job").read_text().strip() == job, "a cancelled job was submitted again")
    # Without Slurm.
    environment["PATH"] = "/nowhere"
    said = call("batch", "report", fleet, "--slurm", "--out", root / "without", code=1)
    check("no Slurm here" in said, f"what is missing is not told: {said}")


def make_fleet(items):
    """Specimens of one type with a short loop each. Some have an effect that the model lacks, a few another barrier."""
    model = json.loads(call("model", "show", "soft-pzt"))
    crosstalk = {"id": "displacement_crosstalk", "parameters": {"coefficient": 2e-13}}
    decay = {"id": "charge_amplifier_decay", "parameters": {"time_constant": 20}}
    draw = random.Random(1)

    def measure(i, barrier):
        specimen = json.loads(json.dumps(model))
        specimen["material"]["barrier"] *= barrier
        specimen["effects"] = [decay] if i % 20 == 5 else [crosstalk] if i % 4 == 2 else []
        name = f"{i:03}"
        if not (root / f"fleet/{name}.h5").exists():
            (root / f"fleet/{name}.json").write_text(json.dumps(specimen))
            call("run", "stage-full-range", "--model", root / f"fleet/{name}.json", "--set", "rate=50", "--fast", "--quiet",
                 "--seed", i, "--out", root / f"fleet/{name}.h5")
        return {"id": f"stack-{name}", "recordings": [f"fleet/{name}.h5"]}

    (root / "fleet").mkdir(exist_ok=True)
    barriers = [1.25 if i % 50 == 7 else draw.gauss(1, 0.01) for i in range(items)]
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        fleet = list(pool.map(measure, range(items), barriers))
    candidates = ["charge_amplifier_decay", "displacement_crosstalk", "electrostriction"]
    (root / "fleet.json").write_text(json.dumps(
        {"model": "soft-pzt", "options": {"report": False, "candidates": candidates}, "items": fleet}))
    return root / "fleet.json"


def seconds_of(folder):
    """Of each item, as its runner saw it."""
    out = {}
    for log in (root / folder / "log").glob("*.jsonl"):
        for line in log.read_text().splitlines():
            told = json.loads(line) if line.startswith("{") else {}
            if "seconds" in told:
                out[told["item"]] = told["seconds"]
    return out


def told(folder, slots, begin, end):
    """What a batch takes beside its items: for each of them while they follow each other, and once for all."""
    work = seconds_of(folder)
    ends = {item: (root / folder / f"items/{item}.json").stat().st_mtime for item in work}
    first, last = min(ends[item] - work[item] for item in work), max(ends.values())
    return (f"{end - begin:.1f} s; an item {statistics.mean(work.values()):.2f} s; beside that "
            f"{((last - first) * slots - sum(work.values())) / len(work):.2f} s a task, before the first "
            f"{first - begin:.1f} s, after the last {end - last:.1f} s; {load()}")


def load():
    return "load " + " ".join(f"{x:.1f}" for x in os.getloadavg()[:2])


def disturbed(slurm, fleet, items):
    """Tasks and items are killed at random; once the node is lost, and comes back."""
    draw = random.Random(2)
    batch = start("batch", "discover", fleet, "--slurm", "--out", root / "slurm")
    kills = {"task": 0, "item": 0}
    lost = False
    while batch.poll() is None:
        time.sleep(draw.uniform(2, 6))
        if not lost and results("slurm") > items / 3:
            print("the node is lost", flush=True)
            lost = True
            slurm.lose_node()
            time.sleep(15)
            slurm.start_node()
            continue
        victims = task_runners(slurm)
        if not victims or kills["task"] + kills["item"] >= max(6, items / 8):
            continue
        victim = draw.choice(victims)
        inner = pathlib.Path(f"/proc/{victim}/task/{victim}/children")
        if draw.random() < 0.5 and inner.exists() and inner.read_text():
            victim, what = int(inner.read_text().split()[0]), "item"
        else:
            what = "task"
        try:
            os.kill(victim, signal.SIGKILL)
            kills[what] += 1
        except OSError:
            pass
    said = batch.communicate()[0]
    print(f"killed: {kills['task']} tasks, {kills['item']} items; node lost: {lost}; exit code {batch.returncode}", flush=True)
    again = 0
    while batch.returncode != 0 and again < 5:  # an item that was killed twice is a failure, which the next call does
        again += 1
        batch = start("batch", "discover", fleet, "--slurm", "--out", root / "slurm")
        said = batch.communicate()[0]
    check(batch.returncode == 0, f"the batch did not end well: {said}")
    print(f"called again {again} times; jobs submitted: {(root / 'slurm/job').read_text().strip()}", flush=True)


def campaign(items):
    print(f"making {items} benches, {load()}", flush=True)
    fleet = make_fleet(items)
    # At the same time, so that both see the same machine.
    local = start("batch", "discover", fleet, "--local", 3, "--out", root / "local")
    slurm = node.Node(root / "node", slots=3)
    environment.update(slurm.environment)
    begin = time.monotonic()
    try:
        disturbed(slurm, fleet, items)
        print(f"by Slurm, disturbed: {time.monotonic() - begin:.0f} s, {load()}", flush=True)
    finally:
        slurm.stop()
    said = local.communicate()[0]
    check(local.returncode == 0, f"--local: {said}")
    print(f"both: {time.monotonic() - begin:.0f} s, {load()}", flush=True)
    print(f"{check_same('local', 'slurm')} files are the same to the byte", flush=True)
    # Undisturbed, on one slot and on two.
    short = root / "short.json"
    short.write_text(json.dumps(dict(json.loads(fleet.read_text()), items=json.loads(fleet.read_text())["items"][:24])))
    for slots in (1, 2):
        slurm = node.Node(root / f"node-{slots}", slots=slots)
        environment.update(slurm.environment)
        try:
            for what, folder in (("local", f"local-{slots}"), ("slurm", f"slurm-{slots}")):
                how = ["--slurm"] if what == "slurm" else ["--local", slots]
                begin = time.time()
                call("batch", "discover", short, *how, "--out", root / folder)
                print(f"{what}, {slots} slots: {told(folder, slots, begin, time.time())}", flush=True)
        finally:
            slurm.stop()
        check_same(f"local-{slots}", f"slurm-{slots}")


try:
    if arguments.items:
        campaign(arguments.items)
    else:
        slurm_node = node.Node(root / "node", slots=2)
        environment.update(slurm_node.environment)
        try:
            small(slurm_node)
        finally:
            slurm_node.stop()
finally:
    if not arguments.keep:
        shutil.rmtree(root, ignore_errors=True)

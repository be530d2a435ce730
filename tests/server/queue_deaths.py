#!/usr/bin/env python3
"""A plan that outlives its daemon: killed again and again at random moments, alone or with its bench process.

    queue_deaths.py FERROBENCH                        a few kills
    queue_deaths.py FERROBENCH --kills 10 --seed 1    5 rates x 4 prestresses x 2 repeats

What must hold: in the end every run of the plan is complete, none was made twice but those that broke off and were asked
for again, no output is left on, and the summary says what the recordings say. Then once more with a plan that asks for no
repetition: what broke off stays so, and nothing is run twice.
"""

import argparse
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time

import daemon_client
from bench_deaths import Daemon, demand, fail

LOOP = {"format": "ferrobench-protocol", "version": 1, "name": "loop", "unit": "kV/mm", "sample_rate_Hz": 200,
        "parameters": {"rate": 4},
        "segments": [{"kind": "ramp", "to": 0.5, "rate": "$rate"}, {"kind": "ramp", "to": 0, "rate": "$rate"}]}


def plan(rates, prestresses, repeats, repeat_broken):
    return {"name": "night", "run": {"protocol": LOOP, "model": "soft-pzt"}, "repeats": repeats, "shuffle": True, "seed": 3,
            "resume": "automatic", "repeat_broken": repeat_broken,
            "wait": {"channel": "displacement", "value": 0, "tolerance": 50, "unit": "um", "for_s": 0.2, "timeout_s": 5},
            "sweeps": [{"set": "rate", "from": 2, "to": 8, "count": rates, "spacing": "logarithmic"},
                       {"set": "prestress_MPa", "from": 2, "to": 8, "count": prestresses}]}


def listed(daemon):
    return daemon.ask("queue.list", count=1000)


def at_rest(daemon):
    queue = listed(daemon)["queue"]
    return queue["state"] == "stopped" and queue["item"] == 0


def kill(daemon, draw):
    """The daemon, or all that a power cut would end."""
    benches = daemon.bench() if draw.random() < 0.5 else []
    daemon.kill()
    for process in benches:
        try:
            os.kill(process, signal.SIGKILL)
        except ProcessLookupError:
            pass


def through_the_night(daemon, draw, kills, **what):
    daemon.start()
    added = daemon.ask("queue.add", plan=plan(**what))
    demand(daemon.ask("run.status")["state"] == "idle", "adding starts nothing")
    daemon.ask("queue.start")
    for left in range(kills, 0, -1):
        end = time.time() + draw.uniform(0.05, 1.2)
        while time.time() < end and not at_rest(daemon):
            time.sleep(0.02)
        kill(daemon, draw)
        daemon.start()
        if at_rest(daemon) and listed(daemon)["queue"]["reason"] == "the queue is empty":
            print(f"  over with {left - 1} kills left", file=sys.stderr)
            break
    daemon.until(lambda: at_rest(daemon), 120, "the queue is at rest")
    final = listed(daemon)
    demand(final["queue"]["reason"] == "the queue is empty", "the queue was stopped", final["queue"])
    items = [item for item in final["items"] if item["plan"] == added["plan"]]
    demand(len(items) == added["count"] == what["rates"] * what["prestresses"] * what["repeats"], "the runs", len(items))
    return added["plan"], items


def check_recordings(daemon, items, whole_before):
    """Every recording is of an item, and every complete item has one, of its own settings, that ends at zero."""
    by_name = {}
    for item in items:
        if item["state"] != "complete":
            continue
        info = daemon.ask("recording.info", name=item["recording"])
        demand(info["status"] == "complete" and info["identifier"] == item["run"], "the recording", item, info["status"])
        demand(abs(info["protocol"]["parameters"]["rate"] - item["values"]["rate"]) < 1e-12, "the rate", item)
        demand(abs(info["load"]["prestress_Pa"] - 1e6 * item["values"]["prestress_MPa"]) < 1e-3, "the prestress", item)
        demand(item["recording"] not in by_name, "a recording of two items", item)
        by_name[item["recording"]] = item
    files = daemon.ask("recording.list")["recordings"]
    complete = {row["name"] for row in files if row["status"] == "complete"}
    demand(complete - whole_before == set(by_name), "complete recordings are those of the items, each once",
           sorted(complete - whole_before - set(by_name)))
    journals = [n for n in os.listdir(f"{daemon.folder}/recordings") if "journal" in n]
    demand(not journals, "a journal is left", journals, open(daemon.log).read())
    return complete


def check_summary(daemon, number, items):
    summary = daemon.ask("queue.summary", plan=number, figures=["stroke.stroke_um"])
    rows = {row["recording"]: row for row in summary["runs"]["rows"] if row["recording"]}
    complete = [item for item in items if item["state"] == "complete"]
    for item in random.Random(1).sample(complete, min(5, len(complete))):
        row = rows[item["recording"]]
        demand(row["rate"] == item["values"]["rate"] and row["repeat"] == item["repeat"], "the row", row, item)
        strokes = [r["stroke_um"] for r in daemon.ask("recording.report", name=item["recording"])["stroke"]["rows"]]
        demand(abs(row["stroke.stroke_um"] - sum(strokes) / len(strokes)) < 1e-9, "the figure", row, strokes)
    groups = summary["means"]["rows"]
    demand(sum(row["runs"] for row in groups) == len(complete), "the means count the complete runs")
    for row in groups:
        own = [rows[i["recording"]]["stroke.stroke_um"] for i in complete
               if i["values"]["rate"] == row["rate"] and i["values"]["prestress_MPa"] == row["prestress_MPa"]]
        demand((row["stroke.stroke_um"] is None and not own) or abs(row["stroke.stroke_um"] - sum(own) / len(own)) < 1e-9,
               "the mean", row, own)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--kills", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    draw = random.Random(arguments.seed)
    folder = tempfile.mkdtemp()
    daemon = Daemon(arguments.program, folder)
    size = dict(rates=5, prestresses=4, repeats=2) if arguments.kills >= 10 else dict(rates=3, prestresses=2, repeats=2)
    try:
        begin = time.time()
        number, items = through_the_night(daemon, draw, arguments.kills, repeat_broken=1000, **size)
        broken = sum(item["runs"] - 1 for item in items)
        demand(all(item["state"] == "complete" for item in items), "every run is complete", items)
        demand(broken <= arguments.kills, "no more were repeated than broke off", broken)
        demand(daemon.ask("run.status")["output_at_zero"], "the output is at zero")
        whole = check_recordings(daemon, items, set())
        check_summary(daemon, number, items)
        print(f"{len(items)} runs complete after {arguments.kills} kills, {broken} of them repeated, "
              f"{time.time() - begin:.0f} s")
        daemon.end()

        if arguments.kills < 10:
            number, items = through_the_night(daemon, draw, max(2, arguments.kills // 3), repeat_broken=0,
                                              **dict(size, repeats=1))
            demand(all(item["runs"] == 1 for item in items), "nothing is run twice", items)
            demand(all(item["state"] in ("complete", "broken_off") for item in items), "complete or broken off", items)
            check_recordings(daemon, items, whole)
            print(f"{sum(i['state'] == 'complete' for i in items)} runs complete, "
                  f"{sum(i['state'] == 'broken_off' for i in items)} broken off and not repeated")
        daemon.end()
        daemon.until(lambda: not daemon.bench(), 20, "no bench process is left")
    except Exception as error:
        print(json.dumps(listed(daemon), indent=1) if daemon_client.answers(folder) else "", file=sys.stderr)
        fail(f"{error!r}\n{open(daemon.log).read()}")
    finally:
        daemon.end()
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()

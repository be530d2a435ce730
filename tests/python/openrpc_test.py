"""What the daemon says of itself is what the package was made from, and its examples are calls that it takes."""
import os
import pathlib
import re
import subprocess
import sys
import unittest

import jsonschema

import ferrobench

PACKAGE = pathlib.Path(ferrobench.__file__).parent.parent
# Their examples name what only a run or a job of the moment has: the id of a device, a job, or a lease, a run to pause, a recording to average.
OF_THE_MOMENT = {"device.close", "device.info", "device.selftest", "discrepancy.result", "discrepancy.status", "job.cancel",
                 "job.status", "lease.present", "queue.confirm", "recording.average", "run.pause", "run.resume", "run.abort", "lease.release", "lease.renew"}
# They take minutes, or end what the others need.
LONG = {"discrepancy.start", "table.run"}
FIRST, LAST = ["recording.import"], ["recording.delete", "unsubscribe", "model.fit"]


class OpenRpc(unittest.TestCase):
    def setUp(self):
        self.bench = ferrobench.connect()
        self.addCleanup(self.bench.close)
        self.document = self.bench.call("rpc.discover")

    def test_the_package_is_up_to_date(self):
        text = subprocess.run([os.environ["FERROBENCH"], "call", "rpc.discover"], capture_output=True, text=True, check=True).stdout
        done = subprocess.run([sys.executable, PACKAGE / "generate.py", "-", "--check"], input=text, capture_output=True, text=True)
        self.assertEqual((done.returncode, done.stderr), (0, ""))

    def test_the_package_has_every_method(self):
        calls = []
        methods = ferrobench.api.Methods(lambda name, params: calls.append((name, set(params))))
        for method in self.document["methods"]:
            area, _, verb = method["name"].rpartition(".")
            verb += "_" if verb == "import" else ""
            required = [p["name"] for p in method["params"] if p["required"]]
            getattr(getattr(methods, area) if area else methods, verb)(*required)
            self.assertEqual(calls[-1], (method["name"], {p["name"] for p in method["params"]}))
        self.assertEqual(set(ferrobench.api.ERRORS), set(self.document["components"]["errors"]))
        self.assertEqual(set(ferrobench.api.TOPICS), {t["name"] for t in self.document["x-notifications"]})

    def test_the_types_that_are_named_are_there(self):
        for file in PACKAGE.glob("ferrobench/*.py"):
            for name in re.findall(r"\bapi\.([A-Z]\w+)", file.read_text()):
                self.assertTrue(hasattr(ferrobench.api, name), f"{file.name}: api.{name}")

    def test_examples_are_taken_and_results_are_as_described(self):
        methods = {m["name"]: m for m in self.document["methods"]}
        parameters = {name: {p["name"]: p["value"] for p in m["examples"][0]["params"]} for name, m in methods.items()}
        for name, m in methods.items():
            for p in m["params"]:
                if p["name"] in parameters[name]:
                    jsonschema.validate(parameters[name][p["name"]], p["schema"])
        for name in ("loops", "loops-again"):
            self.bench.call("recording.import", **{**parameters["recording.import"], "name": name})
        self.bench.call("recording.delete", name="loops")  # the example makes it
        usual = [n for n in methods if n not in {*OF_THE_MOMENT, *LONG, *FIRST, *LAST}]
        for name in FIRST + usual + LAST:
            with self.subTest(name):
                result = self.call_when_free(name, parameters[name])
                jsonschema.validate(result, methods[name]["result"]["schema"])
                if name == "lease.acquire":
                    self.bench.call("lease.release")

    def call_when_free(self, name, parameters):
        while True:
            try:
                return self.bench.call(name, **parameters)
            except ferrobench.Busy:  # a run of an example before goes on
                ferrobench.Run(self.bench, self.bench.status).stop()


unittest.main(verbosity=2)

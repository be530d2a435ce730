"""The package against the daemon of daemon_test.sh: DATA is its folder, URL and TOKEN are its address and secret."""
import json
import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import h5py
import numpy as np

import ferrobench
from ferrobench import units

SITE = os.environ["URL"].removesuffix("/rpc")
TOKEN_FILE = os.path.join(os.environ["DATA"], "token")
# Up to 0.5 kV/mm in 0.1 s, then as long a hold as is asked for.
HOLD = {"format": "ferrobench-protocol", "version": 1, "name": "hold", "unit": "kV/mm", "sample_rate_Hz": 200, "start": 0,
        "parameters": {"hold": 60}, "segments": [{"kind": "ramp", "to": 0.5, "rate": 5}, {"kind": "hold", "time": "$hold"},
                                                 {"kind": "ramp", "to": 0, "rate": 5}]}


class WithBench(unittest.TestCase):
    def setUp(self):
        self.bench = ferrobench.connect()
        self.addCleanup(self.bench.close)

    def another(self, **how):
        bench = ferrobench.connect(**how)
        self.addCleanup(bench.close)
        return bench

    def assert_at_zero(self):
        status = self.bench.status
        self.assertEqual((status["state"], status["output_at_zero"]), ("aborted", True))
        return status


class Recordings(WithBench):
    def test_channels_are_what_the_file_has(self):
        r = self.bench.run("full-loops", rate=10, prestress_MPa=16, fast=True, notes="a note")
        with h5py.File(r.path) as file:
            data = file["entry/data"]
            for name in r.channels:
                self.assertEqual(r[name].unit, data[name].attrs["units"])
                np.testing.assert_array_equal(r[name], data[name][()])
        self.assertEqual(r.channels, ["time", "command", "field", "charge", "displacement", "force"])
        self.assertEqual(r.load["prestress_Pa"], 16e6)
        self.assertEqual(len(r), len(r["time"]))
        self.assertAlmostEqual(r["command"].to("kV/mm").min(), -1.5, places=9)
        np.testing.assert_allclose(r["strain"], r["displacement"].values / 0.01)
        np.testing.assert_allclose(r["polarization"], r["charge"].values / (100 * 25e-6))
        self.assertEqual(r["polarization"].unit, "C/m^2")
        self.assertNotIn("current", r)
        with self.assertRaisesRegex(KeyError, "was not measured; there are time, command"):
            r["current"]

    def test_segments_cut_the_samples(self):
        r = self.bench.run("full-loops", rate=10, fast=True)
        down = r["command"].to("kV/mm")[r.segment("cycle 1 down")]
        self.assertAlmostEqual(down[0], 1.5)
        self.assertTrue((np.diff(down) < 0).all())
        np.testing.assert_array_equal(down, r["command"].to("kV/mm")[r.segment(0)])
        self.assertEqual(r.segments["level"].unit, "V/m")
        with self.assertRaisesRegex(KeyError, "there are cycle 1 down"):
            r.segment("cycle 9")

    def test_tables_have_units_and_uncertainties(self):
        r = self.bench.run("full-loops", rate=10, fast=True)
        self.assertIn("hysteresis", r.tables)
        stroke = r.table("stroke")
        self.assertEqual((stroke["stroke_um"].unit, stroke.columns["stroke_um"]), ("µm", "stroke"))
        # The same stroke, from the samples themselves, but for their noise.
        self.assertAlmostEqual(stroke["stroke_um"][1], np.ptp(r["displacement"].to("µm")), delta=0.3)
        self.assertGreater(stroke["stroke_um_uncertainty"][0], 0)
        self.assertLess(stroke["stroke_um_uncertainty"][0], 0.1)
        self.assertTrue(np.isnan(stroke["stroke_um_uncertainty"][2]), "overall figures have none")
        with self.assertRaisesRegex(KeyError, "no table 'creeep', but stroke"):
            r.table("creeep")

    def test_pandas(self):
        r = self.bench.run("full-loops", rate=10, fast=True)
        frame = r.to_pandas("field", "displacement")
        self.assertEqual(list(frame.columns), ["field", "displacement"])
        self.assertEqual(frame.attrs["units"], {"time": "s", "field": "V/m", "displacement": "m"})
        np.testing.assert_array_equal(frame.index, r["time"])
        table = r.table("stroke").to_pandas()
        self.assertEqual(table["cycle"].tolist(), ["1", "2", "overall"])
        self.assertEqual(table.attrs["units"]["stroke_um"], "µm")

    def test_a_file_without_a_daemon(self):
        r = self.bench.run("full-loops", rate=10, fast=True)
        with tempfile.TemporaryDirectory() as folder:
            file = r.save(pathlib.Path(folder) / "mine.h5")
            with self.assertRaisesRegex(ferrobench.InvalidParams, "is there already"):
                r.save(file)
            mine = ferrobench.open(file)
            np.testing.assert_array_equal(mine["displacement"], r["displacement"])
            self.assertEqual(mine.table("stroke").rows, r.table("stroke").rows)
            (pathlib.Path(folder) / "text.h5").write_text("no HDF5")
            with self.assertRaises(ferrobench.BadRecording):
                ferrobench.open(pathlib.Path(folder) / "text.h5")
            with self.assertRaises(ferrobench.NotFound):
                ferrobench.open(pathlib.Path(folder) / "none.h5")
            with h5py.File(pathlib.Path(folder) / "other.h5", "w") as other:
                other["x"] = [1, 2]
            with self.assertRaisesRegex(ferrobench.BadRecording, "ferrobench import"):
                ferrobench.open(pathlib.Path(folder) / "other.h5")

    def test_lists(self):
        r = self.bench.run("full-loops", rate=10, fast=True)
        self.assertEqual(self.bench.recordings()["name"][0], r.name)
        self.assertIn("full-loops", self.bench.protocols()["name"])
        self.assertIn("soft-pzt", self.bench.models()["name"])
        effects = self.bench.effects()
        self.assertGreater(len(effects), 30)
        self.assertIn("coefficient [V s m/C]", effects.rows[list(effects["id"]).index("domain_wall_drag")]["parameters"])

    def test_models_and_tables(self):
        r = self.bench.run("full-loops", rate=10, fast=True)
        stages = []
        simulated = self.bench.simulate(r, "soft-pzt", progress=lambda status: stages.append(status["state"]))
        self.assertEqual(stages[-1], "complete")
        self.assertEqual(len(simulated), len(r))
        self.assertFalse(np.array_equal(simulated["charge"], r["charge"]))
        again = self.bench.replay(r, fast=True)
        np.testing.assert_array_equal(again["displacement"], r["displacement"])

    def test_a_fit_comes_nearer(self):
        r = self.bench.run("full-loops", rate=10, fast=True, set={"model.material.barrier": 4e4})
        fitted = self.bench.fit([r], "nec-ae0505d08", free=["material.barrier"], starts=1, iterations=3)
        self.assertLess(fitted["cost_after"], fitted["cost_before"])
        before, after = (abs(m["material"]["barrier"] - 4e4) for m in (self.bench.methods.model.get("nec-ae0505d08")["model"],
                                                                       fitted["model"]))
        self.assertLess(after, before)
        with self.assertRaises(ferrobench.InvalidParams):
            self.bench.fit([r], free=["material.no_such"], starts=1)

    def test_published_tables(self):
        measured = self.bench.published_table("3.13")
        compared = self.bench.published_table("3.13", [self.bench.run("stage-full-range", fast=True)])
        self.assertEqual(list(measured.columns), list(compared.columns))
        self.assertEqual(list(measured["published"]), list(compared["published"]))
        np.testing.assert_allclose(measured["error_percent"], 100 * (measured["measured"] / measured["published"] - 1), rtol=1e-12)
        self.assertLess(np.abs(measured["error_percent"]).max(), 50)

    def test_a_job_that_is_interrupted_is_cancelled(self):
        r = self.bench.run("full-loops", rate=10, fast=True)
        job = ferrobench.Job(self.bench, self.bench.methods.discrepancy.start(recordings=[r.name], model="soft-pzt"))
        with self.assertRaises(KeyboardInterrupt):
            job.wait(progress=lambda status: signal.raise_signal(signal.SIGINT))
        with self.assertRaises(ferrobench.Cancelled):
            job.wait()


class Runs(WithBench):
    def test_the_same_seed_gives_the_same_samples(self):
        one, two, other = (self.bench.run("full-loops", rate=10, fast=True, seed=s) for s in (5, 5, 6))
        np.testing.assert_array_equal(one["displacement"], two["displacement"])
        self.assertFalse(np.array_equal(one["displacement"], other["displacement"]))

    def test_live_samples_from_the_first_to_the_last(self):
        with self.bench.start("full-loops", rate=10, live=True) as run:
            parts = list(run.samples())
        r = run.wait()
        times = np.concatenate([p.time.values for p in parts])
        self.assertGreater(len(parts), 3)
        self.assertEqual((times[0], sum(p.lost for p in parts)), (0.0, 0))
        self.assertTrue((np.diff(times) > 0).all())
        self.assertGreater(times[-1], 0.9 * r["time"][-1])
        # Stretches hold what the recording has: their extremes are its extremes, their first values are those of its rows.
        for name in ("field", "displacement", "force"):
            self.assertEqual(max(p.high[name].max() for p in parts), r[name].max())
            self.assertEqual(min(p.low[name].min() for p in parts), r[name].min())
        rows = np.searchsorted(r["time"], times - 1e-9)
        np.testing.assert_array_equal(np.concatenate([p["displacement"].values for p in parts]), r["displacement"][rows])

    def test_a_run_that_is_over_has_no_samples_to_come(self):
        run = self.bench.start("full-loops", rate=10, fast=True)
        run.wait()
        self.assertEqual(list(run.samples()), [])

    def test_events(self):
        heard = []

        def listen():
            with ferrobench.connect() as bench:
                for topic, told in bench.listen("run", timeout=20):
                    heard.append(told["state"])
                    if told["state"] == "complete":
                        return

        listener = threading.Thread(target=listen)
        listener.start()
        while listener.is_alive() and not heard:  # runs until the listener is there
            self.bench.run("full-loops", rate=10, fast=True)
        listener.join(20)
        self.assertEqual(heard[-1], "complete")

    def test_a_block_that_fails_stops_the_run(self):
        with self.assertRaises(ZeroDivisionError):
            with self.bench.start(HOLD) as run:
                while run.status["rows"] == 0:
                    time.sleep(0.02)
                1 / 0
        self.assertIn("ZeroDivisionError in Python", self.assert_at_zero()["reason"])
        self.assertTrue(run.over)
        with self.assertRaisesRegex(ferrobench.RunFailed, "was aborted: .*ZeroDivisionError"):
            run.wait()
        kept = self.bench.recording(run.status["recording"])
        self.assertEqual(kept.status, "aborted")

    def test_pause_and_resume(self):
        with self.bench.start(HOLD, hold=10) as run:
            while run.status["state"] != "running":  # one that is still on its way to the first level cannot wait
                time.sleep(0.02)
            run.pause()
            while run.status["state"] != "paused":
                time.sleep(0.02)
            run.resume()
            r = run.wait()
        self.assertEqual(r.status, "complete")

    def test_progress_is_told(self):
        told = []
        self.bench.run("full-loops", rate=10, progress=lambda s: told.append(s["progress"]))
        self.assertEqual(told, sorted(told))
        self.assertGreater(len(told), 3)

    def test_ctrl_c_while_a_run_is_started(self):
        call = self.bench._connection.call

        def interrupted(method, params, timeout=None):
            if method == "run.start":
                signal.raise_signal(signal.SIGINT)  # before the daemon has answered
            return call(method, params, timeout)

        self.bench._connection.call = interrupted
        with self.assertRaises(KeyboardInterrupt):
            self.bench.start(HOLD)
        self.assertIn("Ctrl-C in Python", self.assert_at_zero()["reason"])
        self.assertIs(signal.getsignal(signal.SIGINT), signal.default_int_handler)

    def test_ctrl_c_stops_the_run(self):
        program = ("import ferrobench, json, sys\nbench = ferrobench.connect()\nprint('begun', flush=True)\n"
                   "bench.run(json.loads(sys.argv[1]), progress=lambda s: print(s['state'], flush=True))")
        child = subprocess.Popen([sys.executable, "-c", program, json.dumps(HOLD)], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                 text=True)
        while "running" not in child.stdout.readline():
            self.assertIsNone(child.poll(), "it ended by itself")
        child.send_signal(signal.SIGINT)
        _, errors = child.communicate(timeout=30)
        self.assertIn("KeyboardInterrupt", errors)
        self.assertIn("Ctrl-C in Python", self.assert_at_zero()["reason"])


class Refusals(WithBench):
    def test_errors_have_classes_places_and_hints(self):
        with self.assertRaises(ferrobench.NotFound) as caught:
            self.bench.run("full-loop")
        self.assertEqual(caught.exception.hint, 'did you mean "full-loops"?')
        self.assertEqual(caught.exception.name, "not_found")
        with self.assertRaises(ferrobench.InvalidParams) as caught:
            self.bench.run("full-loops", rat=1)
        self.assertEqual(caught.exception.problems[0].path, "/set/rat")
        with self.assertRaises(ferrobench.LimitExceeded):
            self.bench.run({**HOLD, "segments": [{"kind": "ramp", "to": 5, "rate": 1}]})
        with self.assertRaises(ferrobench.InvalidParams):
            self.bench.call("run.start", protocoll="full-loops")
        with self.assertRaisesRegex(ferrobench.Error, "method"):
            self.bench.call("no.such")
        with self.assertRaisesRegex(ferrobench.InvalidParams, "not finite"):
            self.bench.run("full-loops", rate=float("nan"))
        with self.assertRaises(ferrobench.NotFound):
            self.bench.run(pathlib.Path("/no/such.json"))
        with self.bench.start(HOLD):
            with self.assertRaises(ferrobench.Busy):
                self.bench.run("full-loops")
            with self.assertRaisesRegex(ferrobench.BadState, "has no file yet"):
                self.bench.recording(self.bench.status["recording"])
            self.bench.methods.run.abort()
            while self.bench.status["state"] != "aborted":
                time.sleep(0.02)

    def test_numbers_of_numpy_are_numbers(self):
        for rate in np.array([10, 20]):
            self.assertEqual(self.bench.run("full-loops", rate=rate, fast=np.bool_(True)).status, "complete")

    def test_nobody_answers(self):
        with tempfile.TemporaryDirectory() as folder:
            with self.assertRaisesRegex(ferrobench.ConnectionLost, "ferrobench serve"):
                ferrobench.connect(data=folder)
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            with self.assertRaises(ferrobench.ConnectionLost):
                ferrobench.connect(f"http://127.0.0.1:{free.getsockname()[1]}", token_file=TOKEN_FILE)

    def test_addresses(self):
        for url in ("bench.lab:8377", "ftp://bench.lab", "http://bench.lab:8377"):
            with self.assertRaises(ferrobench.InvalidParams, msg=url):
                ferrobench.connect(url, token_file=TOKEN_FILE)
        with tempfile.TemporaryDirectory() as folder:
            wrong = pathlib.Path(folder) / "token"
            with self.assertRaisesRegex(ferrobench.Unauthorized, "token_file="):
                ferrobench.connect(SITE, token_file=wrong)
            wrong.write_text("0" * 64)
            with self.assertRaisesRegex(ferrobench.Unauthorized, "token is missing or wrong"):
                ferrobench.connect(SITE, token_file=wrong)


class Control(WithBench):
    def test_the_lease_keeps_others_away(self):
        other = self.another()
        with self.bench.control(duration=30):
            with self.assertRaises(ferrobench.NotController):
                other.run("full-loops", fast=True)
            with self.assertRaises(ferrobench.NotController):
                other.control()
            self.assertEqual(self.bench.run("full-loops", rate=10, fast=True).status, "complete")
            run = self.bench.start(HOLD)
            other.methods.run.abort(run=run.id)  # this passes for everybody
            with self.assertRaises(ferrobench.RunFailed):
                run.wait()
        self.assertEqual(other.run("full-loops", rate=10, fast=True).status, "complete")

    def test_it_is_renewed(self):
        other = self.another()
        with self.bench.control(duration=3):
            time.sleep(6.5)
            with self.assertRaises(ferrobench.NotController):
                other.run("full-loops", fast=True)
            self.bench.run("full-loops", rate=10, fast=True)

    def test_it_holds_on_a_new_connection(self):
        with self.bench.control(duration=30):
            self.bench._connection.close()  # as the daemon does after a minute of silence
            self.assertEqual(self.bench.run("full-loops", rate=10, fast=True).status, "complete")

    def test_a_lost_lease_is_told(self):
        with self.bench.control(duration=1.5) as lease:
            self.another().call("lease.release", lease=lease.id)
            for _ in range(400):
                if lease.lost:
                    break
                time.sleep(0.05)
            with self.assertRaisesRegex(ferrobench.NotController, "the lease was lost"):
                self.bench.run("full-loops", fast=True)
        self.bench.run("full-loops", rate=10, fast=True)


class Remote(WithBench):
    """Over TCP: WebSocket for calls and samples, HTTP for files."""

    def setUp(self):
        super().setUp()
        self.far = self.another(url=SITE, token_file=TOKEN_FILE)

    def test_a_run_and_its_file(self):
        with self.far.start("full-loops", rate=10, live=True) as run:
            longest = max(part.high["displacement"].max() for part in run.samples(max_rate=5))
        r = run.wait()
        near = self.bench.recording(r.name)
        self.assertNotEqual(r.path, near.path)
        self.assertEqual(r.path.read_bytes(), near.path.read_bytes())
        self.assertEqual(longest, r["displacement"].max())
        self.far.close()
        self.assertFalse(r.path.exists(), "what was fetched goes with the bench")

    def test_long_messages(self):
        points = [{"kind": "ramp", "to": 0.001 * (i % 500), "rate": 10} for i in range(4000)]
        program = {**HOLD, "parameters": {}, "segments": points}
        self.assertGreater(len(str(program)), 1 << 16)
        checked = self.far.methods.protocol.validate(program)
        self.assertEqual(checked, {"valid": True, "problems": []})

    def test_the_daemon_hangs_up(self):
        self.assertEqual(self.far.call("lease.status")["holder"], "")
        self.far._connection._line._socket.shutdown(socket.SHUT_RDWR)
        self.assertIn(self.far.status["state"], ("idle", "complete", "aborted"))

    def test_the_daemon_hangs_up_on_a_subscription(self):
        with self.far.start("full-loops", rate=10, live=True) as run:
            run._live._line._socket.shutdown(socket.SHUT_RDWR)
            with self.assertRaisesRegex(ferrobench.ConnectionLost, "of a subscription"):
                next(run.samples())
            self.assertEqual(run.wait().status, "complete")

    def test_a_connection_that_breaks_in_a_start_starts_once(self):
        before = len(self.far.methods.run.list()["runs"])
        connection = self.far._connection
        ask = connection._ask

        def ask_and_break(method, params, timeout=None):
            out = ask(method, params, timeout)
            if method == "run.start" and connection._ask is ask_and_break:
                connection._ask = ask
                raise EOFError
            return out

        connection._ask = ask_and_break
        r = self.far.run("full-loops", rate=10, fast=True)
        self.assertEqual((r.status, len(self.far.methods.run.list()["runs"])), ("complete", before + 1))

    def test_nothing_that_changes_is_asked_twice(self):
        connection = self.far._connection
        sent = []

        def break_it(method, params, timeout=None):
            sent.append(method)
            raise EOFError

        connection._ask = break_it
        with self.assertRaisesRegex(ferrobench.ConnectionLost, "may have been carried out"):
            self.far.methods.limits.set(field_max=1.5e6)
        self.assertEqual(sent, ["limits.set"])


class Tls(unittest.TestCase):
    """A daemon of its own with a certificate."""

    def test_calls_samples_and_files(self):
        with tempfile.TemporaryDirectory() as folder:
            pem, key = f"{folder}/bench.pem", f"{folder}/bench.key"
            subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2",
                            "-subj", "/CN=127.0.0.1", "-addext", "subjectAltName=IP:127.0.0.1", "-keyout", key, "-out", pem],
                           check=True, capture_output=True)
            os.chmod(key, 0o600)
            daemon = subprocess.Popen([os.environ["FERROBENCH"], "--data", f"{folder}/data", "serve", "--port", "0", "--token-file",
                                       f"{folder}/token", "--tls-certificate", pem, "--tls-key", key], stdout=subprocess.PIPE, text=True)
            try:
                for line in daemon.stdout:
                    if "JSON-RPC" in line:
                        site = line.split()[1].removesuffix("/rpc")
                        break
                self.assertTrue(site.startswith("https://"), site)
                with self.assertRaisesRegex(ferrobench.ConnectionLost, "certificate"):
                    ferrobench.connect(site, token_file=f"{folder}/token")  # nobody has signed it
                with ferrobench.connect(site, token_file=f"{folder}/token", ca=pem) as bench:
                    with bench.start("full-loops", rate=10, live=True) as run:
                        longest = max(part.high["displacement"].max() for part in run.samples())
                    self.assertEqual(longest, run.wait()["displacement"].max())
            finally:
                daemon.terminate()
                daemon.wait(30)
                daemon.stdout.close()


class Units(unittest.TestCase):
    def test_factors(self):
        for have, want, by in (("m", "µm", 1e6), ("V/m", "kV/mm", 1e-6), ("C", "uC", 1e6), ("C/m^2", "µC/cm^2", 100), ("Pa", "MPa", 1e-6),
                               ("kV/mm/s", "V/m/s", 1e6), ("m", "m", 1), ("1", "%", 100), ("µm kV/mm", "m V/m", 1), ("N/m", "N/µm", 1e-6)):
            self.assertAlmostEqual(units.factor(have, want) / by, 1, places=14, msg=f"{have} {want}")

    def test_what_cannot_be(self):
        for have, want in (("m", "V"), ("m", "furlong"), ("V/m", "V")):
            with self.assertRaises(ferrobench.Error, msg=f"{have} {want}"):
                units.factor(have, want)

    def test_a_channel_is_an_array_to_numpy(self):
        c = ferrobench.Channel("displacement", "m", [1e-6, 3e-6, np.nan])
        self.assertEqual(type(c * 2), np.ndarray)
        self.assertEqual(np.nanmax(c), 3e-6)
        self.assertEqual((len(c), c.shape, c.to("µm").label), (3, (3,), "displacement [µm]"))
        np.testing.assert_array_equal(np.isnan(c), [False, False, True])
        self.assertEqual(str(c), "<displacement [m], 3 values>")


unittest.main(verbosity=2)

"""The examples and the cells of the notebooks run, each in a folder of its own, against the daemon of daemon_test.sh."""
import contextlib
import io
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).parent
EXAMPLES = HERE.parent.parent / "server" / "python" / "examples"


def run_script(path, folder):
    return subprocess.run([sys.executable, path], cwd=folder, capture_output=True, text=True, check=True,
                          env={**os.environ, "MPLBACKEND": "Agg"}).stdout


class Examples(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def test_none_is_left_out(self):
        tested = {name.removeprefix("test_") for name in dir(self) if name.startswith("test_")}
        self.assertLessEqual({path.stem for path in EXAMPLES.iterdir()}, tested)

    def test_first_run(self):
        out = run_script(EXAMPLES / "first_run.py", self.folder)
        self.assertRegex(out, r"stroke 2[34]\.\d\d µm over 3\.00 kV/mm")
        self.assertRegex(out, r"coercive field, rising: -0\.2\d+ kV/mm")

    def test_live(self):
        out = run_script(EXAMPLES / "live.py", self.folder)
        self.assertIn("output at zero: True", out)
        self.assertRegex(out, r"(?m)^ +0\.\d\d s ")

    def test_sweep(self):
        run_script(EXAMPLES / "sweep.py", self.folder)
        lines = (self.folder / "sweep.csv").read_text().splitlines()
        self.assertEqual(len(lines), 7)
        self.assertTrue(lines[0].startswith("rate [kV/mm/s],prestress [MPa],stroke [µm]"))

    def test_model_against_measurement(self):
        out = run_script(EXAMPLES / "model_against_measurement.py", self.folder)
        for channel in ("charge", "displacement", "force"):
            self.assertRegex(out, channel + r" +rms \S+ \S+, \d+\.\d % of its range")

    def test_errors(self):
        out = run_script(EXAMPLES / "errors.py", self.folder)
        self.assertIn("/segments/0", out)
        self.assertIn('did you mean "full-loops"?', out)

    def test_first_afternoon(self):
        shown = self.notebook(EXAMPLES / "first_afternoon.ipynb")
        self.assertIn("rms", shown)
        self.assertIn("is outside its range", shown)
        self.assertIn("<table>", shown)

    def notebook(self, path):
        """Runs the cells one after the other in one space of names, and shows the value of each last line, as Jupyter does."""
        os.environ["MPLBACKEND"] = "Agg"
        names, out = {}, io.StringIO()
        with contextlib.chdir(self.folder), contextlib.redirect_stdout(out):
            for number, cell in enumerate(json.loads(path.read_text())["cells"]):
                if cell["cell_type"] != "code":
                    continue
                *lines, last = "".join(cell["source"]).splitlines()
                try:
                    value = compile(last, f"{path.name}, cell {number}", "eval")
                except SyntaxError:
                    lines, value = [*lines, last], None
                exec(compile("\n".join(lines), f"{path.name}, cell {number}", "exec"), names)
                if value is not None:
                    shown = eval(value, names)
                    print(shown._repr_html_() if hasattr(shown, "_repr_html_") else shown)
        return out.getvalue()


unittest.main(verbosity=2)

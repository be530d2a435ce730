"""commands.py SOURCE BUILD PROGRAM: the commands that the READMEs print.

Those of the top README are run as printed, one after the other in a folder of their own, but for what takes long or
needs other machines: of these, and of those in the other READMEs, command and options must be in the help. Targets and
programs that are named must be known to the build.
"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

source, build, program = (pathlib.Path(argument).resolve() for argument in sys.argv[1:])
not_run = re.compile(r"table 3\.11|discover --model|batch|--device usb|--address|--url")
# What the build knows only with options of its own.
own_build = {source / "tests/bench/README.md", source / "tests/fuzz/README.md"}
failed = []


def commands(readme):
    """The lines of code, joined where one goes on, without their comments."""
    text = re.sub(r"\\\n +", "", readme.read_text(encoding="utf-8"))
    for line in re.findall(r"^ {4,}(\S.*)$", text, re.MULTILINE):
        yield re.sub(r"\s+#.*", "", line)


def check_help(line):
    words = line.split()
    name = next((word for word in words[1:] if not word.startswith("-")), "")
    names = words[1:3] if name == "batch" else [name]  # whose options are those of its own commands
    shown = subprocess.run([program, *names, "--help"], capture_output=True, text=True, check=False)
    missing = [word for word in words[1:] if word.startswith("--") and word not in shown.stdout + top_help]
    if shown.returncode or missing:
        failed.append(f"{line}\n  the help knows no {missing or name}")


def run(line, folder, environment):
    if "NAME" in line:
        listed = subprocess.run([program, "list", "--format", "json"], cwd=folder, env=environment, capture_output=True,
                                text=True, check=True)
        line = line.replace("NAME", re.search(r'"name": "([^"]+)"', listed.stdout)[1])
    begin = time.monotonic()
    done = subprocess.run(["sh", "-c", line], cwd=folder, env=environment, capture_output=True, text=True, check=False)
    print(f"{done.returncode}  {time.monotonic() - begin:5.1f} s  {line}", flush=True)
    if done.returncode:
        failed.append(f"{line}\n{done.stdout[-500:]}{done.stderr[-500:]}")


def wait_for_daemon(call, what):
    for _ in range(600):
        told = subprocess.run(call, capture_output=True, text=True, check=False)
        if told.returncode == 0 and re.search(what, told.stdout):
            return
        time.sleep(0.1)
    failed.append(f"{' '.join(map(str, call))} did not tell {what}")


def check_top(folder):
    environment = dict(os.environ, HOME=str(folder), FERROBENCH_DATA=str(folder / "data"),
                       PATH=f"{program.parent}:{os.environ['PATH']}")
    for name in "XDG_DATA_HOME", "XDG_STATE_HOME", "FERROBENCH_LEASE":
        environment.pop(name, None)
    daemon = None
    call = [program, "--data", folder / "data", "call", "run.status"]
    ran = 0
    try:
        for line in commands(source / "README.md"):
            if not line.startswith("ferrobench ") or not_run.search(line):
                continue
            ran += 1
            if line == "ferrobench serve &":
                with open(folder / "daemon.log", "w", encoding="utf-8") as log:
                    daemon = subprocess.Popen([program, "serve", "--port", "0"], env=environment, stdout=log, stderr=log)
                wait_for_daemon(call, "state")
                continue
            if daemon and ".start" in line:  # one run at a time
                wait_for_daemon(call, '"state": "(complete|aborted|idle)"')
            run(line, folder, environment)
    finally:
        if daemon:
            daemon.terminate()
            if daemon.wait(timeout=60) != 0:
                failed.append("the daemon: " + (folder / "daemon.log").read_text(encoding="utf-8"))
    if ran < 15:
        failed.append(f"only {ran} commands were found in README.md")


def check_build(readme, line, targets):
    names = re.findall(r"\bbuild/bin/(\w+)", line)
    if found := re.search(r"ninja -C build ([\w ]+)", line):
        names += found[1].split()
    if found := re.search(r"--target ([\w ]+)", line):
        names += found[1].split()
    for name in names:
        if name not in targets:
            failed.append(f"{readme}: {line}\n  the build has no {name}")


top_help = subprocess.run([program, "--help"], capture_output=True, text=True, check=True).stdout
known = subprocess.run(["ninja", "-C", build, "-t", "targets", "all"], capture_output=True, text=True, check=True).stdout
targets = {re.sub(r".*/", "", line.split(":")[0]) for line in known.splitlines()}
readmes = [source / name for name in subprocess.run(
    ["git", "-C", source, "ls-files", "*README.md"], capture_output=True, text=True, check=True).stdout.split()]
for readme in readmes:
    for line in commands(readme):
        if line.startswith("ferrobench ") and (readme != source / "README.md" or not_run.search(line)):
            check_help(line)
        if readme not in own_build:
            check_build(readme, line, targets)
with tempfile.TemporaryDirectory() as folder:
    check_top(pathlib.Path(folder))
sys.exit("\n".join(failed) or 0)

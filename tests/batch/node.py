"""A Slurm of one node on loopback, started by hand as root: no systemd, no cgroups, no accounting.

Debian 12: slurmctld slurmd slurm-client munge
"""
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import time

PROGRAMS = "munged", "slurmctld", "slurmd", "sbatch", "squeue", "sinfo", "scancel"


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def is_possible():
    path = os.environ["PATH"] + ":/usr/sbin"
    return os.geteuid() == 0 and all(shutil.which(p, path=path) for p in PROGRAMS)


class Node:
    """`slots`: tasks at a time, whatever processors there are."""

    def __init__(self, folder, slots):
        self.folder = pathlib.Path(folder)
        self.host = socket.gethostname().split(".")[0]
        for name in ("munge", "state", "spool", "log", "run"):
            (self.folder / name).mkdir(parents=True, exist_ok=True)
        self.folder.chmod(0o755)
        key = self.folder / "munge/key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        self.config = self.folder / "slurm.conf"
        self.config.write_text(f"""
ClusterName=bench
SlurmctldHost={self.host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
CredType=cred/munge
AuthInfo=socket={self.folder}/munge/socket
SlurmctldPort={free_port()}
SlurmdPort={free_port()}
StateSaveLocation={self.folder}/state
SlurmdSpoolDir={self.folder}/spool
SlurmctldPidFile={self.folder}/run/slurmctld.pid
SlurmdPidFile={self.folder}/run/slurmd.pid
SlurmctldLogFile={self.folder}/log/slurmctld.log
SlurmdLogFile={self.folder}/log/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SwitchType=switch/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerType=sched/backfill
SchedulerParameters=batch_sched_delay=0,sched_interval=2,sched_min_interval=10000,bf_interval=2,max_rpc_cnt=0
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/none
MailProg=/bin/true
JobRequeue=1
ReturnToService=2
SlurmdTimeout=10
SlurmdParameters=config_overrides
KillWait=3
NodeName={self.host} NodeAddr=127.0.0.1 CPUs={slots} State=UNKNOWN
PartitionName=main Nodes={self.host} Default=YES MaxTime=INFINITE State=UP
""")
        self.environment = dict(os.environ, SLURM_CONF=str(self.config), PATH=os.environ["PATH"] + ":/usr/sbin")
        self.run("munged", "--force", f"--socket={self.folder}/munge/socket", f"--key-file={key}",
                 f"--pid-file={self.folder}/run/munged.pid", f"--log-file={self.folder}/log/munged.log",
                 f"--seed-file={self.folder}/munge/seed")
        self.run("slurmctld", "-f", self.config)
        self.start_node()

    def run(self, *words):
        return subprocess.run([*map(str, words)], env=self.environment, check=True, capture_output=True, text=True).stdout

    def start_node(self):
        self.run("slurmd", "-f", self.config)
        self.wait_for("idle", "mixed", "allocated")

    def wait_for(self, *states):
        for _ in range(600):
            said = subprocess.run(["sinfo", "-h", "-o", "%T"], env=self.environment, capture_output=True, text=True,
                                  check=False).stdout.strip()
            if said in states:
                return
            time.sleep(0.1)
        raise RuntimeError(f"the node did not become {states}; see {self.folder}/log")

    def processes(self, name):
        """Those of this Slurm, and of no other: they were told of its folder."""
        out = []
        for process in pathlib.Path("/proc").glob("[0-9]*"):
            try:
                words = (process / "cmdline").read_bytes()
                told = words + (process / "environ").read_bytes()
                if name in os.readlink(process / "exe") and str(self.folder).encode() in told:
                    out.append(int(process.name))
            except OSError:
                continue
        return out

    def lose_node(self):
        """As if the machine had lost its power: its daemon and all that it had started are gone at once."""
        for name in ("slurmd", "slurmstepd", "ferrobench"):
            for process in self.processes(name):
                if name != "ferrobench" or self.is_of_a_task(process):
                    os.kill(process, signal.SIGKILL)

    def is_of_a_task(self, process):
        try:
            return b"SLURM_ARRAY_TASK_ID=" in pathlib.Path(f"/proc/{process}/environ").read_bytes()
        except OSError:
            return False

    def stop(self):
        for name in ("slurmd", "slurmctld", "munged"):
            file = self.folder / f"run/{name}.pid"
            if not file.exists():
                continue
            process = int(file.read_text())
            try:
                if name in os.readlink(f"/proc/{process}/exe"):
                    os.kill(process, signal.SIGTERM)
                for _ in range(100):
                    os.readlink(f"/proc/{process}/exe")
                    time.sleep(0.1)
            except OSError:
                continue

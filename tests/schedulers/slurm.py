# SPDX-License-Identifier: Apache-2.0
"""Slurm's own daemons with this machine as their one node."""

from __future__ import annotations

import contextlib
import os
import pathlib
import socket
import subprocess
import time

CONFIGURATION = """ClusterName=oocpt
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
# A task that is queued again waits for as long as a credential lives.
AuthInfo=socket={folder}/munge.socket,cred_expire=5
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
MpiDefault=none
ReturnToService=2
KillWait=5
MinJobAge=5
SchedulerParameters=sched_interval=1,batch_sched_delay=0,sched_min_interval=0
NodeName={host} NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


class Slurm:
    """A cluster of one node, for as long as this object is used."""

    def __init__(self, folder: pathlib.Path) -> None:
        self.folder, self.daemons = folder, []
        for name in ("state", "spool"):
            (folder / name).mkdir(parents=True)
        (folder / "munge.key").write_bytes(os.urandom(128))
        (folder / "munge.key").chmod(0o400)
        host = socket.gethostname().split(".")[0]
        text = CONFIGURATION.format(host=host, folder=folder, ports=free_ports(2))
        (folder / "slurm.conf").write_text(text, encoding="utf-8")
        files = [f"--{name}={folder}/munge.{name}" for name in ("socket", "pid-file", "log-file", "seed-file")]
        self.start(["munged", "--foreground", "--force", f"--key-file={folder}/munge.key", *files])
        self.until(lambda: (folder / "munge.socket").exists(), "munged")
        self.start(["slurmctld", "-D", "-f", folder / "slurm.conf"])
        self.start(["slurmd", "-D", "-f", folder / "slurm.conf"])
        self.until(lambda: "idle" in self.ask("sinfo", "-h", "-o", "%t"), "the node")

    def start(self, line: list) -> None:
        log = (self.folder / f"{line[0]}.out").open("wb")
        self.daemons.append(
            subprocess.Popen(list(map(str, line)), env=self.variables() | {"PATH": path()}, stdout=log, stderr=log)
        )

    def variables(self) -> dict[str, str]:
        return os.environ | {"SLURM_CONF": f"{self.folder}/slurm.conf"}

    def ask(self, *line: str) -> str:
        done = subprocess.run(line, env=self.variables(), capture_output=True, text=True, check=False)
        return done.stdout.strip()

    def jobs(self) -> str:
        """The jobs that have not ended."""
        return self.ask("squeue", "-h", "-r", "-o", "%i %t %r")

    def until(self, is_there, what: str) -> None:
        end = time.monotonic() + 60
        while not is_there():
            if time.monotonic() > end:
                self.stop()
                raise RuntimeError(f"{what} of Slurm did not come up: {self.folder}")
            time.sleep(0.2)

    def stop(self) -> None:
        for daemon in reversed(self.daemons):
            daemon.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                daemon.wait(20)
            daemon.kill()
            daemon.wait()


def path() -> str:
    return f"{os.environ['PATH']}:/usr/sbin:/sbin"


def free_ports(count: int) -> list[int]:
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports

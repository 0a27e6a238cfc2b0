"""A campaign as a job array of Slurm, on a cluster of one node that the test starts. Requires `apt-get install slurm-wlm` and root."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import freeplay
from test_campaigns import COMMAND, SWEEP, holding, killing, wait_for_none, wait_for_two

PROGRAMS = ("slurmctld", "slurmd", "sbatch", "scancel", "sinfo", "squeue")


def program(name: str) -> str | None:
    return shutil.which(name, path=f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin")


def free_ports(count: int) -> list[int]:
    """Free TCP ports."""
    held = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [each.getsockname()[1] for each in held]
    for each in held:
        each.close()
    return ports


@pytest.fixture
def cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A cluster on this machine, with two cores and without authentication. Yields the name of its partition."""
    if not all(map(program, PROGRAMS)) or os.geteuid() != 0:
        pytest.skip("needs slurm-wlm and root")
    folder, host, ports = tmp_path / "slurm", socket.gethostname().split(".")[0], free_ports(2)
    for name in ("state", "spool"):
        (folder / name).mkdir(parents=True)
    lines = {
        "ClusterName": "freeplay", "SlurmctldHost": f"{host}(127.0.0.1)", "SlurmctldPort": ports[0], "SlurmdPort": ports[1],
        "SlurmUser": "root", "AuthType": "auth/none", "CredType": "cred/none", "StateSaveLocation": folder / "state",
        "SlurmdSpoolDir": folder / "spool", "SlurmctldPidFile": folder / "slurmctld.pid", "SlurmdPidFile": folder / "slurmd.pid",
        "ProctrackType": "proctrack/pgid", "TaskPlugin": "task/none", "JobAcctGatherType": "jobacct_gather/none", "MpiDefault": "none",
        "SchedulerType": "sched/builtin", "SelectType": "select/cons_tres", "SelectTypeParameters": "CR_Core", "ReturnToService": 2,
        "SwitchType": "switch/none", "MaxArraySize": 100001, "SlurmctldParameters": "enable_configless",
        "SchedulerParameters": "sched_min_interval=100000,batch_sched_delay=0", "MessageTimeout": 60, "SlurmdTimeout": 600,
    }  # fmt: skip
    text = "".join(f"{name}={value}\n" for name, value in lines.items() if name != "SlurmctldParameters")
    # The scheduler sees two cores, whatever the number of real ones.
    text += f"NodeName={host} NodeAddr=127.0.0.1 CPUs=2 RealMemory=100 State=UNKNOWN\nPartitionName=bench Nodes={host} Default=YES MaxTime=60 State=UP\n"
    config = folder / "slurm.conf"
    config.write_text(text + "SlurmdParameters=config_overrides\n")
    monkeypatch.setenv("SLURM_CONF", str(config))
    daemons = []
    try:
        for name, words in (("slurmctld", ["-D", "-i", "-f", str(config)]), ("slurmd", ["-D", "-f", str(config), "-N", host])):
            log = open(folder / f"{name}.log", "wb")
            daemons.append(subprocess.Popen([str(program(name)), *words], stdout=log, stderr=log, stdin=subprocess.DEVNULL))
        wait_until_idle(folder, daemons)
        yield "bench"
    finally:
        for daemon in reversed(daemons):
            daemon.terminate()
            daemon.wait()


def wait_until_idle(folder: Path, daemons: list[subprocess.Popen[bytes]]) -> None:
    """Waits until the node accepts tasks."""
    patience = time.monotonic() + 180.0
    while time.monotonic() < patience and all(daemon.poll() is None for daemon in daemons):
        told = subprocess.run([str(program("sinfo")), "-h", "-o", "%T"], capture_output=True, text=True)
        if told.stdout.strip() == "idle":
            return
        time.sleep(0.2)
    logs = "\n".join((folder / f"{name}.log").read_text(errors="replace")[-2000:] for name in ("slurmctld", "slurmd"))
    pytest.skip(f"Slurm does not start here: {logs}")


def test_an_array_of_slurm_leaves_the_receipt_of_one_process(cluster: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = freeplay.campaign("run", **SWEEP, workers=1, out=tmp_path / "one").receipt.read_bytes()
    monkeypatch.setenv("FREEPLAY_EXECUTABLE", str(killing(tmp_path, "run", most=2)))
    found = freeplay.campaign("run", **SWEEP, engine="slurm", workers=2, cluster=cluster, out=tmp_path / "many")
    assert len(list(tmp_path.glob("killed-*"))) == 2, "two tasks were killed"
    assert found.receipt.read_bytes() == one and len(found.done) == 8


def test_an_interrupted_array_leaves_slurms_queue(cluster: str, tmp_path: Path) -> None:
    environment = {**os.environ, "FREEPLAY_EXECUTABLE": str(holding(tmp_path))}
    command = [*COMMAND, "--engine", "slurm", "--cluster", cluster, "--workers", "2", "--out", str(tmp_path / "c"), "--quiet"]
    process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True)
    wait_for_two(tmp_path, process)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=300)[1]
    assert process.returncode == 130 and said.startswith("freeplay: campaign interrupted: 2 of 8 tasks are done"), said
    wait_for_none(tmp_path)
    patience = time.monotonic() + 120.0
    while subprocess.run([str(program("squeue")), "-h"], capture_output=True, text=True, check=True).stdout:
        assert time.monotonic() < patience, "a task is still in the queue"
        time.sleep(0.1)
    (tmp_path / "hold").rmdir()
    assert subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, timeout=600).returncode == 0


def test_what_slurm_refuses_has_its_words(cluster: str, tmp_path: Path) -> None:
    with pytest.raises(freeplay.PeerMissing, match="partition"):
        freeplay.campaign("run", **SWEEP, engine="slurm", cluster="no-such-partition", out=tmp_path / "c")

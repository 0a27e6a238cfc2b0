"""What carries out the tasks of a campaign. Each engine is somebody else's; here is only how its queue is filled.

An engine gets the tasks that are not done and comes back when it has ended all of them, however they ended: what is done shows in the
campaign's folder.
"""

from __future__ import annotations

import contextlib
import logging
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import _campaign_task
from .errors import BadUsage, NotInstalled, PeerMissing


@dataclass(frozen=True)
class Work:
    """What an engine is to do."""

    #: The campaign's folder, which all workers see under this path.
    folder: Path
    #: Numbers of the tasks.
    tasks: Sequence[int]
    #: Tasks at a time.
    workers: int
    #: How often a task may be tried.
    attempts: int
    #: The address of a cluster that is there; None: one is started here.
    cluster: str | None

    def command(self, task: int) -> list[str]:
        """The command line of a task: its file alone, without the package and without what else is installed, starts in half the time."""
        return [sys.executable, "-I", "-S", _campaign_task.__file__, str(self.folder), str(task)]


def environment() -> dict[str, str]:
    """What a task needs of the environment: where this package is."""
    package = str(Path(__file__).resolve().parent.parent)
    known = os.environ.get("PYTHONPATH")
    return {"PYTHONPATH": package if not known else f"{package}{os.pathsep}{known}"}


def local(work: Work) -> None:
    """Processes on this machine, `workers` at a time."""
    env = {**os.environ, **environment()}
    at_work: set[subprocess.Popen[bytes]] = set()

    def one(task: int) -> None:
        process = subprocess.Popen(work.command(task), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=env)
        at_work.add(process)
        process.wait()
        at_work.discard(process)

    with ThreadPoolExecutor(work.workers) as pool:
        try:
            list(pool.map(one, work.tasks))
        except BaseException:
            # Ctrl-C: what waits is not begun, and what is at work ends with its task.
            pool.shutdown(wait=False, cancel_futures=True)
            for process in list(at_work):
                process.terminate()
            raise


def hyperqueue(work: Work) -> None:
    """HyperQueue: a job with a task each, on a server of one's own or on one with a worker that is started here."""
    # The campaign shows progress for every engine alike.
    os.environ.setdefault("TQDM_DISABLE", "1")
    try:
        from hyperqueue import Client, Job
        from hyperqueue.cluster import LocalCluster, WorkerConfig
    except ImportError:
        raise NotInstalled("engine hyperqueue needs the package hyperqueue: pip install hyperqueue") from None
    job = Job(max_fails=None, default_workdir=work.folder, default_env=environment(), name="freeplay")
    for task in work.tasks:
        job.program(work.command(task), name=str(task), stdout=None, stderr=None, crash_limit=work.attempts)
    with contextlib.ExitStack() as stack:
        if work.cluster is None:
            server = stack.enter_context(tempfile.TemporaryDirectory(prefix="freeplay-hq-"))
            with _without_stdout():
                cluster = LocalCluster(server, WorkerConfig(cores=work.workers))
            stack.enter_context(cluster)
            client = cluster.client()
        else:
            client = Client(work.cluster)
        submitted = client.submit(job)
        # A task of a lost worker is run again by the server. One that failed by itself is not: the campaign hands it over anew.
        try:
            client.wait_for_jobs([submitted], raise_on_error=False)
        except Exception as error:
            # HyperQueue raises nothing more special where its server ends, by itself or by Ctrl-C.
            raise PeerMissing(f"HyperQueue's server is gone ({error}): what is done stays, call it again to go on") from None


def dask(work: Work) -> None:
    """Dask distributed: a future a task, with Dask's retries, on a scheduler of one's own or on a local cluster."""
    try:
        from distributed import Client, LocalCluster, wait
    except ImportError:
        raise NotInstalled("engine dask needs the package distributed: pip install distributed") from None
    # A task that fails is tried again, and told by the campaign if it fails to the end.
    logging.getLogger("distributed.worker").setLevel(logging.ERROR)
    env = environment()
    with contextlib.ExitStack() as stack:
        if work.cluster is None:
            # Threads: a task is a process anyway, and a script needs no guard against being imported by its own workers.
            address: Any = stack.enter_context(
                LocalCluster(n_workers=work.workers, threads_per_worker=1, processes=False, dashboard_address=None)
            )
        else:
            address = work.cluster
        client = stack.enter_context(Client(address))
        futures = [
            client.submit(_in_dask, work.command(task), env, key=f"freeplay-{work.folder.name}-{task}", pure=False, retries=work.attempts)
            for task in work.tasks
        ]
        wait(futures)


def _in_dask(command: list[str], env: dict[str, str]) -> int:
    """Runs on a worker; raises for Dask to try again."""
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env={**os.environ, **env})
    done.check_returncode()
    return 0


def slurm(work: Work) -> None:
    """Slurm: a job array, which is put into the queue again where a node fails; `cluster` names the partition."""
    if shutil.which("sbatch") is None:
        raise NotInstalled("engine slurm needs Slurm's sbatch on the path")
    script = work.folder / "slurm.sh"
    exports = "".join(f"export {name}={shlex.quote(value)}\n" for name, value in environment().items())
    words = shlex.join(work.command(0)[:-1])
    script.write_text(f'#!/bin/sh\n{exports}exec {words} "$SLURM_ARRAY_TASK_ID"\n', encoding="utf-8")
    script.chmod(0o700)
    partition = [f"--partition={work.cluster}"] if work.cluster else []
    array = ",".join(_spans(work.tasks))
    command = [
        "sbatch", "--wait", "--quiet", "--requeue", "--cpus-per-task=1", "--job-name=freeplay", "--output=/dev/null",
        f"--chdir={work.folder}", f"--array={array}%{work.workers}", *partition, str(script),
    ]  # fmt: skip
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    # `--wait` gives the greatest exit code of the tasks; only what sbatch itself says is an error of the engine.
    if done.returncode and done.stderr.strip().startswith("sbatch: error"):
        raise PeerMissing(f"Slurm took no job: {done.stderr.strip()}")


def _spans(numbers: Sequence[int]) -> list[str]:
    """`numbers` as spans, such as 0-3 and 7."""
    spans: list[list[int]] = []
    for number in sorted(numbers):
        if spans and spans[-1][1] == number - 1:
            spans[-1][1] = number
        else:
            spans.append([number, number])
    return [str(first) if first == last else f"{first}-{last}" for first, last in spans]


@contextlib.contextmanager
def _without_stdout() -> Iterator[None]:
    """A library's standard output goes nowhere: the output is the campaign's result."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


ENGINES = {"local": local, "hyperqueue": hyperqueue, "dask": dask, "slurm": slurm}


def start(engine: str, work: Work) -> None:
    """Has `engine` do the work.

    Raises
    ------
    BadUsage
        There is no such engine.
    NotInstalled
        The package or program of the engine is missing.
    """
    if engine not in ENGINES:
        raise BadUsage(f"no engine is called {engine!r}: there are {', '.join(ENGINES)}")
    ENGINES[engine](work)

"""The engines that carry out the tasks of a campaign. Each but `local` is somebody else's; this module fills its queue.

An engine gets the tasks that are not done and returns when all of them have ended, however they ended: the campaign's folder shows which are
done. An interrupted engine (`KeyboardInterrupt`) leaves the file `stop` in that folder, so that tasks end wherever they run.
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
import uuid
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import _campaign_task
from .errors import BadUsage, NotInstalled, PeerMissing


@dataclass(frozen=True)
class Work:
    """The work of an engine."""

    #: The campaign's folder, which all workers see under this path.
    folder: Path
    #: Numbers of the tasks.
    tasks: Sequence[int]
    #: Tasks at a time.
    workers: int
    #: How often a task may be tried.
    attempts: int
    #: The address of a running cluster; None: the engine starts one of its own.
    cluster: str | None

    def command(self, task: int) -> list[str]:
        """The command line of a task. Its file alone, without the package and without site-packages, starts in half the time."""
        return [sys.executable, "-I", "-S", _campaign_task.__file__, str(self.folder), str(task)]

    @contextlib.contextmanager
    def ends_with_interrupt(self) -> Iterator[None]:
        """Has the tasks end, wherever they run, when the body is interrupted."""
        try:
            yield
        except KeyboardInterrupt:
            (self.folder / _campaign_task.STOP).touch()
            raise


def environment() -> dict[str, str]:
    """The variables that a task needs: the path of this package."""
    package = str(Path(__file__).resolve().parent.parent)
    known = os.environ.get("PYTHONPATH")
    return {"PYTHONPATH": package if not known else f"{package}{os.pathsep}{known}"}


def local(work: Work) -> None:
    """Processes on this machine, `workers` at a time."""
    env = {**os.environ, **environment()}

    def one(task: int) -> None:
        subprocess.run(work.command(task), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=env)

    with ThreadPoolExecutor(work.workers) as pool, work.ends_with_interrupt():
        try:
            list(pool.map(one, work.tasks))
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def hyperqueue(work: Work) -> None:
    """HyperQueue: a job with a task each, on a server of one's own or on one with a worker that is started here."""
    # The campaign shows the progress of every engine alike.
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
            client = _connected("HyperQueue's server", work.cluster, lambda: Client(work.cluster))
        submitted = client.submit(job)
        stack.enter_context(work.ends_with_interrupt())
        # The server runs a task of a lost worker again. The campaign hands one over anew that failed by itself.
        try:
            client.wait_for_jobs([submitted], raise_on_error=False)
        except Exception as error:
            # HyperQueue raises nothing more special where its server ends.
            raise PeerMissing(f"HyperQueue's server is gone ({_brief(error)}). Finished tasks stay; the same call goes on with the others") from None


# Dask samples its threads, its event loop and its memory up to a hundred times a second, and serves pages about that. A cluster that only starts
# processes needs none of it.
QUIET_DASK = {
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.monitor-interval": "10s",
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.tick.cycle": "10s",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}


def dask(work: Work) -> None:
    """Dask distributed: a future a task, with Dask's retries, on a given scheduler or on a local cluster."""
    try:
        import dask as dask_package
        from distributed import Client, LocalCluster, wait
    except ImportError:
        raise NotInstalled("engine dask needs the package distributed: pip install distributed") from None
    # Keys of a scheduler that others use, too.
    env, name = environment(), _own_name()
    with contextlib.ExitStack() as stack:
        # Dask tries a failed task again. The campaign tells of one that fails to the end.
        for part in ("worker", "client"):
            stack.enter_context(_silent(logging.getLogger(f"distributed.{part}")))
        address: Any = work.cluster
        if work.cluster is None:
            stack.enter_context(dask_package.config.set(QUIET_DASK))
            # Threads: a task is a process anyway, and a script needs no guard against being imported by its own workers.
            cluster = LocalCluster(n_workers=work.workers, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0")
            address = stack.enter_context(cluster)
        client = stack.enter_context(_connected("Dask's scheduler", address, lambda: Client(address)))
        futures = [
            client.submit(_in_dask, work.command(task), env, key=f"{name}-{task}", pure=False, retries=work.attempts)
            for task in work.tasks
        ]
        stack.enter_context(work.ends_with_interrupt())
        try:
            wait(futures)
        except Exception:
            raise PeerMissing("Dask's scheduler is gone, or cancelled the tasks. Finished tasks stay; the same call goes on with the others") from None


def _in_dask(command: list[str], env: dict[str, str]) -> int:
    """Runs a task on a worker; raises where it fails, so that Dask tries it again."""
    # HyperQueue and Slurm end a lost worker's tasks; Dask would leave them at work beside their second try.
    command = [*command, "--with-parent"]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env={**os.environ, **env})
    done.check_returncode()
    return 0


def slurm(work: Work) -> None:
    """Slurm: a job array, which Slurm puts into the queue again where a node fails; `cluster` names the partition."""
    if shutil.which("sbatch") is None:
        raise NotInstalled("engine slurm needs Slurm's sbatch on the path")
    script = work.folder / "slurm.sh"
    exports = "".join(f"export {name}={shlex.quote(value)}\n" for name, value in environment().items())
    words = shlex.join(work.command(0)[:-1])
    script.write_text(f'#!/bin/sh\n{exports}exec {words} "$SLURM_ARRAY_TASK_ID"\n', encoding="utf-8")
    script.chmod(0o700)
    partition = [f"--partition={work.cluster}"] if work.cluster else []
    array = ",".join(_spans(work.tasks))
    # A name of its own, by which the job can be cancelled: `sbatch --wait` tells the job's number only at the end.
    name = _own_name()
    command = [
        "sbatch", "--wait", "--quiet", "--requeue", "--cpus-per-task=1", f"--job-name={name}", "--output=/dev/null",
        f"--chdir={work.folder}", f"--array={array}%{work.workers}", *partition, str(script),
    ]  # fmt: skip
    try:
        with work.ends_with_interrupt():
            done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    except KeyboardInterrupt:
        subprocess.run(["scancel", f"--name={name}"], stdin=subprocess.DEVNULL, capture_output=True, check=False)
        raise
    # `--wait` gives the greatest exit code of the tasks; only what sbatch itself says is an error of the engine.
    if done.returncode and done.stderr.strip().startswith("sbatch: error"):
        raise PeerMissing(f"Slurm took no job: {done.stderr.strip()}")


def _connected(what: str, address: object, connect: Callable[[], Any]) -> Any:
    """The connection that `connect` makes.

    Raises
    ------
    PeerMissing
        Nobody answers at `address`.
    """
    try:
        return connect()
    except Exception as error:
        raise PeerMissing(f"{what} does not answer at {address}: {_brief(error)}") from None


def _brief(error: Exception) -> str:
    """What an error says in one line, without the back trace that HyperQueue puts into it."""
    lines = str(error).partition("Stack backtrace")[0].splitlines()
    return " ".join(line.strip() for line in lines if line.strip()) or type(error).__name__


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
    """Discards a library's standard output, which belongs to the campaign's result."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def _own_name() -> str:
    """A name that no other campaign has."""
    return f"freeplay-{uuid.uuid4().hex[:12]}"


@contextlib.contextmanager
def _silent(logger: logging.Logger) -> Iterator[None]:
    """Logs nothing of `logger`."""
    before = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(before)


ENGINES = {"local": local, "hyperqueue": hyperqueue, "dask": dask, "slurm": slurm}


def start(engine: str, work: Work) -> None:
    """Has `engine` do the work.

    Raises
    ------
    BadUsage
        There is no such engine.
    NotInstalled
        The package or program of the engine is missing.
    PeerMissing
        The cluster does not answer, or is gone.
    """
    if engine not in ENGINES:
        raise BadUsage(f"unknown engine {engine!r}: there are {', '.join(ENGINES)}")
    ENGINES[engine](work)

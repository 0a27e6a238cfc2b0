"""The engines that run the tasks of a campaign. `local` is part of this module; for the others this module fills the queue of another program.

An engine receives the unfinished tasks and returns when all of them have ended, successfully or not: the campaign's folder shows the finished
ones. An interrupted engine (`KeyboardInterrupt`) creates the file `stop` in that folder, so that the tasks end on all machines.
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
    """The tasks for an engine, and its settings."""

    #: Folder of the campaign, which all workers see under this path.
    folder: Path
    #: Numbers of the tasks.
    tasks: Sequence[int]
    #: Number of tasks at a time.
    workers: int
    #: Number of attempts for each task.
    attempts: int
    #: Address of a running cluster. None: the engine starts one.
    cluster: str | None

    def command(self, task: int) -> list[str]:
        """The command line of a task. It starts the file alone, without the package and site-packages, which halves the start time."""
        return [sys.executable, "-I", "-S", _campaign_task.__file__, str(self.folder), str(task)]

    @contextlib.contextmanager
    def ends_with_interrupt(self) -> Iterator[None]:
        """Context manager: if its body is interrupted, the tasks end on all machines."""
        try:
            yield
        except KeyboardInterrupt:
            (self.folder / _campaign_task.STOP).touch()
            raise


def environment() -> dict[str, str]:
    """The environment variables for a task: the path of this package."""
    package = str(Path(__file__).resolve().parent.parent)
    known = os.environ.get("PYTHONPATH")
    return {"PYTHONPATH": package if not known else f"{package}{os.pathsep}{known}"}


def local(work: Work) -> None:
    """Runs the tasks as processes on this machine."""
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
    """Runs the tasks with HyperQueue, as one job, on the given server or on a new one with one worker on this machine."""
    # The campaign itself shows the progress.
    os.environ.setdefault("TQDM_DISABLE", "1")
    try:
        from hyperqueue import Client, Job
        from hyperqueue.cluster import LocalCluster, WorkerConfig
    except ImportError:
        raise NotInstalled("the engine hyperqueue needs a package: pip install hyperqueue") from None
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
        # The server repeats the tasks of lost workers. The campaign repeats tasks that failed.
        try:
            client.wait_for_jobs([submitted], raise_on_error=False)
        except Exception as error:
            # HyperQueue has no more specific exception for the end of its server.
            raise PeerMissing(f"HyperQueue's server is gone ({_brief(error)}). Finished tasks stay; the same call continues with the others") from None


# Dask samples its threads, its event loop and its memory up to a hundred times a second, and serves pages with the results. A cluster that only
# starts processes does not need them.
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
    """Runs the tasks with Dask distributed, each as a future with Dask's retries, on the given scheduler or on a local cluster."""
    try:
        import dask as dask_package
        from distributed import Client, LocalCluster, wait
    except ImportError:
        raise NotInstalled("the engine dask needs a package: pip install distributed") from None
    # The keys are unique, because other clients may use the same scheduler.
    env, name = environment(), _own_name()
    with contextlib.ExitStack() as stack:
        # Dask repeats a failed task. The campaign reports a task that fails in all attempts.
        for part in ("worker", "client"):
            stack.enter_context(_silent(logging.getLogger(f"distributed.{part}")))
        address: Any = work.cluster
        if work.cluster is None:
            stack.enter_context(dask_package.config.set(QUIET_DASK))
            # Workers are threads: each task is a process anyway, and a script needs no guard against an import by its own workers.
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
            raise PeerMissing("Dask's scheduler is gone, or it cancelled the tasks. Finished tasks stay; the same call continues with the others") from None


def _in_dask(command: list[str], env: dict[str, str]) -> int:
    """Runs a task on a worker. Raises if the task fails, so that Dask repeats it."""
    # HyperQueue and Slurm end the tasks of a lost worker. With Dask they would continue beside their second attempt.
    command = [*command, "--with-parent"]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env={**os.environ, **env})
    done.check_returncode()
    return 0


def slurm(work: Work) -> None:
    """Runs the tasks with Slurm, as a job array that Slurm requeues if a node fails. `cluster` names the partition."""
    if shutil.which("sbatch") is None:
        raise NotInstalled("the engine slurm needs Slurm's sbatch on the PATH")
    script = work.folder / "slurm.sh"
    exports = "".join(f"export {name}={shlex.quote(value)}\n" for name, value in environment().items())
    words = shlex.join(work.command(0)[:-1])
    script.write_text(f'#!/bin/sh\n{exports}exec {words} "$SLURM_ARRAY_TASK_ID"\n', encoding="utf-8")
    script.chmod(0o700)
    partition = [f"--partition={work.cluster}"] if work.cluster else []
    array = ",".join(_spans(work.tasks))
    # The unique name lets scancel find the job: `sbatch --wait` prints the job's number only at the end.
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
    # With `--wait` the exit code is the greatest one of the tasks. Only a message of sbatch itself is an error of the engine.
    if done.returncode and done.stderr.strip().startswith("sbatch: error"):
        raise PeerMissing(f"Slurm rejected the job: {done.stderr.strip()}")


def _connected(what: str, address: object, connect: Callable[[], Any]) -> Any:
    """Calls `connect` and returns the connection.

    Raises
    ------
    PeerMissing
        `connect` fails.
    """
    try:
        return connect()
    except Exception as error:
        raise PeerMissing(f"{what} does not answer at {address}: {_brief(error)}") from None


def _brief(error: Exception) -> str:
    """The message of an error in one line, without HyperQueue's stack trace."""
    lines = str(error).partition("Stack backtrace")[0].splitlines()
    return " ".join(line.strip() for line in lines if line.strip()) or type(error).__name__


def _spans(numbers: Sequence[int]) -> list[str]:
    """Ranges of consecutive `numbers` as text, such as 0-3 and 7."""
    spans: list[list[int]] = []
    for number in sorted(numbers):
        if spans and spans[-1][1] == number - 1:
            spans[-1][1] = number
        else:
            spans.append([number, number])
    return [str(first) if first == last else f"{first}-{last}" for first, last in spans]


@contextlib.contextmanager
def _without_stdout() -> Iterator[None]:
    """Context manager that discards standard output, which only the campaign's result may use."""
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
    """A unique name for a campaign."""
    return f"freeplay-{uuid.uuid4().hex[:12]}"


@contextlib.contextmanager
def _silent(logger: logging.Logger) -> Iterator[None]:
    """Context manager that silences `logger`."""
    before = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(before)


ENGINES = {"local": local, "hyperqueue": hyperqueue, "dask": dask, "slurm": slurm}


def start(engine: str, work: Work) -> None:
    """Runs the tasks of `work` with `engine`.

    Raises
    ------
    BadUsage
        The engine is unknown.
    NotInstalled
        The package or program of the engine is missing.
    PeerMissing
        The cluster does not answer, or it ended.
    """
    if engine not in ENGINES:
        raise BadUsage(f"unknown engine {engine!r}: choose one of {', '.join(ENGINES)}")
    ENGINES[engine](work)

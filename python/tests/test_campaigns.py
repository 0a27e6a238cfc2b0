"""The receipt of a campaign does not depend on the distribution of its tasks, nor on killed tasks."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import freeplay
from freeplay import _campaign_command, _command

#: Short runs of one arm from several seeds.
SWEEP: dict[str, Any] = {"sweep": {"--seed": range(8)}, "controller": "computed-torque", "set": "duration=0.05", "recording": "none"}


#: The same campaign on the command line.
WORDS = ["run", "--controller", "computed-torque", "--set", "duration=0.05", "--recording", "none", "--sweep=--seed=0,1,2,3,4,5,6,7"]
COMMAND = [sys.executable, "-m", "freeplay", "campaign", *WORDS]

#: A generator whose cases take a tenth of a second each.
GENERATOR = Path(__file__).resolve().parent.parent / "examples" / "pendulum_cases.py"


def killing(folder: Path, command: str, most: int) -> Path:
    """Writes an executable that kills the task which calls it with `command`, at most `most` tasks. It kills the first task before the command, and
    the others after the command, before the task moves the results. It creates the folders `killed-1` and so on in `folder`."""
    real, killer = _command.executable(), folder / "freeplay"
    lines = ["#!/bin/sh", f'[ "$1" = {command} ] || exec {real} "$@"']
    for number in range(1, most + 1):
        at_work = f'{real} "$@"; ' if number > 1 else ""
        lines.append(f"if mkdir {folder}/killed-{number} 2>/dev/null; then {at_work}kill -9 $PPID; exit 1; fi")
    killer.write_text("\n".join([*lines, f'exec {real} "$@"', ""]))
    killer.chmod(0o700)
    return killer


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The receipt of a campaign with one worker and no killed tasks."""
    out = tmp_path_factory.mktemp("campaign") / "one"
    return freeplay.campaign("run", **SWEEP, workers=1, out=out).receipt.read_bytes()


@pytest.mark.parametrize("engine", ["local", "hyperqueue", "dask"])
def test_killed_tasks_are_run_again_and_the_receipt_is_the_same(
    engine: str, undisturbed: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip({"local": "freeplay", "hyperqueue": "hyperqueue", "dask": "distributed"}[engine])
    monkeypatch.setenv("FREEPLAY_EXECUTABLE", str(killing(tmp_path, "run", most=2)))
    found = freeplay.campaign("run", **SWEEP, engine=engine, workers=2, out=tmp_path / "many")
    assert len(list(tmp_path.glob("killed-*"))) == 2, "two tasks were killed"
    assert found.receipt.read_bytes() == undisturbed
    assert len(found.results) == 8 and found.results["--seed"].nunique() == 8
    assert not list((tmp_path / "many/tasks").glob(".*")), "no incomplete folder is left"


def holding(folder: Path) -> Path:
    """Writes an executable that performs two runs, and holds the others while the folder `hold` exists. Each held run has a file `at-work-N`, which
    becomes `ended-N` when a signal ends the run."""
    held = folder / "freeplay"
    (folder / "hold").mkdir()
    lines = [
        "#!/bin/sh",
        f'[ "$1" = run ] && [ -d {folder}/hold ] || exec {_command.executable()} "$@"',
        f'for n in 1 2; do mkdir {folder}/passed-$n 2>/dev/null && exec {_command.executable()} "$@"; done',
        f"trap 'mv {folder}/at-work-$$ {folder}/ended-$$; exit 130' INT TERM",
        f"touch {folder}/at-work-$$",
        "while :; do sleep 0.1; done",
    ]
    held.write_text("\n".join([*lines, ""]))
    held.chmod(0o700)
    return held


def wait_for_two(folder: Path, campaign: subprocess.Popen[str]) -> None:
    """Waits until two tasks are finished and two are held."""
    while campaign.poll() is None and (len(list(folder.glob("at-work-*"))) < 2 or len(list((folder / "c/tasks").glob("0*"))) < 2):
        time.sleep(0.02)


def wait_for_none(folder: Path) -> None:
    """Waits until no task is held."""
    patience = time.monotonic() + 120.0
    while list(folder.glob("at-work-*")):
        assert time.monotonic() < patience, "a task still runs"
        time.sleep(0.05)


@pytest.mark.parametrize("engine", ["local", "hyperqueue", "dask"])
@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])
def test_an_interrupted_campaign_ends_its_tasks_and_goes_on_later(engine: str, ending: int, undisturbed: bytes, tmp_path: Path) -> None:
    pytest.importorskip({"local": "freeplay", "hyperqueue": "hyperqueue", "dask": "distributed"}[engine])
    command = [*COMMAND, "--engine", engine, "--workers", "2", "--out", str(tmp_path / "c"), "--quiet"]
    environment = {**os.environ, "FREEPLAY_EXECUTABLE": str(holding(tmp_path))}
    process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True)
    wait_for_two(tmp_path, process)
    process.send_signal(ending)
    said = process.communicate(timeout=300)[1]
    assert process.returncode == 130 and said.startswith("freeplay: campaign interrupted: 2 of 8 tasks are done"), said
    assert "Traceback" not in said and len(said.splitlines()) == 1, said
    assert len(list(tmp_path.glob("ended-*"))) == 2 and not list(tmp_path.glob("at-work-*")), "the held tasks ended, and no other task began"
    assert not list((tmp_path / "c/tasks").glob(".*")), "no incomplete folder is left"
    (tmp_path / "hold").rmdir()
    assert subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, timeout=600).returncode == 0
    assert (tmp_path / "c/receipt.json").read_bytes() == undisturbed


def test_shards_of_a_proof_leave_the_receipt_of_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    chosen: dict[str, Any] = {"cases": 10, "seed": 5, "generator": GENERATOR}
    one = freeplay.campaign("blind", **chosen, shards=1, out=tmp_path / "one")
    with monkeypatch.context() as killed:
        killed.setenv("FREEPLAY_EXECUTABLE", str(killing(tmp_path, "blind", most=1)))
        two = freeplay.campaign("blind", **chosen, shards=2, workers=2, out=tmp_path / "two")
    assert (tmp_path / "killed-1").is_dir() and one.receipt.read_bytes() == two.receipt.read_bytes()
    assert len(two.results) == len(one.proof.cases) == 10
    assert two.results["machine"].eq("pendulum").all() and (two.results["outcome"] == "right").sum() >= 5
    two.proof.verify()
    assert not (two.folder_of(0) / "result/sealed").exists(), "the sealed recordings are removed"


def test_a_campaign_goes_on_where_it_was(undisturbed: bytes, tmp_path: Path) -> None:
    found = freeplay.campaign("run", **SWEEP, out=tmp_path / "c")
    stamp = (found.folder_of(1) / "task.json").stat().st_mtime_ns
    for task in (0, 3):
        os.rename(found.folder_of(task), tmp_path / f"lost-{task}")
    assert len(freeplay.Campaign(tmp_path / "c").done) == 6
    again = freeplay.campaign("run", **SWEEP, out=tmp_path / "c")
    assert again.receipt.read_bytes() == undisturbed
    assert (again.folder_of(1) / "task.json").stat().st_mtime_ns == stamp, "finished tasks do not run again"
    with pytest.raises(freeplay.BadUsage, match="another campaign"):
        freeplay.campaign("run", **{**SWEEP, "sweep": {"--seed": range(9)}}, out=tmp_path / "c")


def test_two_merges_at_once_leave_the_same(tmp_path: Path) -> None:
    found = freeplay.campaign("run", **SWEEP, out=tmp_path / "c")
    before = found.receipt.read_bytes()
    threads = [threading.Thread(target=found.merge) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found.receipt.read_bytes() == before


def test_what_can_not_succeed_is_said_once_and_with_the_commands_words(tmp_path: Path) -> None:
    begun = time.monotonic()
    with pytest.raises(freeplay.BadUsage, match="unknown field `perid`") as raised:
        freeplay.campaign("run", sweep={"path.perid": [1, 2]}, out=tmp_path / "c", attempts=50)
    assert "2 of 2 tasks" in str(raised.value) and time.monotonic() - begun < 60.0
    with pytest.raises(freeplay.BadUsage, match="unknown engine"):
        freeplay.campaign("run", **SWEEP, engine="abacus", out=tmp_path / "d")
    with pytest.raises(freeplay.BadUsage, match="sweep"):
        freeplay.campaign("swap", out=tmp_path / "e")


def test_a_task_without_room_is_done_where_there_is_some(undisturbed: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The disk is full while the first task writes: its incomplete results do not count, and the campaign repeats the task."""
    full = tmp_path / "freeplay"
    full.write_text(
        f'#!/bin/sh\nif [ "$1" = run ] && mkdir {tmp_path}/first 2>/dev/null; then ulimit -f 1; fi\nexec {_command.executable()} "$@"\n'
    )
    full.chmod(0o700)
    monkeypatch.setenv("FREEPLAY_EXECUTABLE", str(full))
    found = freeplay.campaign("run", **SWEEP, workers=1, out=tmp_path / "c")
    assert (tmp_path / "first").is_dir() and found.receipt.read_bytes() == undisturbed


def test_the_command_line(undisturbed: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert _campaign_command.main([*WORDS, "--out", str(tmp_path / "c"), "--quiet"]) == 0
    assert (tmp_path / "c/receipt.json").read_bytes() == undisturbed
    assert "receipt" in capsys.readouterr().out


def test_a_sweep_cut_into_fewer_tasks_leaves_the_same_receipt_and_few_files(undisturbed: bytes, tmp_path: Path) -> None:
    found = freeplay.campaign("run", **SWEEP, shards=3, workers=2, keep=True, out=tmp_path / "c")
    assert found.receipt.read_bytes() == undisturbed
    assert found.done == [0, 1, 2] and list(found.results["--seed"]) == list(range(8))
    assert sorted(path.name for path in found.folder_of(0).iterdir()) == ["log.txt", "printed.json", "task.json"]


@contextlib.contextmanager
def cluster_of(engine: str, folder: Path, workers: int) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Starts a cluster. Yields its address and its processes, with the server first."""
    started: list[subprocess.Popen[bytes]] = []

    def start(*words: str) -> None:
        started.append(subprocess.Popen([sys.executable, *words], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))

    if engine == "dask":
        with socket.create_server(("127.0.0.1", 0)) as free:
            address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        start("-m", "distributed.cli.dask_scheduler", "--port", address.rpartition(":")[2], "--no-dashboard")
        for _ in range(workers):
            start("-m", "distributed.cli.dask_worker", address, "--no-nanny", "--no-dashboard", "--nthreads", "1")
    else:
        address = str(folder / "server")
        (folder / "server").mkdir()
        script = "import sys, time; from hyperqueue.cluster import LocalCluster, WorkerConfig\n"
        script += "cluster = LocalCluster(sys.argv[1], WorkerConfig(cores=int(sys.argv[2]))); open('up', 'w').close(); time.sleep(600)"
        start("-c", script, address, str(workers))
        while not (folder / "up").exists() and started[0].poll() is None:
            time.sleep(0.05)
    try:
        yield address, started
    finally:
        for each in started:
            each.kill()
            each.wait()


@pytest.mark.parametrize("engine", ["hyperqueue", "dask"])
@pytest.mark.parametrize("ending", ["the server is gone", "interrupted"])
def test_a_cluster_of_others_keeps_no_task_of_a_campaign_that_ended(engine: str, ending: str, undisturbed: bytes, tmp_path: Path) -> None:
    pytest.importorskip({"hyperqueue": "hyperqueue", "dask": "distributed"}[engine])
    environment = {**os.environ, "FREEPLAY_EXECUTABLE": str(holding(tmp_path))}
    with cluster_of(engine, tmp_path, 2) as (address, started):
        command = [*COMMAND, "--engine", engine, "--cluster", address, "--workers", "2", "--out", str(tmp_path / "c"), "--quiet"]
        process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True)
        wait_for_two(tmp_path, process)
        if ending == "interrupted":
            process.send_signal(signal.SIGINT)
        else:
            started[0].kill()
        said = process.communicate(timeout=300)[1]
        words = "campaign interrupted: 2 of 8 tasks are done" if ending == "interrupted" else "is gone"
        assert words in said and "Traceback" not in said and len(said.splitlines()) == 1, said
        assert process.returncode == (130 if ending == "interrupted" else 5)
        if ending == "interrupted":
            wait_for_none(tmp_path)
    # The tasks of a lost cluster end with their workers.
    wait_for_none(tmp_path)
    (tmp_path / "hold").rmdir()
    assert subprocess.run([*COMMAND, "--out", str(tmp_path / "c")], env=environment, stdout=subprocess.DEVNULL, timeout=600).returncode == 0
    assert (tmp_path / "c/receipt.json").read_bytes() == undisturbed


def test_a_cluster_that_does_not_answer_is_said_in_a_line(tmp_path: Path) -> None:
    pytest.importorskip("hyperqueue")
    with pytest.raises(freeplay.PeerMissing, match="does not answer at /nowhere: .*not a directory") as raised:
        freeplay.campaign("run", **SWEEP, engine="hyperqueue", cluster="/nowhere", out=tmp_path / "c")
    assert len(str(raised.value).splitlines()) == 1


def test_a_worker_that_is_gone_for_good_leaves_its_tasks_to_the_others(undisturbed: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Dask has two worker processes. The one with the first task is killed together with the task, and does not start again."""
    pytest.importorskip("distributed")
    gone = tmp_path / "freeplay"
    end = f"if mkdir {tmp_path}/gone 2>/dev/null; then read -r _ _ _ worker _ < /proc/$PPID/stat; kill -9 $worker $PPID; exit 1; fi"
    gone.write_text(f'#!/bin/sh\n[ "$1" = run ] || exec {_command.executable()} "$@"\n{end}\nexec {_command.executable()} "$@"\n')
    gone.chmod(0o700)
    monkeypatch.setenv("FREEPLAY_EXECUTABLE", str(gone))
    with cluster_of("dask", tmp_path, 2) as (address, started):
        found = freeplay.campaign("run", **SWEEP, engine="dask", cluster=address, workers=2, out=tmp_path / "c")
        assert (tmp_path / "gone").is_dir() and sum(each.poll() is not None for each in started) == 1, "one worker is gone"
        assert found.receipt.read_bytes() == undisturbed

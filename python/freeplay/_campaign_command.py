"""The command line of `freeplay campaign`."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence

from . import _campaign_engines
from .campaigns import campaign
from .errors import BadUsage


def main(words: Sequence[str]) -> int:
    """Runs `freeplay campaign` with the arguments `words` and returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="freeplay campaign",
        description="Distributes a command over cores and machines, and merges the results into one receipt. The same call continues where a campaign stopped.",
        epilog="freeplay campaign blind --cases 2000 --seed 7 --shards 100 --engine hyperqueue --out proved\n"
        "freeplay campaign run s.toml --sweep path.period=6,12 --sweep=--seed=1,2,3 --out swept",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("command", help="command to distribute, followed by its arguments: blind, or, with --sweep, run, faults, swap, cells, reference-runs and others")
    parser.add_argument("--out", required=True, metavar="DIR", help="folder for the results, which every worker sees under this path")
    parser.add_argument("--shards", type=_whole, metavar="N", help="number of tasks; four for each worker (blind) or one for each combination (sweep) without it")
    parser.add_argument("--sweep", action="append", default=[], metavar="KEY=V,…", help="values of a key of the scenario, or of an option (--sweep=--seed=1,2,3)")
    parser.add_argument("--engine", default="local", choices=list(_campaign_engines.ENGINES), help="engine that runs the tasks")
    parser.add_argument("--workers", type=_whole, metavar="N", help="tasks at a time; one for each core without it")
    parser.add_argument("--cluster", metavar="ADDRESS", help="a running cluster: HyperQueue's server folder, Dask's scheduler, Slurm's partition")
    parser.add_argument("--attempts", type=_whole, default=4, metavar="N", help="attempts for each task; 4 without it")
    parser.add_argument("--keep", action="store_true", help="keep the sealed recordings of blind")
    parser.add_argument("-q", "--quiet", action="store_true", help="print no progress")
    given, rest = parser.parse_known_args(words)
    found = campaign(
        given.command, *rest, out=given.out, shards=given.shards, sweep=dict(_swept(each) for each in given.sweep), engine=given.engine,
        workers=given.workers, cluster=given.cluster, attempts=given.attempts, keep=given.keep, progress=not given.quiet,
    )  # fmt: skip
    print(f"{found!r}\nreceipt  {found.receipt}")
    return 0


def _whole(word: str) -> int:
    """Parses a whole number of 1 or more."""
    if not word.isascii() or not word.isdigit() or int(word) < 1:
        raise argparse.ArgumentTypeError(f"{word!r}: give a whole number of 1 or more")
    return int(word)


def _swept(word: str) -> tuple[str, list[object]]:
    """Parses KEY=V,V: returns the key and its values."""
    name, equals, values = word.rpartition("=") if word.startswith("--") else word.partition("=")
    if not equals or not name or not values:
        raise BadUsage(f"--sweep {word}: give a key and its values, such as path.period=6,12")
    return name, [_parsed(value) for value in values.split(",")]


def _parsed(word: str) -> object:
    """Parses `word` as JSON (a number, true, false). Returns other words unchanged."""
    try:
        return json.loads(word)
    except ValueError:
        return word

"""Blind test of the diagnosis on concealed effects."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd

from . import _html
from ._command import PathLike, Progress, call, options
from ._scratch import Portable, Scratch


def blind(
    cases: int = 40,
    *,
    seed: int | None = None,
    full: bool = False,
    jobs: int | None = None,
    patience: int | None = None,
    out: PathLike | None = None,
    force: bool = False,
    progress: Progress = None,
) -> Proof:
    """Tests the diagnosis on concealed effects: seals recordings, diagnoses each one once, reveals the true effects, and scores the answers.

    Parameters
    ----------
    cases : int
        Number of cases.
    seed : int, optional
        Seed of the set. Default: a seed from the operating system, drawn after the freeze of the program.
    full : bool
        True: use the full set of 1,688 cases; `cases` has no effect.
    jobs : int, optional
        Number of processes that run at a time. Default: one for each core.
    patience : int, optional
        Time limit of a diagnosis, s. A case that exceeds the limit counts as answered wrongly.
    out : path, optional
        Folder for the sealed recordings, the receipt and the report. Default: a temporary folder, which is removed together with the returned
        object.
    force : bool
        True: replace results of an earlier command in `out`.
    progress : callable or bool, optional
        Function that receives one line for each stage. True: print the lines on standard error.

    Returns
    -------
    Proof
    """
    scratch = Scratch()
    folder = scratch.path / "blind" if out is None else Path(out)
    chosen = options(
        cases=None if full else cases, full=full, seed=seed, jobs=jobs, patience=patience, out=folder, force=force, format="json"
    )
    call(["blind", *chosen], progress=progress)
    return Proof(folder, scratch)


class Proof(Portable):
    """Results of a blind test.

    Attributes
    ----------
    folder : Path
        Folder with the receipt, the report and the sealed recordings.
    receipt : Path
        Path of `receipt.json`, which contains the hashes of recordings, answers and true effects.
    score : dict
        The score of the answers.
    """

    def __init__(self, folder: PathLike, scratch: Scratch | None = None) -> None:
        self.folder = Path(folder)
        self.receipt = self.folder / "receipt.json"
        self._receipt: dict[str, Any] = json.loads(self.receipt.read_text(encoding="utf-8"))
        self.score: dict[str, Any] = self._receipt["score"]
        self._scratch = scratch

    @property
    def goals(self) -> pd.DataFrame:
        """The goals and the values that were reached.

        Returns
        -------
        DataFrame
            quantity, goal, reached, interval (95 %), unit, of (number of cases), met.
        """
        frame = pd.DataFrame(self.score["goals"])
        frame["interval"] = [tuple(pair) for pair in frame.pop("ci95")]
        return frame[["quantity", "goal", "reached", "interval", "unit", "of", "met"]]

    @property
    def cases(self) -> pd.DataFrame:
        """The cases.

        Returns
        -------
        DataFrame, indexed by the case's name
            machine; concealed, the true effects, each as "kind of joint"; verdict; answered, the effects in the answer; outcome.
        """
        rows = {}
        for name, record in self._receipt["cases"].items():
            truth, answer = record["truth"], record["answer"]
            rows[name] = {
                "machine": truth.get("machine"),
                "concealed": _effects(truth.get("effects", [])),
                "verdict": answer.get("verdict"),
                "answered": _effects(answer.get("effects", [])),
                "outcome": record["outcome"],
            }
        frame = pd.DataFrame.from_dict(rows, orient="index")
        frame.index.name = "case"
        return frame

    def verify(self) -> None:
        """Recomputes every hash in the receipt.

        Raises
        ------
        FreeplayError
            A hash does not match. The message names it.
        """
        call(["blind", "--verify", self.receipt])

    def report(self) -> Path:
        """Path of the report, one HTML file."""
        return self.folder / "report.html"

    def __repr__(self) -> str:
        return f"<Proof of {len(self._receipt['cases'])} cases>"

    def _repr_html_(self) -> str:
        return _html.page("Concealed effects", f"{len(self._receipt['cases'])} cases", [_html.table(self.goals)])


def _effects(effects: list[dict[str, Any]]) -> str:
    named = [f"{each['kind']} of {each['joint']}" if each.get("joint") else str(each["kind"]) for each in effects]
    return ", ".join(named) or "nothing"

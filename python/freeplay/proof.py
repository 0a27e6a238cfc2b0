"""The proof of the diagnosis on concealed effects."""

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
    """Proves the diagnosis: makes recordings with concealed effects, seals the truth, diagnoses each once, opens and scores.

    Parameters
    ----------
    cases : int
        Number of cases.
    seed : int, optional
        Seed of the set. Without it the operating system draws one, after the program is frozen.
    full : bool
        The full set of 1,688 cases instead.
    jobs : int, optional
        Processes at work at a time; one a core without it.
    patience : int, optional
        Longest time of a diagnosis, s.
    out : path, optional
        Folder for sealed recordings, receipt and report. Without it they live as long as the result.
    force : bool
        Whether an earlier set in `out` is replaced.
    progress : callable or bool, optional
        Gets a line for each stage; True prints them on standard error.

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
    """A set of concealed effects, diagnosed and scored.

    Attributes
    ----------
    folder : Path
        The receipt, the report, and the sealed recordings.
    receipt : Path
        `receipt.json`, which binds recordings, answers and truths.
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
            quantity, goal, reached and interval (95 %) in unit, of (number of cases), met.
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
            machine; concealed and answered, the effects as "kind of joint"; verdict of the diagnosis; outcome.
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
        """Computes every hash of the receipt anew.

        Raises
        ------
        FreeplayError
            A hash does not match; the message names it.
        """
        call(["blind", "--verify", self.receipt])

    def report(self) -> Path:
        """The report with its tables, one HTML file."""
        return self.folder / "report.html"

    def __repr__(self) -> str:
        return f"<Proof of {len(self._receipt['cases'])} cases>"

    def _repr_html_(self) -> str:
        return _html.page("Concealed effects", f"{len(self._receipt['cases'])} cases", [_html.table(self.goals)])


def _effects(effects: list[dict[str, Any]]) -> str:
    named = [f"{each['kind']} of {each['joint']}" if each.get("joint") else str(each["kind"]) for each in effects]
    return ", ".join(named) or "nothing"

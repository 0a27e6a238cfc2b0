"""Models of arms."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any, Union

import pandas as pd

from . import _html
from ._command import PathLike, call, options
from ._scratch import Portable, Scratch


class Arm(Portable):
    """A model of an arm: a chain of joints, and effects beyond the rigid chain, such as play or elasticity.

    `Arm.read` and `Diagnosis.model` return one.

    Attributes
    ----------
    path : Path or "paper"
        The model file.
    tip : str or None
        Link of the model at the end of the arm, as passed to `Arm.read`.
    name : str
        Name of the arm.
    notes : list of str
        Notes on the file: unused elements, and the selected chain of the robot.
    """

    def __init__(self, path: Path | str, tip: str | None, described: dict[str, Any], scratch: Scratch | None = None):
        self.path = path
        self.tip = tip
        self.name: str = described["name"]
        self.notes: list[str] = described.get("notes", [])
        self._described = described
        self._scratch = scratch

    @classmethod
    def read(cls, path: PathLike, tip: str | None = None) -> Arm:
        """Reads a model file.

        Parameters
        ----------
        path : path
            An arm file (URDF, MJCF or TOML), or "paper", the arm of Erkaya (2018).
        tip : str, optional
            Link of the model at the end of the arm. Default: `tool0`, or the end of the longest chain without its fingers.

        Returns
        -------
        Arm

        Raises
        ------
        BadInput
            The file can't be read. The message contains the line, the value and the remedy.
        """
        return cls._read("paper" if str(path) == "paper" else Path(path).absolute(), tip)

    @classmethod
    def _read(cls, path: Path | str, tip: str | None, scratch: Scratch | None = None) -> Arm:
        described = call(["arm", path, *options(tip=tip, format="json")]).json()
        return cls(path, tip, described, scratch)

    @property
    def joint_names(self) -> list[str]:
        """Names of the n joints, from base to tool."""
        return [joint["name"] for joint in self._described["joints"]]

    @property
    def joints(self) -> pd.DataFrame:
        """The joints from base to tool.

        Returns
        -------
        DataFrame, n rows indexed by joint name
            kind ("revolute" or "prismatic"); limits: lower, upper (rad; m for a prismatic joint), velocity (rad/s, m/s), effort (N*m, N);
            nominal friction: viscous (N*m*s/rad), coulomb (N*m); mass (kg) of the link. NaN: no limit.
        """
        rows = [
            {"kind": joint["kind"], **joint["limits"], **joint["friction"], "mass": joint["mass"]}
            for joint in self._described["joints"]
        ]
        index = pd.Index(self.joint_names, name="joint")
        frame = pd.DataFrame(rows, index=index)
        numbers = [column for column in frame.columns if column != "kind"]
        return frame.astype({column: float for column in numbers})

    @property
    def effects(self) -> pd.DataFrame:
        """The effects beyond the rigid arm in the file.

        Returns
        -------
        DataFrame
            kind, joint (None for the whole arm).
        """
        return pd.DataFrame(self._described["effects"], columns=["kind", "joint"])

    def save(self, path: PathLike) -> Path:
        """Copies the model file to `path`.

        Raises
        ------
        ValueError
            The arm is "paper", which has no file.
        OSError
            The file can't be written.
        """
        if self.path == "paper":
            raise ValueError("the arm of the paper is built in and has no file")
        return Path(shutil.copyfile(self.path, path))

    def __repr__(self) -> str:
        count = len(self._described["effects"])
        beyond = f", {count} effect{'s' if count != 1 else ''}" if count else ""
        return f"<Arm {self.name}: {len(self.joint_names)} joints{beyond}>"

    def _repr_html_(self) -> str:
        notes = [f"effect: {each['kind']} of {each['joint'] or 'the arm'}" for each in self._described["effects"]]
        return _html.page(f"Arm {self.name}", "", [_html.table(self.joints), _html.bullets(notes + self.notes)])


#: An arm, or the path of a model file.
ArmLike = Union[Arm, PathLike]


def model_options(arm: ArmLike) -> list[str]:
    """The options `--model` and `--tip` for `arm`."""
    if isinstance(arm, Arm):
        return options(model=arm.path, tip=arm.tip)
    if not isinstance(arm, (str, os.PathLike)):
        raise TypeError(f"a model is an Arm or the path of its file, not {type(arm).__name__}; the model comes before the recording")
    return options(model=arm)

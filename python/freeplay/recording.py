"""Recordings of machines."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Union

import pandas as pd

from . import _html, _toml
from ._command import PathLike, call, options
from ._scratch import Portable, Scratch
from .arm import Arm, ArmLike
from .errors import BadInput

# Groups with one column for each joint, and their units in frames of this package.
GROUPS = {"q": "rad", "qd": "rad/s", "tau": "N*m", "q_ref": "rad", "q_link": "rad"}
# Columns of the tool's position and orientation.
TOOL, ORIENTATION = ["x", "y", "z"], ["qx", "qy", "qz", "qw"]
# Names of the time column, if `columns` does not name it.
TIMES = ["t", "time", "timestamp"]


class Recording(Portable):
    """A recording of a machine: time, joint positions, and other measured channels.

    `Recording.read` and `Recording.from_frame` return one.

    Attributes
    ----------
    path : Path
        File or folder of the recording.
    joints : list of str
        Names of the n joints, from base to tool. "q1", "q2", … if the file has no names.
    samples : int
        Number of samples N.
    duration : float
        Time from the first to the last sample, s. NaN for fewer than two samples.
    rate : float
        Median sample rate, Hz. NaN for fewer than two samples.
    tool_tracked : bool
        True if the recording has the tool's position.
    notes : list of str
        Notes on the file: corrected and omitted values.
    metadata : dict of str to str
        Metadata of the file.
    """

    def __init__(self, path: Path, scratch: Scratch | None = None) -> None:
        info = call(["record", "info", path, "--format", "json"]).json()
        self.path = path
        self.joints: list[str] = info["joint_names"] or [f"q{joint + 1}" for joint in range(info["joints"])]
        self.samples: int = info["samples"]
        self.duration = _number(info["duration_s"])
        self.rate = _number(info["rate_hz"])
        self.tool_tracked: bool = info["tool_tracked"]
        self.notes: list[str] = info["notes"]
        self.metadata: dict[str, str] = info["metadata"]
        self._info: dict[str, Any] = info
        self._scratch = scratch
        self._frame: pd.DataFrame | None = None

    @classmethod
    def read(
        cls,
        path: PathLike,
        *,
        mapping: PathLike | None = None,
        joints: Sequence[str] | None = None,
        topic: str | None = None,
        pose_topic: str | None = None,
    ) -> Recording:
        """Reads a recording.

        Parameters
        ----------
        path : path
            CSV, MCAP, Parquet, `.npz`, `.mat`, the log of a robot, a ROS 1 or ROS 2 bag (file or folder), or a LeRobot data set (its
            folder, or the file of one episode).
        mapping : path, optional
            Mapping file that defines the meaning of the columns.
        joints : sequence of str, optional
            The joints from base to tool, each by its name or by a part of the name that no other joint has. Default: all joints, in the
            order of the file.
        topic : str, optional
            Topic of the joint states in a bag. Default: the only one, or `/joint_states`.
        pose_topic : str, optional
            Topic of the tool's poses in a bag. Default: the only one.

        Returns
        -------
        Recording

        Raises
        ------
        BadInput
            The file has no time or no positions, or can't be read.
        """
        path = Path(path).absolute()
        wanted = joints if isinstance(joints, str) else ",".join(joints) if joints else None
        if mapping is None and wanted is None and topic is None and pose_topic is None:
            return cls(path)
        scratch = Scratch()
        out = scratch / "recording.mcap"
        chosen = options(mapping=mapping, joints=wanted, topic=topic, pose_topic=pose_topic, out=out)
        call(["record", "import", path, *chosen])
        return cls(out, scratch)

    @classmethod
    def from_frame(
        cls,
        frame: pd.DataFrame,
        *,
        joints: Sequence[str] | None = None,
        units: Mapping[str, str] | None = None,
        columns: Mapping[str, str | Sequence[str]] | None = None,
        scale: Mapping[str, float | Sequence[float]] | None = None,
    ) -> Recording:
        """Converts a frame to a recording.

        Parameters
        ----------
        frame : DataFrame, N rows
            Times: a column `t`, `time` or `timestamp`, or an index of times, in s or as pandas dates. Positions: `q1`…`qn`. Optional:
            `qd1`…, `tau1`…, `q_ref1`…, `q_link1`…, the tool's `x`, `y`, `z` and `qx`, `qy`, `qz`, `qw`. With `joints`, the columns `q3`,
            `q_elbow`, `elbow` and ("q", "elbow") all mean the position of the third joint if its name is elbow. NaN: not measured.
        joints : sequence of str, length n, optional
            Names of the joints from base to tool, as in the model of the arm. Each needs a position.
        units : mapping, optional
            Units that are not SI, by group: `{"q": "deg", "tau": "N*mm", "t": "ms", "tool": "mm"}`. Valid units: s, ms, us, ns; rad, deg, m,
            mm; rad/s, deg/s, rpm, m/s, mm/s; N*m, N*mm, N.
        columns : mapping, optional
            Column names by group: a name with `{}` in place of the joint's number, or a list of n names.
        scale : mapping, optional
            Factors by group, one number or n numbers: `{"tau": [38.2, 41.0]}` converts motor currents to torques.

        Returns
        -------
        Recording

        Raises
        ------
        BadInput
            The frame has no time or no position of a joint, a unit is unknown, or the times do not increase.
        ValueError
            `units`, `columns` or `scale` has a key that is not a group.

        Examples
        --------
        >>> recording = Recording.from_frame(frame, joints=["shoulder", "elbow"], units={"q": "deg"})  # doctest: +SKIP
        """
        joints = joints.split(",") if isinstance(joints, str) else joints
        table = _with_time(_with_one_level(frame), dict(columns or {}))
        mapping = _mapping(table, joints, dict(units or {}), dict(columns or {}), dict(scale or {}))
        scratch = Scratch()
        numbers = table.select_dtypes("number").astype(float)
        numbers.to_parquet(scratch / "frame.parquet", index=False)
        (scratch / "mapping.toml").write_text(mapping, encoding="utf-8")
        out = scratch / "recording.mcap"
        call(["record", "import", scratch / "frame.parquet", *options(mapping=scratch / "mapping.toml", out=out)])
        (scratch / "frame.parquet").unlink()
        return cls(out, scratch)

    def to_frame(self) -> pd.DataFrame:
        """Converts the recording to a frame with all its columns.

        Returns
        -------
        DataFrame, N rows
            `t` (s), `q1`…`qn` (rad), and if recorded `qd1`… (rad/s), `tau1`… (N*m), `q_ref1`…, `q_link1`… (rad), `x`, `y`, `z` (m),
            `qx`…`qw`, then other columns. `attrs["joints"]` contains the names of the joints, `attrs["units"]` the units by column.
        """
        if self._frame is None:
            scratch = Scratch()
            call(["record", "export", self.path, *options(format="parquet", out=scratch / "frame.parquet")])
            frame = pd.read_parquet(scratch / "frame.parquet")
            frame.attrs["joints"] = list(self.joints)
            frame.attrs["units"] = {column["name"]: column["unit"] for column in self._info["columns"] if column["unit"]}
            self._frame = frame
        return self._frame.copy()

    def save(self, path: PathLike, *, force: bool = False) -> Path:
        """Writes the recording to `path`. The extension determines the format: `.mcap`, `.parquet` or `.csv`.

        Raises
        ------
        BadUsage
            The file exists and `force` is False, or the extension is unknown.
        """
        path = Path(path)
        form = path.suffix.lstrip(".").lower()
        call(["record", "export", self.path, *options(format=form, out=path, force=force)])
        return path

    def check(self, arm: ArmLike) -> pd.DataFrame:
        """Finds differences between recording and model in units, signs, order of joints, zeros, gravity and clocks.

        Returns
        -------
        DataFrame, one row for each difference
            kind, joint, value, unit, certainty ("sure" or "likely"), statement, remedy.
        """
        model = arm.path if isinstance(arm, Arm) else arm
        info = call(["record", "info", self.path, *options(model=model, format="json")]).json()
        return setup_frame(info.get("setup", []))

    def __len__(self) -> int:
        return self.samples

    def __repr__(self) -> str:
        return (
            f"<Recording {self.path.name}: {len(self.joints)} joints, {self.samples} samples, "
            f"{self.duration:.3g} s at {self.rate:.4g} Hz>"
        )

    def _repr_html_(self) -> str:
        named = [column for column in self._info["columns"] if column["unit"]]
        frame = pd.DataFrame(
            [{"column": c["name"], "unit": c["unit"], "least": c["min"], "greatest": c["max"]} for c in named]
        )
        words = f"{len(self.joints)} joints ({', '.join(self.joints)}), {self.samples} samples, {self.duration:.3f} s at {self.rate:.1f} Hz"
        return _html.page(f"Recording {self.path.name}", words, [_html.table(frame, limit=12), _html.bullets(self.notes)])


#: A recording, the path of one, or a frame.
RecordingLike = Union[Recording, PathLike, pd.DataFrame]


def recording_of(given: RecordingLike) -> Recording:
    """Converts `given` to a recording: reads a path, converts a frame."""
    if isinstance(given, Recording):
        return given
    if isinstance(given, pd.DataFrame):
        return Recording.from_frame(given)
    if isinstance(given, (str, os.PathLike)):
        return Recording.read(given)
    raise TypeError(f"a recording is a Recording, the path of one or a DataFrame, not {type(given).__name__}")


def setup_frame(findings: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Converts the field `setup` of a document to a frame."""
    names = ["kind", "joint", "value", "unit", "certainty", "statement", "remedy"]
    return pd.DataFrame([{name: finding.get(name) for name in names} for finding in findings], columns=names)


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def _with_one_level(frame: pd.DataFrame) -> pd.DataFrame:
    """`frame` with one level of column names: ("q", "elbow") becomes `q_elbow`."""
    if not isinstance(frame.columns, pd.MultiIndex):
        return frame
    return frame.set_axis(["_".join(str(level) for level in column if str(level)) for column in frame.columns], axis=1)


def _with_time(frame: pd.DataFrame, columns: Mapping[str, object]) -> pd.DataFrame:
    """`frame` with a column of times: dates and time spans in s since the first sample, other times unchanged."""
    named = columns.get("t")
    column = next((name for name in ([named] if named else TIMES) if name in frame.columns), None)
    index = frame.index
    if column is not None:
        times: pd.Series | pd.Index = frame[str(column)]
    elif named is None and (isinstance(index, (pd.DatetimeIndex, pd.TimedeltaIndex)) or index.name in TIMES or index.dtype.kind == "f"):
        times = index
    else:
        raise BadInput(
            f"the frame has no time: give a column t, an index of times, or columns={{'t': …}}; its columns are {_listed(frame.columns)}"
        )
    if pd.api.types.is_datetime64_any_dtype(times.dtype) or pd.api.types.is_timedelta64_dtype(times.dtype):
        since = pd.TimedeltaIndex(pd.Index(times) - times.iloc[0] if isinstance(times, pd.Series) else times - times[0])
        return frame.assign(**{str(column or "t"): since.total_seconds().to_numpy()})
    return frame if column is not None else frame.assign(t=index.to_numpy(dtype=float))


def _listed(names: Sequence[object] | pd.Index, limit: int = 12) -> str:
    """The first `limit` of `names`, separated by commas, and the number of the others."""
    shown = [str(name) for name in names[:limit]]
    return ", ".join(shown) + (f" and {len(names) - limit} more" if len(names) > limit else "")


def _mapping(
    frame: pd.DataFrame,
    joints: Sequence[str] | None,
    units: dict[str, str],
    columns: dict[str, str | Sequence[str]],
    scale: dict[str, float | Sequence[float]],
) -> str:
    """The text of the mapping file for `frame`."""
    names = [str(name) for name in frame.columns]
    lines = [f"joints = {_toml.value(list(joints))}"] if joints else []
    for group in ["t", *GROUPS, "tool", "orientation"]:
        found = columns.get(group) or _columns_of(group, names, list(joints or []))
        if group == "q":
            _check_positions(found, names, list(joints or []))
        if not found:
            continue
        lines += ["", f"[{group}]", f"columns = {_toml.value(found if isinstance(found, str) else list(found))}"]
        if group in units:
            lines.append(f"unit = {_toml.value(units[group])}")
        if group in scale:
            lines.append(f"scale = {_toml.value(scale[group])}")
    strange = (set(units) | set(columns) | set(scale)) - {"t", *GROUPS, "tool", "orientation"}
    if strange:
        raise ValueError(f"no group of columns is called {sorted(strange)}: there are t, {', '.join(GROUPS)}, tool and orientation")
    return "\n".join(lines) + "\n"


def _check_positions(found: str | Sequence[str] | None, names: list[str], joints: list[str]) -> None:
    """Checks that each joint has a position, and each position a joint.

    Raises
    ------
    BadInput
        A position or a joint is missing.
    """
    if not found:
        raise BadInput(f"the frame has no positions: give columns q1, q2, …, or columns={{'q': …}}; its columns are {_listed(names)}")
    if isinstance(found, str) or not joints:
        return
    without = [joint for joint, column in zip(joints, found) if not column]
    if without:
        tried = f"q{joints.index(without[0]) + 1}" if "q1" in names else " and ".join(_names_of("q", without[0]))
        raise BadInput(f"the frame has no position of joint {_listed(without)}: looked for {tried}; its columns are {_listed(names)}")
    more = f"q{len(joints) + 1}"
    if "q1" in found and more in names:
        raise BadInput(f"{len(joints)} names of joints ({_listed(joints)}), but the frame has {more}: give a name for each position, or drop the other columns")


def _names_of(group: str, joint: str) -> list[str]:
    """Common names of a joint's column in `group`, besides the numbered one."""
    return [f"{group}_{joint}", f"{joint}_{group}", *([joint] if group == "q" else [])]


def _columns_of(group: str, names: list[str], joints: list[str]) -> str | list[str] | None:
    """The columns of `group` with common names. None if `names` contains none of them."""
    whole = {"t": TIMES, "tool": TOOL, "orientation": ORIENTATION}.get(group)
    if whole is not None:
        found = [name for name in whole if name in names]
        return found[0] if group == "t" and found else (found if len(found) == len(whole) else None)
    if f"{group}1" in names or not joints:
        count = len(joints) or next(k for k in range(1, len(names) + 2) if f"q{k}" not in names) - 1
        numbered = [f"{group}{k + 1}" for k in range(count)]
        return [name if name in names else "" for name in numbered] if any(n in names for n in numbered) else None
    named = [next((name for name in _names_of(group, joint) if name in names), "") for joint in joints]
    return named if any(named) else None

"""Writes the files of a case: the data sheet as an arm file and as URDF, and recordings as CSV."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

import rigid
from arms import Arm, Joint, Vector
from sensors import Recording


def _number(value: float) -> str:
    shown = f"{float(value):.9g}"
    return shown if any(mark in shown for mark in ".en") else f"{shown}.0"


def _row(values: Vector) -> str:
    return "[" + ", ".join(_number(value) for value in values) + "]"


def _table(joint: Joint) -> str:
    i = joint.link.inertia
    inertia = {"ixx": i[0, 0], "iyy": i[1, 1], "izz": i[2, 2], "ixy": i[0, 1], "ixz": i[0, 2], "iyz": i[1, 2]}
    limits = {name: getattr(joint, name) for name in ("lower", "upper", "velocity", "acceleration", "effort")}

    def inline(table: dict[str, float]) -> str:
        return "{ " + ", ".join(f"{name} = {_number(value)}" for name, value in table.items()) + " }"

    lines = [
        "[[joint]]",
        f'name = "{joint.name}"',
        'type = "revolute"',
        f"axis = {_row(joint.axis)}",
        f"origin = {{ xyz = {_row(joint.xyz)} }}",
        f"limits = {inline(limits)}",
        f"damping = {_number(joint.viscous)}",
        f"friction = {_number(joint.coulomb)}",
        f"rotor_inertia = {_number(joint.rotor)}",
        f"mass = {_number(joint.link.mass)}",
        f"com = {_row(joint.link.com)}",
        f"inertia = {inline(inertia)}",
    ]
    return "\n".join(lines)


def toml(arm: Arm) -> str:
    """Text of the data sheet as an arm file without effects."""
    head = f'name = "{arm.name}"\ngravity = {_row(arm.gravity)}'
    return "\n\n".join([head, *[_table(joint) for joint in arm.joints], f"[tool]\nxyz = {_row(arm.tool)}\n"])


def urdf(arm: Arm) -> str:
    """Text of the data sheet as URDF, which cannot express rotors."""
    robot = ET.Element("robot", name=arm.name)
    ET.SubElement(robot, "link", name="base_link")
    parent = "base_link"
    for joint in arm.joints:
        link = ET.SubElement(robot, "link", name=f"{joint.name}_link")
        inertial = ET.SubElement(link, "inertial")
        ET.SubElement(inertial, "origin", xyz=rigid.text(joint.link.com), rpy="0 0 0")
        ET.SubElement(inertial, "mass", value=_number(joint.link.mass))
        i = joint.link.inertia
        names = {"ixx": i[0, 0], "ixy": i[0, 1], "ixz": i[0, 2], "iyy": i[1, 1], "iyz": i[1, 2], "izz": i[2, 2]}
        ET.SubElement(inertial, "inertia", {name: _number(value) for name, value in names.items()})
        _urdf_joint(robot, joint.name, "revolute", parent, link.get("name") or "", joint.xyz, joint)
        parent = link.get("name") or ""
    ET.SubElement(robot, "link", name="tool0")
    _urdf_joint(robot, "tool_mount", "fixed", parent, "tool0", arm.tool, None)
    return ET.tostring(robot, encoding="unicode")


def _urdf_joint(robot: ET.Element, name: str, kind: str, parent: str, child: str, xyz: Vector, joint: Joint | None) -> None:
    element = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(element, "parent", link=parent)
    ET.SubElement(element, "child", link=child)
    ET.SubElement(element, "origin", xyz=rigid.text(xyz), rpy="0 0 0")
    if joint is None:
        return
    ET.SubElement(element, "axis", xyz=rigid.text(joint.axis))
    ET.SubElement(element, "dynamics", damping=_number(joint.viscous), friction=_number(joint.coulomb))
    limits = {name: _number(getattr(joint, name)) for name in ("lower", "upper", "velocity", "effort")}
    ET.SubElement(element, "limit", limits)


def csv(recording: Recording) -> str:
    """Text of the columns as CSV, with ten digits."""
    names = list(recording.columns)
    table = np.array([recording.columns[name] for name in names]).T
    form = ",".join(["%.6f"] + ["%.10g"] * (len(names) - 1))
    return ",".join(names) + "\n" + "\n".join(form % tuple(row) for row in table) + "\n"


def write(folder: Path, sheet: str, recordings: dict[str, Recording]) -> None:
    """Writes `model.toml` and the recordings, by file name, without the true effects."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.toml").write_text(sheet)
    for name, recording in recordings.items():
        (folder / name).write_text(csv(recording))

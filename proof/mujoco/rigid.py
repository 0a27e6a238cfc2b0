"""The rigid arm of a data sheet in MuJoCo: torques, inertias and tool position, without friction, gaps and sensors."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import mujoco
import numpy as np

from arms import Arm, Joint, Link, Vector


def text(values: Vector | list[float] | tuple[float, ...]) -> str:
    """Text of numbers in an MJCF attribute."""
    return " ".join(repr(float(value)) for value in values)


def add_inertial(body: ET.Element, link: Link) -> None:
    """Sets mass, centre and inertia of `body` to those of `link`."""
    i = link.inertia
    full = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
    ET.SubElement(body, "inertial", mass=repr(float(link.mass)), pos=text(link.com), fullinertia=text(full))


def add_hinge(body: ET.Element, name: str, joint: Joint) -> ET.Element:
    """Adds the hinge of `joint` with its rotor to `body`."""
    return ET.SubElement(body, "joint", name=name, type="hinge", axis=text(joint.axis), armature=repr(float(joint.rotor)))


def frame(arm: Arm, step: float) -> tuple[ET.Element, ET.Element]:
    """An empty model with the common options. Returns its root and its world body."""
    root = ET.Element("mujoco", model=arm.name)
    ET.SubElement(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false")
    option = ET.SubElement(
        root, "option", timestep=repr(step), gravity=text(arm.gravity), integrator="implicitfast", solver="Newton", tolerance="1e-10"
    )
    ET.SubElement(option, "flag", contact="disable")
    return root, ET.SubElement(root, "worldbody")


def mjcf(arm: Arm) -> str:
    """MJCF of the rigid arm."""
    root, parent = frame(arm, 1e-3)
    for joint in arm.joints:
        parent = ET.SubElement(parent, "body", name=joint.name, pos=text(joint.xyz))
        add_inertial(parent, joint.link)
        add_hinge(parent, joint.name, joint)
    ET.SubElement(parent, "site", name="tool", pos=text(arm.tool))
    return ET.tostring(root, encoding="unicode")


class Rigid:
    """Inverse dynamics and kinematics of a data sheet."""

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self._model = mujoco.MjModel.from_xml_string(mjcf(arm))
        self._data = mujoco.MjData(self._model)
        self._square = np.zeros((arm.dof, arm.dof))

    def torque(self, q: Vector, v: Vector, a: Vector) -> Vector:
        """Torque of the rigid arm with its rotors, without friction, N·m."""
        data = self._data
        data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
        mujoco.mj_inverse(self._model, data)
        return data.qfrc_inverse.copy()

    def torques(self, q: Vector, v: Vector, a: Vector) -> Vector:
        """Torques of the rigid arm, row by row, N·m."""
        return np.array([self.torque(*row) for row in zip(q, v, a, strict=True)])

    def inertia(self, q: Vector) -> Vector:
        """Mass matrix with the rotors, kg·m²."""
        self._place(q)
        mujoco.mj_fullM(self._model, self._data, self._square)
        return self._square.copy()

    def felt(self, q: Vector) -> Vector:
        """Effective inertia of each joint with all others free, kg·m²."""
        return 1.0 / np.diag(np.linalg.inv(self.inertia(q)))

    def tool(self, q: Vector) -> Vector:
        """Position of the tool in the base frame, m."""
        self._place(q)
        return self._data.site_xpos[0].copy()

    def lever(self, q: Vector) -> Vector:
        """Jacobian of the tool position, m per rad, 3 × n."""
        self._place(q)
        jacobian = np.zeros((3, self.arm.dof))
        mujoco.mj_jacSite(self._model, self._data, jacobian, None, 0)
        return jacobian

    def _place(self, q: Vector) -> None:
        self._data.qpos[:] = q
        mujoco.mj_fwdPosition(self._model, self._data)

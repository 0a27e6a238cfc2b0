"""Reads a rigid arm from a Freeplay arm file and computes its inverse dynamics, with the standard library alone.

Source: Luh, Walker, Paul 1980, "On-line computational scheme for mechanical manipulators": velocities and accelerations
from the base outwards, forces from the tool inwards, all in the frames of the links.
"""

import math
import tomllib
from pathlib import Path


class Arm:
    """The joints of an arm file that contains its joints, such as the `model.toml` of a run."""

    def __init__(self, path, gravity=None):
        table = tomllib.loads(Path(path).read_text())
        if "joint" not in table:
            raise ValueError(f"{path}: no [[joint]] tables; this example reads arm files with inline joints, not URDF")
        self.gravity = tuple(gravity or table.get("gravity", (0.0, 0.0, -9.81)))
        self.joints = [Joint(joint) for joint in table["joint"]]

    def torques(self, q, v, a):
        """Joint torques (forces) at positions q, velocities v and accelerations a."""
        omega, alpha, acceleration = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), scaled(self.gravity, -1.0)
        wrenches, turns = [], []
        for joint, qi, vi, ai in zip(self.joints, q, v, a):
            turn, offset = joint.frame(qi)
            # The acceleration of the joint's origin, in the frame of the previous link.
            acceleration = added(acceleration, added(cross(alpha, offset), cross(omega, cross(omega, offset))))
            omega, alpha, acceleration = into(turn, omega), into(turn, alpha), into(turn, acceleration)
            axis = joint.axis
            if joint.revolute:
                alpha = added(alpha, added(scaled(axis, ai), cross(omega, scaled(axis, vi))))
                omega = added(omega, scaled(axis, vi))
            else:
                acceleration = added(acceleration, added(scaled(axis, ai), scaled(cross(omega, axis), 2.0 * vi)))
            wrenches.append(joint.wrench(omega, alpha, acceleration))
            turns.append((turn, offset))
        return self._inwards(wrenches, turns, v, a)

    def _inwards(self, wrenches, turns, v, a):
        torques = [0.0] * len(self.joints)
        force, moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for i in reversed(range(len(self.joints))):
            joint = self.joints[i]
            force, moment = added(force, wrenches[i][0]), added(moment, wrenches[i][1])
            torques[i] = dot(joint.axis, moment if joint.revolute else force) + joint.rotor_inertia * a[i]
            turn, offset = turns[i]
            force = out_of(turn, force)
            moment = added(out_of(turn, moment), cross(offset, force))
        return torques


class Joint:
    """A joint and the link that it moves."""

    def __init__(self, table):
        self.revolute = table["type"] == "revolute"
        self.axis = tuple(scaled(table["axis"], 1.0 / math.sqrt(dot(table["axis"], table["axis"]))))
        origin = table.get("origin", {})
        self.offset = tuple(origin.get("xyz", (0.0, 0.0, 0.0)))
        turned = "quaternion" in origin
        self.turn = of_quaternion(origin["quaternion"]) if turned else of_rpy(origin.get("rpy", (0.0, 0.0, 0.0)))
        self.mass = table.get("mass", 0.0)
        self.com = tuple(table.get("com", (0.0, 0.0, 0.0)))
        inertia = {key: table.get("inertia", {}).get(key, 0.0) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")}
        ixx, ixy, ixz, iyy, iyz, izz = inertia.values()
        self.inertia = ((ixx, ixy, ixz), (ixy, iyy, iyz), (ixz, iyz, izz))
        self.damping, self.friction = table.get("damping", 0.0), table.get("friction", 0.0)
        self.rotor_inertia = table.get("rotor_inertia", 0.0)

    def frame(self, q):
        """The link's frame in the frame of the previous link: rotation matrix and offset."""
        if self.revolute:
            return times(self.turn, about(self.axis, q)), self.offset
        return self.turn, added(self.offset, out_of(self.turn, scaled(self.axis, q)))

    def wrench(self, omega, alpha, acceleration):
        """Force, and moment about the link's origin, that cause the link's acceleration (Newton and Euler)."""
        com = added(acceleration, added(cross(alpha, self.com), cross(omega, cross(omega, self.com))))
        force = scaled(com, self.mass)
        spin = added(out_of(self.inertia, alpha), cross(omega, out_of(self.inertia, omega)))
        return force, added(spin, cross(self.com, force))


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def added(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def scaled(a, factor):
    return a[0] * factor, a[1] * factor, a[2] * factor


def out_of(m, a):
    """m a: rotates a from the frame of the link to that of the previous link."""
    return dot(m[0], a), dot(m[1], a), dot(m[2], a)


def into(m, a):
    """mᵀ a: rotates a from the frame of the previous link to that of the link."""
    x, y, z = a
    return (
        m[0][0] * x + m[1][0] * y + m[2][0] * z,
        m[0][1] * x + m[1][1] * y + m[2][1] * z,
        m[0][2] * x + m[1][2] * y + m[2][2] * z,
    )


def times(a, b):
    columns = tuple(zip(*b))
    return tuple(tuple(dot(row, column) for column in columns) for row in a)


def about(axis, angle):
    """Rotation matrix for `angle` about the unit vector `axis` (Rodrigues 1840)."""
    x, y, z = axis
    c, s = math.cos(angle), math.sin(angle)
    t = 1.0 - c
    return (
        (t * x * x + c, t * x * y - s * z, t * x * z + s * y),
        (t * x * y + s * z, t * y * y + c, t * y * z - s * x),
        (t * x * z - s * y, t * y * z + s * x, t * z * z + c),
    )


def of_rpy(rpy):
    """Rotation matrix for roll, pitch, yaw about the fixed axes x, y, z."""
    roll, pitch, yaw = (about(axis, angle) for axis, angle in zip(((1, 0, 0), (0, 1, 0), (0, 0, 1)), rpy))
    return times(yaw, times(pitch, roll))


def of_quaternion(quaternion):
    """Rotation matrix of the unit quaternion x, y, z, w."""
    x, y, z, w = quaternion
    size = math.sqrt(x * x + y * y + z * z)
    return about((1, 0, 0), 0.0) if size == 0.0 else about((x / size, y / size, z / size), 2.0 * math.atan2(size, w))

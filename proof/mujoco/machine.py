"""Runs a machine: MuJoCo steps the model, a servo drives it, and a trace records the motion."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

import build
from arms import Arm, Vector
from motions import CYCLE, LEAD_IN, Motion
from plan import Plan
from rigid import Rigid

STEP = 2.5e-4
"""Step of a plain machine, s."""
SHORT_STEP = 1e-4
"""Step of a machine with something stiff in it, s."""
SPEED_CUTOFF = 150.0
"""Cutoff of the servo's filter of differentiated encoder readings, Hz."""
DAMPING = 0.8
"""Damping ratio of a joint under its servo."""
CURRENT_LAG = 3e-4
"""Time constant of a drive's current, s."""


class MachineError(Exception):
    """The machine did not follow its motion, or became unstable."""


@dataclass(frozen=True)
class Servo:
    """Settings of a servo."""

    bandwidth: float
    """Natural frequency of each joint's loop, rad/s."""
    integral: float
    """Integral over proportional gain, 1/s."""
    resolution: Vector
    """Step of each encoder, rad."""
    friction: bool
    """Whether the feed-forward knows the friction of the data sheet."""


@dataclass(frozen=True)
class Trace:
    """The recorded motion of a machine, one row for each cycle from time 0 on."""

    t: Vector
    motor: Vector
    link: Vector
    tool: Vector
    torque: Vector
    """In the middle of the cycle that begins at `t`."""


class Live:
    """The running machine, for hooks. Joints count from 0. Positions and speeds are those of the motors."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.step = SHORT_STEP if plan.body.is_fast else STEP
        self.steps = round(CYCLE / self.step)
        self.model = mujoco.MjModel.from_xml_string(build.mjcf(plan, self.step))
        self.data = mujoco.MjData(self.model)
        names = [joint.name for joint in plan.arm.joints]
        joints = [self.model.joint(name) for name in names]
        self.place = np.array([joint.qposadr[0] for joint in joints])
        self.row = np.array([joint.dofadr[0] for joint in joints])
        self.tool = self.model.site("tool").id
        self.last_link = self.model.body(names[-1]).id
        self.friction = self.model.dof_frictionloss[self.row].copy()
        self.damping = self.model.dof_damping[self.row].copy()
        self.extra = np.zeros(plan.arm.dof)
        """Dry friction beyond the data sheet's, N·m; hooks add to it."""
        self.share = np.ones(plan.arm.dof)
        """All friction is multiplied by it; hooks set it."""
        self.added = np.zeros(plan.arm.dof)
        """Torque on the motors beyond the drives', N·m; hooks add to it."""
        self.load = np.zeros(plan.arm.dof)
        """Torque that each joint hands on to its link, N·m."""
        self.t = -LEAD_IN
        """Time, s."""
        self._play = [self._address(f"play_{number}") for number in range(plan.arm.dof)]

    def _address(self, name: str) -> int | None:
        found = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_JOINT, name)
        return None if found < 0 else int(self.model.jnt_qposadr[found])

    @property
    def q(self) -> Vector:
        """Positions of the motors, rad."""
        return self.data.qpos[self.place]

    @property
    def v(self) -> Vector:
        """Speeds of the motors, rad/s."""
        return self.data.qvel[self.row]

    def links(self) -> Vector:
        """Positions of the links, rad."""
        return self.q + [0.0 if at is None else self.data.qpos[at] for at in self._play]

    def start(self, q: Vector) -> None:
        """Puts the machine at rest at `q`."""
        self.data.qpos[self.place] = q
        if self.plan.body.mount is not None:
            self._balance_mount()
        mujoco.mj_forward(self.model, self.data)

    def _balance_mount(self) -> None:
        """Adjusts the springs of the mount so that it is level under the arm at rest."""
        frequency, ratio = self.plan.body.mount or (1.0, 0.0)
        rows = [self.model.joint(name).dofadr[0] for name in ("rock_x", "rock_y")]
        square = np.zeros((self.model.nv, self.model.nv))
        self.data.qacc[:] = 0.0
        mujoco.mj_inverse(self.model, self.data)
        mujoco.mj_fullM(self.model, self.data, square)
        for row in rows:
            joint = self.model.dof_jntid[row]
            stiffness = square[row, row] * (2 * np.pi * frequency) ** 2
            self.model.jnt_stiffness[joint] = stiffness
            self.model.dof_damping[row] = 2 * ratio * np.sqrt(stiffness * square[row, row])
            self.model.qpos_spring[self.model.jnt_qposadr[joint]] = self.data.qfrc_inverse[row] / stiffness

    def cycle(self, torque: Vector) -> None:
        """Steps one servo cycle with the `torque` of the drives."""
        model, data, row = self.model, self.data, self.row
        if self.plan.hooks:
            self._act(torque)
        else:
            data.qfrc_applied[row] = torque
        mujoco.mj_step(model, data, self.steps)
        self.t += CYCLE

    def _act(self, torque: Vector) -> None:
        """Applies the hooks, in addition to the drives."""
        model, data, row = self.model, self.data, self.row
        inner = data.qfrc_applied[row] + data.qfrc_constraint[row] + data.qfrc_passive[row]
        self.load += 0.3 * (inner - model.dof_armature[row] * data.qacc[row] - self.load)
        self.extra[:], self.added[:], data.xfrc_applied[:] = 0.0, 0.0, 0.0
        for hook in self.plan.hooks:
            hook(self)
        model.dof_frictionloss[row] = np.maximum(self.friction * self.share + self.extra, 0.0)
        model.dof_damping[row] = self.damping * self.share
        data.qfrc_applied[row] = torque + self.added


class _Drive:
    """Feed-forward from the data sheet, and proportional, integral and derivative feedback on rounded encoder readings."""

    def __init__(self, sheet: Arm, servo: Servo, motion: Motion) -> None:
        rigid = Rigid(sheet)
        self.servo, self.motion = servo, motion
        self.limits = np.array([joint.effort for joint in sheet.joints])
        felt = np.min([rigid.felt(q) for q in motion.q[:: len(motion.q) // 12]], axis=0)
        self.stiffness = felt * servo.bandwidth**2
        self.damping = 2 * DAMPING * felt * servo.bandwidth
        self.ahead = rigid.torques(motion.q, motion.v, motion.a)
        if servo.friction:
            for number, joint in enumerate(sheet.joints):
                v = motion.v[:, number]
                self.ahead[:, number] += joint.viscous * v + joint.coulomb * np.tanh(v / (0.01 * joint.velocity))
        # Constants of the run: asked = base − stiffness · reading − damping · speed + sum.
        self.base = self.ahead + self.stiffness * motion.q + self.damping * motion.v
        self.gain = self.stiffness * servo.integral * CYCLE
        self.share = 1 - np.exp(-2 * np.pi * SPEED_CUTOFF * CYCLE)
        self.rise = 1 - np.exp(-CYCLE / CURRENT_LAG)
        self.last: Vector | None = None
        self.speed, self.sum, self.torque = np.zeros(sheet.dof), np.zeros(sheet.dof), self.ahead[0].copy()

    def cycle(self, row: int, reading: Vector) -> Vector:
        """The torque of the drives in this cycle, from the encoder readings at its beginning."""
        reading = np.rint(reading / self.servo.resolution) * self.servo.resolution
        if self.last is not None:
            self.speed += self.share * ((reading - self.last) / CYCLE - self.speed)
        self.last = reading
        self.sum += self.gain * (self.motion.q[row] - reading)
        _clip(self.sum, 0.4 * self.limits)
        asked = self.base[row] - self.stiffness * reading - self.damping * self.speed + self.sum
        _clip(asked, self.limits)
        self.torque += self.rise * (asked - self.torque)
        return self.torque


def _clip(values: Vector, limits: Vector) -> None:
    """Clips `values` to plus and minus `limits`."""
    np.minimum(values, limits, out=values)
    np.maximum(values, -limits, out=values)


def run(plan: Plan, sheet: Arm, servo: Servo, motion: Motion) -> Trace:
    """Runs the machine of `plan` through `motion`, with a servo that uses the data sheet `sheet`.

    Raises MachineError if MuJoCo can't build it, or if it deviates from its motion by more than a third of a radian.
    """
    try:
        live, drive = Live(plan), _Drive(sheet, servo, motion)
    except ValueError as error:
        raise MachineError(f"{plan.arm.name} can't be built: {error}") from error
    live.start(motion.q[0])
    skip = round(LEAD_IN / CYCLE)
    rows, n = len(motion.q), sheet.dof
    motor, link, tool, torque = (np.zeros((rows, width)) for width in (n, n, 3, n))
    for row in range(rows):
        mujoco.mj_kinematics(live.model, live.data)
        motor[row], link[row], tool[row] = live.q, live.links(), live.data.site_xpos[live.tool]
        reading = motor[row].copy()
        for joint, read in plan.senses.reading.items():
            reading[joint] = read(reading[joint], live.t)
        torque[row] = drive.cycle(row, reading)
        live.cycle(torque[row])
    if not np.isfinite(motor).all() or np.abs(motor - motion.q).max() > 0.35:
        raise MachineError(f"{plan.arm.name} does not follow its motion")
    t = (np.arange(rows) - skip) * CYCLE
    return Trace(t, motor, link, tool, torque)

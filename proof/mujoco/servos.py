"""Machines on position servos. The recordings contain only commanded and measured positions.

MuJoCo's position actuators drive the joints. They delay commands by whole steps and hold them. The truth contains the effects that the given model
lacks: all of the servos (`bare`), one effect (`one`), no effect (`own`), or a gap behind the encoder on the motor (`behind`).
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import deque
from dataclasses import dataclass, field, replace

import mujoco
import numpy as np

import arms
import build
import files
import motions
import tolerances
from arms import Arm, Rng, Vector
from build import FRICTION, WALL
from cases import Made, NotMade
from laws import spread
from plan import Plan
from rigid import Rigid
from sensors import Recording

STEP = 1e-3
"""Step of a servo, s; delays are whole numbers of it."""
PARTS = 2
"""Steps of MuJoCo in one of the servo's: half of one in time is what its integrator gives away, less than the tolerance of delays."""
FAMILIES = {"planar": 0.3, "boom": 0.5, "bench": 0.2}
"""Arms by their shares: six joints take a diagnosis as long as ten cases of two."""
SORTS = ("bare", "one", "own", "behind")
"""What is given and what is concealed."""
MISSING = (
    "coulomb_friction", "stribeck_friction", "command_delay", "rotor_inertia", "hard_stop", "servo", "torque_limit", "payload", "link_mass", "base_tilt"
)
"""What `one` conceals."""
ATTEMPTS = 20
"""Machines that are tried until one does its motion and shows what is asked for."""
STRIBECK = 0.03
"""Speed at which stiction has fallen to 1/e, rad/s."""

Table = dict[str, object]


@dataclass
class Joint:
    """The servo of a joint, its friction and its limits."""

    stiffness: float
    damping: float
    coulomb: float = 0.0
    extra: float = 0.0
    rotor: float = 0.0
    delay: int = 0
    """Steps."""
    limit: float | None = None
    """Greatest torque, N·m."""
    stop: float | None = None
    """Lower end, rad."""

    def tables(self, name: str) -> list[Table]:
        """The effects of the joint, in the format of the catalogue."""

        def one(kind: str, **parameters: float) -> Table:
            return {"kind": kind, "joint": name, "parameters": parameters}

        limit = {} if self.limit is None else {"torque_limit": self.limit}
        all_of_them = [one("servo", stiffness=self.stiffness, damping=self.damping, **limit)]
        if self.coulomb > 0:
            all_of_them.append(one("coulomb_friction", coulomb=self.coulomb))
        if self.extra > 0:
            all_of_them.append(one("stribeck_friction", extra=self.extra, velocity=STRIBECK))
        if self.delay > 0:
            all_of_them.append(one("command_delay", delay=self.delay * STEP))
        if self.rotor > 0:
            all_of_them.append(one("rotor_inertia", inertia=self.rotor))
        if self.stop is not None:
            all_of_them.append(one("hard_stop", lower=self.stop))
        return all_of_them


@dataclass
class Machine:
    """A machine on servos: the true arm, and its joints."""

    arm: Arm
    joints: list[Joint]
    whole: list[Table] = field(default_factory=list)
    """Effects of the arm as a whole that its data sheet lacks."""
    loads: list[tuple[float, Vector]] = field(default_factory=list)
    gap: dict[int, float] = field(default_factory=dict)

    def tables(self) -> list[Table]:
        """All effects of the machine that the data sheet does not name."""
        of_joints = [table for joint, servo in zip(self.arm.joints, self.joints, strict=True) for table in servo.tables(joint.name)]
        return of_joints + self.whole


def _sheet(family: str, rng: Rng) -> Arm:
    """A data sheet without friction."""
    sheet = arms.draw(family, rng)
    return replace(sheet, joints=tuple(replace(joint, viscous=0.0, coulomb=0.0) for joint in sheet.joints))


def _true(sheet: Arm, rng: Rng) -> Arm:
    return tolerances.draw(sheet, rng).arm


def _bears(sheet: Arm, joint: int) -> bool:
    """True if the joint bears weight, which presses the link against a flank of a gap behind the encoder and so determines its position."""
    home = np.array([it.home for it in sheet.joints])
    still = np.zeros(sheet.dof)
    weights = np.abs(Rigid(sheet).torque(home, still, still))
    return bool(weights[joint] > 1e-6 * weights.max())


def _joints(sheet: Arm, rng: Rng) -> list[Joint]:
    """Draws servos of 10 to 30 rad/s with a lag of 20 to 100 ms, with friction at most joints, and in most cases a common command delay."""
    rigid = Rigid(sheet)
    home = np.array([joint.home for joint in sheet.joints])
    felt = np.diag(rigid.inertia(home))
    delay = int(rng.integers(5, 51)) if rng.random() < 0.6 else 0
    joints = []
    for inertia in felt:
        stiffness = float(inertia * spread(rng, 10.0, 30.0) ** 2)
        joint = Joint(stiffness, stiffness * float(rng.uniform(0.02, 0.1)), delay=delay)
        if rng.random() < 0.7:
            joint.coulomb = stiffness * float(rng.uniform(5e-3, 4e-2))
        if rng.random() < 0.3:
            joint.extra = stiffness * float(rng.uniform(5e-3, 3e-2))
        if rng.random() < 0.2:
            joint.rotor = float(inertia * spread(rng, 0.3, 1.5))
        joints.append(joint)
    return joints


def mjcf(machine: Machine) -> str:
    """MJCF of the machine."""
    plan = Plan.plain(machine.arm)
    plan.body.loads, plan.body.gap = list(machine.loads), dict(machine.gap)
    root = ET.fromstring(build.mjcf(plan, STEP / PARTS))
    actuators = ET.SubElement(root, "actuator")
    for joint, servo in zip(machine.arm.joints, machine.joints, strict=True):
        hinge = root.find(f".//joint[@name='{joint.name}']")
        if hinge is None:
            raise ValueError(joint.name)
        # The damping of the servo is damping of the joint, because MuJoCo integrates both implicitly.
        hinge.set("frictionloss", repr(servo.coulomb + servo.extra))
        hinge.set("armature", repr(joint.rotor + servo.rotor))
        hinge.attrib.update(FRICTION)
        if servo.stop is not None:
            hinge.attrib.update(limited="true", range=f"{servo.stop!r} 9.0", **WALL)
        position = ET.SubElement(actuators, "position", joint=joint.name, kp=repr(servo.stiffness), kv=repr(servo.damping))
        if servo.limit is not None:
            position.set("forcerange", f"{-servo.limit!r} {servo.limit!r}")
    return ET.tostring(root, encoding="unicode")


def run(machine: Machine, commands: Vector, hold: int) -> tuple[Vector, Vector]:
    """Runs `commands` (one row every `hold` steps). Returns the positions at their time stamps, and the largest torque of each servo."""
    model = mujoco.MjModel.from_xml_string(mjcf(machine))
    data = mujoco.MjData(model)
    names = [joint.name for joint in machine.arm.joints]
    places = np.array([model.joint(name).qposadr[0] for name in names])
    rows = np.array([model.joint(name).dofadr[0] for name in names])
    sticking = [number for number, joint in enumerate(machine.joints) if joint.extra > 0]
    substeps = round(STEP / model.opt.timestep)
    lowest = [-np.inf if joint.stop is None else joint.stop for joint in machine.joints]
    data.qpos[places] = np.maximum(commands[0], lowest)
    mujoco.mj_forward(model, data)
    lines = [deque([commands[0, number]] * (joint.delay + 1), joint.delay + 1) for number, joint in enumerate(machine.joints)]
    out, most = np.zeros_like(commands), np.zeros(len(names))
    lead = round(1.0 / STEP / hold)
    for row in range(-lead, len(commands)):
        if row >= 0:
            out[row] = data.qpos[places]
        command = commands[max(row, 0)]
        for _ in range(hold):
            for number, line in enumerate(lines):
                line.append(command[number])
                data.ctrl[number] = line[0]
            for number in sticking:
                joint = machine.joints[number]
                model.dof_frictionloss[rows[number]] = joint.coulomb + joint.extra * np.exp(-((data.qvel[rows[number]] / STRIBECK) ** 2))
            mujoco.mj_step(model, data, substeps)
            most = np.maximum(most, np.abs(data.actuator_force))
    if not np.isfinite(out).all() or np.abs(out - commands).max() > 1.0:
        raise NotMade(f"{machine.arm.name} does not follow its commands")
    return out, most


@dataclass(frozen=True)
class Record:
    """Settings of a recording."""

    hold: int
    """Steps between two commands."""
    tick: Vector
    """Steps of the encoders, rad."""
    motions: tuple[Vector, ...]
    """Commands, one row each."""

    @staticmethod
    def draw(sheet: Arm, rng: Rng) -> Record:
        """Draws two motions of 40 to 60 s with commands at 33 to 100 Hz, and encoders with a resolution of 3e-4 to 2e-3 rad."""
        hold = int(rng.choice([10, 20, 20, 30]))
        tick = np.full(sheet.dof, float(np.exp(rng.uniform(np.log(3e-4), np.log(2e-3)))))
        still: set[int] = set()
        both = [motions.draw(sheet, str(rng.choice(motions.FAMILIES)), float(rng.uniform(40, 60)), still, rng) for _ in range(2)]
        lead = round(motions.LEAD_IN / motions.CYCLE)
        return Record(hold, tick, tuple(motion.q[lead::hold] for motion in both))

    def of(self, machine: Machine) -> tuple[dict[str, Recording], Vector]:
        """The recordings, and the largest torque of each servo in the first."""
        recordings, first = {}, np.zeros(len(machine.joints))
        for name, commands in zip(("recording.csv", "second.csv"), self.motions, strict=True):
            q, most = run(machine, commands, self.hold)
            first = most if name == "recording.csv" else first
            columns = {"t": np.arange(len(commands)) * self.hold * STEP}
            read = np.round(q / self.tick) * self.tick
            columns.update({f"q{number + 1}": read[:, number] for number in range(q.shape[1])})
            columns.update({f"q_ref{number + 1}": commands[:, number] for number in range(q.shape[1])})
            recordings[name] = Recording(columns)
        return recordings, first


def toml(sheet: Arm, tables: list[Table]) -> str:
    """Text of the data sheet as an arm file with the effects `tables`."""

    def number(value: object) -> str:
        if isinstance(value, list):
            return "[" + ", ".join(number(one) for one in value) + "]"
        return f'"{value}"' if isinstance(value, str) else repr(float(value))  # type: ignore[arg-type]

    text = files.toml(sheet)
    for table in tables:
        joint = [] if table["joint"] is None else [f'joint = "{table["joint"]}"']
        parameters: dict[str, object] = table["parameters"]  # type: ignore[assignment]
        lines = [f"{name} = {number(value)}" for name, value in parameters.items()]
        text += "\n".join(["\n[[effect]]", f'kind = "{table["kind"]}"', *joint, *lines]) + "\n"
    return text


def _about(tables: list[Table], rng: Rng) -> list[Table]:
    """`tables` with measured servos: with errors within the tolerances of friction and delay."""
    exact = ("velocity", "lower")
    near = []
    for table in tables:
        parameters: dict[str, float] = table["parameters"]  # type: ignore[assignment]

        def known(name: str, value: float) -> float:
            if name == "inertia":
                return value * (1 + float(rng.uniform(-0.9, 0.9)) * tolerances.INERTIA)
            if name == "delay":
                return value + float(rng.uniform(-0.9, 0.9)) * tolerances.DELAY
            return value if name in exact else value * (1 + float(rng.uniform(-0.9, 0.9)) * tolerances.FRICTION)

        near.append({**table, "parameters": {name: known(name, value) for name, value in parameters.items()}})
    return near


def make(sort: str, missing: str, seed: int) -> Made:
    """Generates a machine of the sort `sort`. `missing` is the concealed effect of the sort `one`.

    Raises NotMade if none of the drawn machines shows it.
    """
    why = ""
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([seed, 8, attempt])
        try:
            return _made(sort, missing, seed, rng)
        except (NotMade, ValueError) as error:
            why = str(error)
    raise NotMade(why)


def _made(sort: str, missing: str, seed: int, rng: Rng) -> Made:
    family = str(rng.choice(list(FAMILIES), p=list(FAMILIES.values())))
    sheet = _sheet(family, rng)
    machine = Machine(_true(sheet, rng), _joints(sheet, rng))
    record = Record.draw(sheet, rng)
    if sort == "bare":
        if rng.random() < 0.15:
            _conceal(str(rng.choice(["payload", "link_mass", "base_tilt"])), sheet, machine, record, rng)
        for kind in ("torque_limit", "hard_stop"):
            if rng.random() < 0.1:
                _conceal(kind, sheet, machine, record, rng)
        given, concealed = [], machine.tables()
    elif sort == "one":
        given, concealed = _conceal(missing, sheet, machine, record, rng)
        given = _about(given, rng)
    else:
        given, concealed = _about(machine.tables(), rng), []
        if sort == "behind":
            joint = int(rng.integers(sheet.dof))
            machine.gap[joint] = float(rng.uniform(0.01, 0.04))
            concealed = [{"kind": "backlash", "joint": sheet.joints[joint].name, "parameters": {"gap": machine.gap[joint]}, "catalogued": _bears(sheet, joint)}]
    recordings, _ = record.of(machine)
    truth = {
        "schema": "freeplay.truth/1",
        "seed": seed,
        "machine": family,
        "joints": sheet.dof,
        "noise": "low",
        "sort": sort,
        "duration": float(recordings["recording.csv"].columns["t"][-1]),
        "effects": [{"severity": "clear", "signal_to_floor": 5.0, "channel": "q", "weak": ["velocity"], **table} for table in concealed],
    }
    return Made(sheet, toml(sheet, given), recordings, truth)


def _conceal(kind: str, sheet: Arm, machine: Machine, record: Record, rng: Rng) -> tuple[list[Table], list[Table]]:
    """Builds `kind` into `machine`. Returns the effects of a model without it, and the concealed effects."""
    number = int(rng.integers(sheet.dof))
    joint, name = machine.joints[number], sheet.joints[number].name
    tables = machine.tables()

    def without() -> tuple[list[Table], list[Table]]:
        everything = machine.tables()
        hidden = [table for table in everything if table["kind"] == kind and (kind == "command_delay" or table["joint"] == name)]
        return [table for table in everything if table not in hidden], hidden

    if kind == "coulomb_friction":
        joint.coulomb = joint.stiffness * float(rng.uniform(8e-3, 4e-2))
        return without()
    if kind == "stribeck_friction":
        joint.extra = joint.stiffness * float(rng.uniform(8e-3, 3e-2))
        return without()
    if kind == "command_delay":
        steps = int(rng.integers(8, 51))
        for one in machine.joints:
            one.delay = steps
        return without()
    if kind == "rotor_inertia":
        joint.rotor = joint.stiffness / 20.0**2 * float(rng.uniform(0.5, 1.5))
        return without()
    if kind == "hard_stop":
        commanded = record.motions[0][:, number]
        joint.stop = float(np.quantile(commanded, rng.uniform(0.08, 0.2)))
        if commanded.min() > joint.stop - 0.05:
            raise NotMade("no command reaches the stop")
        return without()
    if kind == "torque_limit":
        _, most = record.of(machine)
        joint.limit = float(most[number] * rng.uniform(0.5, 0.8))
        given = [{**table, "parameters": dict(table["parameters"])} for table in machine.tables()]  # type: ignore[call-overload]
        for table in given:
            if table["kind"] == "servo" and table["joint"] == name:
                del table["parameters"]["torque_limit"]  # type: ignore[attr-defined]
        return given, [joint.tables(name)[0]]
    if kind == "servo":
        # The model has a stiffer servo with the same damping ratio.
        factor = spread(rng, 1.25, 1.8)
        given = [{**table, "parameters": dict(table["parameters"])} for table in tables]  # type: ignore[call-overload]
        for table in given:
            if table["kind"] == "servo" and table["joint"] == name:
                table["parameters"]["stiffness"] *= factor  # type: ignore[index]
                table["parameters"]["damping"] *= factor  # type: ignore[index]
        return given, [joint.tables(name)[0]]
    hidden: Table
    if kind == "payload":
        mass = float(sum(one.link.mass for one in sheet.joints[-2:]) * rng.uniform(0.15, 0.5))
        place = np.asarray(sheet.tool, dtype=float)
        machine.loads.append((mass, place))
        hidden = {"kind": kind, "joint": None, "parameters": {"mass": mass, "com": place.tolist()}}
    elif kind == "link_mass":
        if number == 0 and sheet.dof > 2:
            raise NotMade("the first link turns about the vertical and is never lifted")
        scale = float(spread(rng, 1.2, 1.6))
        link = machine.arm.joints[number].link
        machine.arm = machine.arm.with_joint(number, link=replace(link, mass=link.mass * scale, inertia=link.inertia * scale))
        hidden = {"kind": kind, "joint": name, "parameters": {"scale": scale}}
        if number == sheet.dof - 1:
            why = "mass of the last link and at the tool load all joints in one proportion"
            hidden["equivalents"] = [{"kinds": ["payload"], "joint": None, "why": why}]
    else:
        roll, pitch = (float(rng.choice([-1.0, 1.0]) * rng.uniform(0.08, 0.3)) for _ in range(2))
        about_x = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
        about_y = np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]])
        machine.arm = replace(machine.arm, gravity=(about_y @ about_x).T @ machine.arm.gravity)
        hidden = {"kind": "base_tilt", "joint": None, "parameters": {"roll": roll, "pitch": pitch}}
    machine.whole.append(hidden)
    return tables, [hidden]


def drawn(quota: dict[str, int], seed: int) -> list[tuple[str, str, int]]:
    """The cases of an order. The models of singles lack all servos or one effect, in turns; those of doubles lack one effect, those of controls none.
    The others have a gap behind an encoder, which is undetectable if its joint bears no weight."""
    rng = np.random.default_rng([seed, 9])
    asks = [("bare" if number % 3 else "one") for number in range(quota.get("single", 0))]
    asks += ["one"] * quota.get("double", 0) + ["own"] * quota.get("negative", 0) + ["behind"] * quota.get("unknown", 0)
    deck = [MISSING[(number + int(rng.integers(len(MISSING)))) % len(MISSING)] for number in range(len(asks))]
    seeds = rng.integers(2**62, size=len(asks))
    order = rng.permutation(len(asks))
    return [(asks[place], deck[place], int(seeds[place])) for place in order]

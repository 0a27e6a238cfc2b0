"""Compares the processor time of Freeplay's rollouts with that of MuJoCo's steps, for the same arm on servos and the same commands.

    cargo build --release -p freeplay-servo --example rollout_speed
    python servo/examples/rollout_speed.py target/release/examples/rollout_speed

Five joints with gravity, dry friction and servos, 20 s of commands at 50 Hz. Both start in the same state, and their runs alternate. Position errors are differences from rollouts with steps of 0.1 ms.
"""

from __future__ import annotations

import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import mujoco
import numpy as np
from mujoco import rollout

NAMES = ["pan", "lift", "elbow", "flex", "roll"]
AXES = ["0 0 1", "0 -1 0", "0 -1 0", "0 -1 0", "1 0 0"]
MASS, LENGTH, INERTIA = 0.3, 0.12, 6e-4
STIFFNESS, DAMPING, FRICTION = 15.0, 0.8, 0.15
DURATION, RATE = 20.0, 50.0
COUNT, TURNS = 40, 7


def arm_file() -> str:
    """Text of the arm file for Freeplay."""
    parts = ['name = "five joints"\n']
    for number, (name, axis) in enumerate(zip(NAMES, AXES)):
        place = LENGTH if number else 0.0
        parts.append(
            f'[[joint]]\nname = "{name}"\ntype = "revolute"\naxis = [{", ".join(f"{float(x)}" for x in axis.split())}]\n'
            f"origin = {{ xyz = [{place}, 0.0, 0.0] }}\nmass = {MASS}\ncom = [{0.5 * LENGTH}, 0.0, 0.0]\n"
            f"inertia = {{ ixx = {INERTIA}, iyy = {INERTIA}, izz = {INERTIA}, ixy = 0.0, ixz = 0.0, iyz = 0.0 }}\n"
        )
    for name in NAMES:
        parts.append(f'[[effect]]\nkind = "servo"\njoint = "{name}"\nstiffness = {STIFFNESS}\ndamping = {DAMPING}\n')
        parts.append(f'[[effect]]\nkind = "coulomb_friction"\njoint = "{name}"\ncoulomb = {FRICTION}\n')
    return "".join(parts)


def mjcf(step: float) -> str:
    """MJCF of the same arm."""
    body, actuators = "", ""
    for number, (name, axis) in reversed(list(enumerate(zip(NAMES, AXES)))):
        place = LENGTH if number else 0.0
        body = (
            f'<body pos="{place} 0 0"><inertial mass="{MASS}" pos="{0.5 * LENGTH} 0 0" diaginertia="{INERTIA} {INERTIA} {INERTIA}"/>'
            f'<joint name="{name}" axis="{axis}" frictionloss="{FRICTION}"/>{body}</body>'
        )
        actuators = f'<position joint="{name}" kp="{STIFFNESS}" kv="{DAMPING}"/>{actuators}'
    return (
        f'<mujoco><option timestep="{step}" integrator="implicitfast"><flag contact="disable"/></option>'
        f"<worldbody>{body}</worldbody><actuator>{actuators}</actuator></mujoco>"
    )


def commands() -> tuple[np.ndarray, np.ndarray]:
    """Time stamps, and a command for each joint at each of them."""
    t = np.arange(0.0, DURATION, 1.0 / RATE)
    waves = [0.5 * np.sin((0.9 + 0.2 * j) * t) + 0.2 * np.sin((2.7 - 0.3 * j) * t) for j in range(len(NAMES))]
    return t, np.stack(waves, axis=1)


class Freeplay:
    """Rollouts with the executable of the example."""

    def __init__(self, executable: str, folder: Path, step: float) -> None:
        self.name, self.step = f"rollouts, arm in steps of {1e3 * step:g} ms", step
        self.call = [executable, str(folder / "arm.toml"), str(folder / "commands.csv")]

    def positions(self, count: int) -> np.ndarray:
        """Positions at the stamps, after `count` rollouts."""
        done = subprocess.run([*self.call, str(count), str(self.step)], check=True, capture_output=True, text=True)
        return np.array([[float(x) for x in line.split(",")] for line in done.stdout.splitlines()])

    def seconds(self) -> float:
        """Processor time of a rollout, from the difference between many rollouts and one."""

        def spent(count: int) -> float:
            before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            self.positions(count)
            return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before

        return (spent(COUNT + 1) - spent(1)) / COUNT


class MuJoCo:
    """Runs with MuJoCo's own loop over steps."""

    def __init__(self, step: float) -> None:
        self.name = f"MuJoCo {mujoco.__version__}, steps of {1e3 * step:g} ms"
        self.model = mujoco.MjModel.from_xml_string(mjcf(step))
        self.data = mujoco.MjData(self.model)
        _, values = commands()
        self.every = round(1.0 / RATE / step)
        self.controls = np.repeat(values, self.every, axis=0)[None]
        self.data.qpos[:] = values[0]
        size = mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        self.start = np.zeros((1, size))
        mujoco.mj_getState(self.model, self.data, self.start[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)

    def positions(self, _: int) -> np.ndarray:
        """Positions at the stamps."""
        states, _ = rollout.rollout(self.model, self.data, self.start, self.controls)
        joints = len(NAMES)
        after = states[0, self.every - 1 :: self.every, 1 : 1 + joints]
        return np.concatenate([self.start[:, 1 : 1 + joints], after[:-1]])

    def seconds(self) -> float:
        """Processor time of a rollout."""
        begun = time.process_time()
        for _ in range(COUNT // 10):
            self.positions(1)
        return (time.process_time() - begun) / (COUNT // 10)


def main() -> None:
    """Prints the table."""
    executable = str(Path(sys.argv[1]).resolve())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "arm.toml").write_text(arm_file())
        t, values = commands()
        np.savetxt(folder / "commands.csv", np.column_stack([t, values]), delimiter=",")
        exact = Freeplay(executable, folder, 1e-4).positions(1)
        runs = [Freeplay(executable, folder, step) for step in (0.01, 0.001)]
        runs += [MuJoCo(step) for step in (0.002, 0.001, 0.0005)]
        taken = [[run.seconds() for run in runs] for _ in range(TURNS)]
        first = statistics.median(row[0] for row in taken)
        for index, run in enumerate(runs):
            seconds = statistics.median(row[index] for row in taken)
            off = 1e3 * np.sqrt(np.mean((run.positions(1) - exact) ** 2))
            print(f"{run.name:42} {1e3 * seconds:8.2f} ms a rollout, {seconds / first:5.1f} of the first, {off:6.3f} mrad rms off")


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Replays a recording of a machine in MuJoCo, and prints the errors of the model.

    python replay_in_mujoco.py MODEL.xml RECORDING.csv

`freeplay export MODEL --to mjcf` writes MODEL.xml. The motors follow the recorded positions exactly. Gears and journals, which have no motor, move by
MuJoCo's dynamics. The motor torques of this motion are the predicted torques, and the site `tool0` is the predicted tool. Measured and predicted
values pass through the same low-pass filter. If the recording has commanded positions and no torques, the servos of the model follow the commands
by MuJoCo's dynamics, and the example compares positions; a model without servos is at the commanded positions. Requires mujoco, numpy and scipy.
"""

import argparse
import csv
import json

import mujoco
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt


def read(path):
    """Reads the columns of a CSV recording, by name."""
    with open(path, newline="") as file:
        rows = [row for row in csv.reader(file) if row and not row[0].startswith("#")]
    names, numbers = rows[0], np.array([[float(cell) for cell in row] for row in rows[1:]])
    return {name: numbers[:, index] for index, name in enumerate(names)}


def evenly(recording):
    """Interpolates the recording to uniform times, which the low-pass filter requires: its own time stamps jitter."""
    t = recording["t"]
    even = np.linspace(t[0], t[-1], len(t))
    return even, {name: np.interp(even, t, column) for name, column in recording.items()}


def low_pass(rate, cutoff):
    """Zero-phase low-pass filter."""
    sections = butter(2, cutoff, fs=rate, output="sos")
    return lambda columns: sosfiltfilt(sections, columns, axis=0)


class Machine:
    """A model with its drives: one actuator for each joint with a motor."""

    def __init__(self, path):
        self.model = mujoco.MjModel.from_xml_path(path)
        self.data = mujoco.MjData(self.model)
        model = self.model
        self.count = model.nu
        joints = model.actuator_trnid[:, 0]
        self.place, self.dof = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        # The control of a servo is a position, not a torque.
        servo = model.actuator_biasprm[:, 1] != 0.0
        self.gain = np.where(servo, 1.0, model.actuator_gainprm[:, 0])
        self.bias = np.where(servo, 0.0, model.actuator_biasprm[:, 0])
        self.has_servos = servo.all()
        self.limited, self.range = model.actuator_forcelimited.astype(bool), model.actuator_forcerange.copy()
        self.tool = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, "tool0")
        names = [model.actuator(number).name for number in range(self.count)]
        delays = getattr(model, "sensor_delay", np.zeros(model.nsensor))
        late = {kind: delays[model.sensor(f"{kind}_{names[0]}").id] for kind in ("q", "tau")}
        self.late = {**late, "tool": delays[model.sensor("tool").id]}
        # The same machine with motors so heavy that gears and journals do not change their motion.
        self.driven, self.moved = mujoco.MjModel.from_xml_path(path), mujoco.MjData(model)
        self.passive = np.setdiff1d(np.arange(model.nv), self.dof)
        mujoco.mj_forward(self.driven, self.moved)
        self.inertia = self.inertias()
        self.weight = 1e4 * self.inertia[self.dof]
        self.driven.dof_armature[self.dof] += self.weight

    def inertias(self):
        """Inertia on the diagonal of the mass matrix, kg m^2 or kg."""
        column, inertia = np.zeros(self.driven.nv), np.zeros(self.driven.nv)
        for index, unit in enumerate(np.eye(self.driven.nv)):
            mujoco.mj_mulM(self.driven, self.moved, column, unit)
            inertia[index] = column[index]
        return inertia

    def step(self, q, v, a):
        """Moves the motors to `q`, `v`, `a`, and returns measured torques and tool position there."""
        model, data, moved = self.model, self.data, self.moved
        moved.qpos[self.place], moved.qvel[self.dof] = q, v
        moved.qacc[self.dof] = a
        if len(self.passive):
            # The motors miss `a` by a ten-thousandth of the force on them. Friction that holds a link responds even to that, so the real motion counts.
            moved.qfrc_applied[self.dof] = self.weight * a
            mujoco.mj_forward(self.driven, moved)
        data.qpos[:], data.qvel[:], data.qacc[:] = moved.qpos, moved.qvel, moved.qacc
        mujoco.mj_inverse(model, data)
        force = data.qfrc_inverse[self.dof].copy()
        force[self.limited] = np.clip(force[self.limited], *self.range[self.limited].T)
        if len(self.passive):
            mujoco.mj_step(self.driven, moved)
        return (force - self.bias) / self.gain, data.site_xpos[self.tool].copy()

    def follow(self, t, start, commands):
        """Positions of the servos at the times `t`. They begin at rest at `start` and receive `commands`, each held until the next."""
        model, data = self.model, self.data
        mujoco.mj_resetData(model, data)
        data.qpos[self.place] = start
        positions = np.empty((len(t), self.count))
        for row, now in enumerate(t):
            while data.time < now - t[0] - 0.5 * model.opt.timestep:
                data.ctrl[:] = commands[max(row - 1, 0)]
                mujoco.mj_step(model, data)
            positions[row] = data.qpos[self.place]
        return positions

    def settle(self, q):
        """Simulates 1 s with the motors fixed at `q`, so that gears and journals come to rest."""
        model = self.driven
        damping = model.dof_damping.copy()
        # The added damping halves the amplitude of an oscillation within 30 ms.
        model.dof_damping[self.passive] += 50.0 * self.inertia[self.passive]
        still = np.zeros(self.count)
        for _ in range(int(1.0 / model.opt.timestep)):
            self.step(q, still, still)
        model.dof_damping[:] = damping

    def replay(self, t, q):
        """Predicted torques and tool positions at the times `t`, for the recorded positions `q`."""
        step = self.model.opt.timestep if len(self.passive) else float(t[1] - t[0])
        motion = CubicSpline(t, q)
        # Times of the machine: a position with the time stamp t was measured earlier.
        times = np.arange(t[0] - self.late["q"], t[-1], step)
        recorded = np.clip(times + self.late["q"], t[0], t[-1])
        if len(self.passive):
            self.settle(motion(recorded[0]))
        states = zip(motion(recorded), motion(recorded, 1), motion(recorded, 2))
        torque, tool = (np.array(columns) for columns in zip(*(self.step(*state) for state in states)))
        at = lambda columns, late: np.stack([np.interp(t, times + late, column) for column in columns.T], axis=1)
        return at(torque, self.late["tau"]), at(tool, self.late["tool"])


def rms(column):
    """Root mean square."""
    return float(np.sqrt(np.mean(column**2)))


def compare(path, recording, cutoff):
    """Root mean square of measured minus predicted values, by channel."""
    machine = Machine(path)
    t, recording = evenly(recording)
    rate = (len(t) - 1) / (t[-1] - t[0])
    smooth = low_pass(rate, cutoff)
    joints = range(1, machine.count + 1)
    columns = lambda name: np.stack([recording[f"{name}{joint}"] for joint in joints], axis=1)
    if "tau1" not in recording and "q_ref1" in recording:
        commands = columns("q_ref")
        model = machine.follow(t, columns("q")[0], commands) if machine.has_servos else commands
        return {f"q{joint}": rms(model[:, joint - 1] - recording[f"q{joint}"]) for joint in joints}
    torque, tool = machine.replay(t, smooth(columns("q")))
    model = {f"tau{joint}": torque[:, joint - 1] for joint in joints}
    model.update(zip("xyz", tool.T))
    # Both ends contain transients of the low-pass filter.
    inner = slice(int(rate * 0.5), -int(rate * 0.5))
    left = {name: smooth(recording[name] - column)[inner] for name, column in model.items() if name in recording}
    return {name: rms(column) for name, column in left.items()}


def main():
    """Prints the errors as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("model", nargs="+", help="MJCF files that freeplay export wrote")
    parser.add_argument("recording", help="CSV with t, q1…, tau1… and x, y, z")
    parser.add_argument("--lowpass", type=float, default=10.0, metavar="HZ", help="cutoff of the low-pass (10)")
    arguments = parser.parse_args()
    recording = read(arguments.recording)
    print(json.dumps({path: compare(path, recording, arguments.lowpass) for path in arguments.model}))


if __name__ == "__main__":
    main()

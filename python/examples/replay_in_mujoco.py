"""Replays a recording of a machine in MuJoCo and prints how far the model is from it.

    python replay_in_mujoco.py MODEL.xml RECORDING.csv

MODEL.xml is what `freeplay export MODEL --to mjcf` writes. A stiff position loop drives the joints along the recorded positions; the
torques that it takes are the model's, in the units and signs of the recording, and the site `tool0` is the model's tool. Both sides go
through the same low-pass. Needs mujoco, numpy and scipy.
"""

import argparse
import csv
import json

import mujoco
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

# Natural frequency of the position loop, rad/s: far above what an arm does, far below what a step of 1 ms resolves.
BANDWIDTH = 100.0


def read(path):
    """The columns of a CSV recording by name."""
    with open(path, newline="") as file:
        rows = [row for row in csv.reader(file) if row and not row[0].startswith("#")]
    names, numbers = rows[0], np.array([[float(cell) for cell in row] for row in rows[1:]])
    return {name: numbers[:, index] for index, name in enumerate(names)}


def sensor(model, name):
    """The place of a sensor's first number, and its delay, s."""
    index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SENSOR, name)
    return model.sensor_adr[index], float(getattr(model, "sensor_delay", np.zeros(model.nsensor))[index])


def inertias(model, data, dof):
    """Inertia that each of the joints at `dof` feels with the others held, kg m^2 or kg."""
    column, unit, felt = np.zeros(model.nv), np.zeros(model.nv), np.zeros(len(dof))
    for place, index in enumerate(dof):
        unit[:] = 0.0
        unit[index] = 1.0
        mujoco.mj_mulM(model, data, column, unit)
        felt[place] = column[index]
    return felt


def low_pass(rate, cutoff):
    """A low-pass without phase."""
    sections = butter(2, cutoff, fs=rate, output="sos")
    return lambda column: sosfiltfilt(sections, column, axis=0)


def replay(model, t, q):
    """Torques and tool positions, as the machine would measure them, at the times `t` along the positions `q`."""
    data = mujoco.MjData(model)
    joints = [model.actuator_trnid[actuator, 0] for actuator in range(model.nu)]
    place, dof = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
    names = [model.actuator(actuator).name for actuator in range(model.nu)]
    torque_at = [sensor(model, f"tau_{name}")[0] for name in names]
    tool_at, late = sensor(model, "tool")[0], sensor(model, f"q_{names[0]}")[1]
    gain, bias = model.actuator_gainprm[:, 0].copy(), model.actuator_biasprm[:, 0].copy()
    step = model.opt.timestep
    start = t[0] - late
    motion = CubicSpline(t, q)
    speed, acceleration = motion.derivative(), motion.derivative(2)
    data.qpos[place], data.qvel[dof] = motion(t[0]), speed(t[0])
    steps = int(round((t[-1] - t[0]) / step))
    times = np.clip(start + late + step * np.arange(steps + 1), t[0], t[-1])
    q, v, a = motion(times), speed(times), acceleration(times)
    torque, tool = np.zeros((steps + 1, model.nu)), np.zeros((steps + 1, 3))
    for k in range(steps + 1):
        if k % 10 == 0:
            mujoco.mj_forward(model, data)
            inertia = inertias(model, data, dof)
        error, rate = q[k] - data.qpos[place], v[k] - data.qvel[dof]
        force = inertia * (a[k] + 2.0 * BANDWIDTH * rate + BANDWIDTH**2 * error) + data.qfrc_bias[dof]
        data.ctrl[:] = (force - bias) / gain
        mujoco.mj_step(model, data)
        torque[k] = (data.sensordata[torque_at] - bias) / gain
        tool[k] = data.sensordata[tool_at : tool_at + 3]
    # Time of the recording at which a step is measured.
    measured_at = start + step * np.arange(steps + 1)

    def at(column):
        return np.array([np.interp(t, measured_at, part) for part in column.T]).T

    return at(torque), at(tool)


def compare(path, recording, cutoff):
    """Root mean square of measured minus model, by channel."""
    model = mujoco.MjModel.from_xml_path(path)
    t, count = recording["t"], model.nu
    rate = (len(t) - 1) / (t[-1] - t[0])
    smooth = low_pass(rate, cutoff)

    def stack(name):
        return np.stack([recording[f"{name}{joint + 1}"] for joint in range(count)], axis=1)

    torque, tool = replay(model, t, smooth(stack("q")))
    errors = {}
    inner = slice(int(rate * 0.5), -int(rate * 0.5))
    if "tau1" in recording:
        left = smooth(stack("tau"))[inner] - smooth(torque)[inner]
        errors.update({f"tau{joint + 1}": float(np.sqrt(np.mean(left[:, joint] ** 2))) for joint in range(count)})
    if "x" in recording:
        measured = np.stack([recording[axis] for axis in "xyz"], axis=1)
        left = smooth(measured)[inner] - smooth(tool)[inner]
        errors.update({axis: float(np.sqrt(np.mean(left[:, place] ** 2))) for place, axis in enumerate("xyz")})
    return errors


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

"""Computes torques and tool positions of an MJCF or URDF file for the motions on standard input, with MuJoCo's inverse dynamics.

Passive joints, those of gears and play, have the position in which their springs and limits balance the load.
"""

import json
import sys

import mujoco
import numpy as np

names, motions = json.load(sys.stdin)
model = mujoco.MjModel.from_xml_path(sys.argv[1])
data = mujoco.MjData(model)
joints = [model.joint(name) for name in names]
place = [joint.qposadr[0] for joint in joints]
dof = [joint.dofadr[0] for joint in joints]
passive = [index for index in range(model.nv) if index not in dof]


def dead_band(index):
    """Stiffness and half the gap of the gear at a passive joint."""
    joint = model.dof_jntid[index]
    flank = -model.jnt_solref[joint, 0] / model.dof_invweight0[index]
    return model.jnt_stiffness[joint] or max(flank, 0.0), model.jnt_range[joint, 1]


def hold():
    """Moves gears and journals to the positions to which the load presses them. The load is the torque of the inverse dynamics at their joints."""
    data.qpos[passive] = 0.0
    for _ in range(6):
        # Subtracts limits and springs of gears, so that the load alone remains.
        mujoco.mj_inverse(model, data)
        bare = data.qfrc_inverse + data.qfrc_passive + data.qfrc_constraint
        for index in [index for index in passive if model.dof_jntid[index] >= 0]:
            name = model.joint(model.dof_jntid[index]).name
            if name.endswith("_gear"):
                stiffness, half = dead_band(index)
                load = bare[index]
                data.qpos[index] = -np.sign(load) * half - (load / stiffness if stiffness > 0.0 else 0.0)
        for name in {model.joint(model.dof_jntid[index]).name[:-2] for index in passive if "_play_" in model.joint(model.dof_jntid[index]).name}:
            slides = [model.joint(f"{name}_{number}").dofadr[0] for number in (1, 2)]
            reach = model.tendon_range[model.tendon(name).id, 1]
            data.qpos[slides] = -reach * bare[slides] / np.linalg.norm(bare[slides])
    mujoco.mj_inverse(model, data)


def measured():
    """The controls with which the actuators produce the torques of the inverse dynamics."""
    torque = data.qfrc_inverse[dof].copy()
    if model.nu == 0:
        return torque
    for number, name in enumerate(names):
        actuator = model.actuator(name)
        force = torque[number]
        if actuator.forcelimited[0]:
            force = np.clip(force, *actuator.forcerange)
        torque[number] = (force - actuator.biasprm[0]) / actuator.gainprm[0]
    return torque


tool_site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, "tool0")
rows = []
for q, v, a in motions:
    data.qpos[place], data.qvel[dof], data.qacc[dof] = q, v, a
    if passive:
        hold()
    else:
        mujoco.mj_inverse(model, data)
    tool = data.site_xpos[tool_site].tolist() if tool_site >= 0 else []
    rows.append([measured().tolist(), tool])
print(json.dumps(rows))

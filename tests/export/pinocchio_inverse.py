"""Computes torques of a URDF file for the motions on standard input, with Pinocchio's recursive Newton-Euler algorithm."""

import json
import sys

import numpy as np
import pinocchio

names, motions = json.load(sys.stdin)
model = pinocchio.buildModelFromUrdf(sys.argv[1])
data = model.createData()


def packed(values):
    """Velocities, in Pinocchio's order of the joints."""
    vector = np.zeros(model.nv)
    for name, value in zip(names, values):
        vector[model.joints[model.getJointId(name)].idx_v] = value
    return vector


rows = []
for q, v, a in motions:
    # Pinocchio represents a joint without limits as a point on a circle: integrate from the neutral position.
    position = pinocchio.integrate(model, pinocchio.neutral(model), packed(q))
    torque = pinocchio.rnea(model, data, position, packed(v), packed(a))
    rows.append([[torque[model.joints[model.getJointId(name)].idx_v] for name in names], []])
print(json.dumps(rows))

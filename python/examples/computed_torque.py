#!/usr/bin/env python3
"""Computed-torque controller in Python: inverse dynamics of the rigid arm with feedback, to copy and change.

    freeplay run --controller python/examples/computed_torque.py

Requires Python 3.11 and `pip install iceoryx2==0.10.0`.
"""

import math
import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parent.parent), str(Path(__file__).resolve().parent)]

import freeplay
from rigid_arm import Arm


class ComputedTorque(freeplay.Controller):
    name = "python-computed-torque"

    def start(self, task, run):
        if task["model"] == "paper":
            raise ValueError("this example reads arm files; leave controller.model out of the scenario")
        self.arm = Arm(task["model"], task.get("gravity"))
        self.n, self.period = run.joints, run.period
        omega, zeta = task["gains"]["natural_frequency"], task["gains"]["damping_ratio"]
        self.stiffness, self.damping = omega * omega, 2.0 * zeta * omega

    def answer(self, state):
        n, now, wanted = self.n, state.reference, state.reference_next
        if state.mode == freeplay.DRIVEN:
            return freeplay.Answer(wanted.q[:n], wanted.qd[:n], wanted.qdd[:n])
        # A torque takes effect one tick later. Until then the joints are assumed to follow the reference.
        q, v, wanted_v = [], [], wanted.qd[:n]
        for position, velocity, acceleration in zip(state.q[:n], state.qd[:n], now.qdd[:n]):
            q.append(position + self.period * (velocity + 0.5 * self.period * acceleration))
            v.append(velocity + self.period * acceleration)
        a = [
            wanted_a + self.damping * (wv - vi) + self.stiffness * (wq - qi)
            for wanted_a, wv, wq, vi, qi in zip(wanted.qdd[:n], wanted_v, wanted.q[:n], v, q)
        ]
        torques = self.arm.torques(q, v, a)
        for i, joint in enumerate(self.arm.joints):
            sign = math.copysign(1.0, wanted_v[i]) if wanted_v[i] else 0.0
            torques[i] += joint.damping * wanted_v[i] + joint.friction * sign
        return torques


if __name__ == "__main__":
    freeplay.serve(ComputedTorque())

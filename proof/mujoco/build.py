"""Writes a plan as MJCF."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np

from arms import Vector
from plan import Plan
from rigid import add_hinge, add_inertial, frame, text

FRICTION = {"solreffriction": "0.002 1", "solimpfriction": "0.9999 0.9999 0.001 0.5 2"}
"""A joint that sticks creeps by no more than a few µrad/s."""
WALL = {"solreflimit": "0.002 1", "solimplimit": "0.95 0.999 0.0001 0.5 2"}
"""Flanks of gears and walls of bearings."""
SEED = "1e-06"
"""Mass, kg, and inertia, kg·m², of bodies that stand for motors and hinges: nothing beside any rotor."""
ELEMENTS = 4
"""Sliders in series with springs that stand for the bristles of one joint."""


def mjcf(plan: Plan, step: float) -> str:
    """MJCF of the machine, with steps of `step` s."""
    root, world = frame(plan.arm, step)
    parent = _mounted(plan, world)
    for number in range(plan.arm.dof):
        parent = _joint(plan, number, parent)
    ET.SubElement(parent, "site", name="tool", pos=text(plan.arm.tool))
    for number, (mass, place) in enumerate(plan.body.loads):
        _load(parent, f"load_{number}", mass, place)
    _pendulum(plan, parent)
    tendons = ET.SubElement(root, "tendon")
    _bristles(plan, world, tendons)
    _shafts(plan, tendons)
    _walls(plan, tendons)
    _rope(plan, world, tendons)
    return ET.tostring(root, encoding="unicode")


def _mounted(plan: Plan, world: ET.Element) -> ET.Element:
    """Adds the body on which the arm stands."""
    if plan.body.mount is None:
        return world
    mount = ET.SubElement(world, "body", name="mount")
    ET.SubElement(mount, "inertial", mass="5", pos="0 0 0", diaginertia="0.5 0.5 0.5")
    for name, axis in (("rock_x", "1 0 0"), ("rock_y", "0 1 0")):
        ET.SubElement(mount, "joint", name=name, axis=axis)
    return mount


def _joint(plan: Plan, number: int, parent: ET.Element) -> ET.Element:
    """Adds motor, play and link of one joint. Returns the parent body of the next joint."""
    joint, body = plan.arm.joints[number], plan.body
    if number in body.clearance:
        ET.SubElement(parent, "site", name=f"bearing_{number}", pos=text(joint.xyz))
    link = ET.SubElement(parent, "body", name=joint.name, pos=text(joint.xyz))
    if number in body.clearance:
        for k, axis in enumerate(across(joint.axis)):
            ET.SubElement(link, "joint", name=f"float_{number}_{k}", type="slide", axis=text(axis))
        ET.SubElement(link, "site", name=f"journal_{number}", pos="0 0 0")
    motor = add_hinge(link, joint.name, joint)
    dry = 0.0 if number in body.bristle else joint.coulomb  # With bristles the sliders have the friction.
    motor.attrib.update(damping=repr(float(joint.viscous)), frictionloss=repr(float(dry)), **FRICTION)
    if number in body.spring:
        stiffness, rest = body.spring[number]
        motor.attrib.update(stiffness=repr(float(stiffness)), springref=repr(float(rest)))
    if body.bump is not None and body.bump[0] == number:
        _bump(motor, body.bump[1], body.bump[2])
    if number in body.gap or number in body.elastic:
        link = _play(plan, number, link)
    add_inertial(link, joint.link)
    return _bent(plan, number, link)


def across(axis: Vector) -> tuple[Vector, Vector]:
    """Two directions perpendicular to `axis` and to each other."""
    first = np.roll(axis, 1)
    return first, np.cross(axis, first)


def _play(plan: Plan, number: int, motor: ET.Element) -> ET.Element:
    """Connects a link to its motor through a gap or a spring."""
    joint = plan.arm.joints[number]
    ET.SubElement(motor, "inertial", mass=SEED, pos="0 0 0", diaginertia=text([float(SEED)] * 3))
    link = ET.SubElement(motor, "body", name=f"{joint.name}_link")
    play = ET.SubElement(link, "joint", name=f"play_{number}", type="hinge", axis=text(joint.axis))
    if number in plan.body.gap:
        half = plan.body.gap[number] / 2
        play.attrib.update(limited="true", range=text([-half, half]), **WALL)
    else:
        stiffness, damping = plan.body.elastic[number]
        play.attrib.update(stiffness=repr(float(stiffness)), damping=repr(float(damping)))
    return link


def _bent(plan: Plan, number: int, link: ET.Element) -> ET.Element:
    """Adds two hinges at a third of a flexible link: they give the deflection and slope of a beam with a force at its end."""
    if number not in plan.body.bend:
        return link
    way = plan.arm.way(number)
    length = float(np.linalg.norm(way))
    bend = ET.SubElement(link, "body", name=f"bend_{number}", pos=text(way / 3))
    ET.SubElement(bend, "inertial", mass=SEED, pos="0 0 0", diaginertia=text([float(SEED)] * 3))
    stiffness = plan.body.bend[number] * (2 * length / 3) ** 2
    first = np.cross(way, np.roll(way, 1) + [0.1, 0.2, 0.3])
    first /= np.linalg.norm(first)
    for k, axis in enumerate((first, np.cross(way / length, first))):
        hinge = ET.SubElement(bend, "joint", name=f"bend_{number}_{k}", type="hinge", axis=text(axis))
        hinge.attrib.update(stiffness=repr(float(stiffness)), damping=repr(float(0.004 * stiffness)))
    # The following bodies keep their places.
    moved = ET.SubElement(bend, "body", name=f"after_{number}", pos=text(-way / 3))
    ET.SubElement(moved, "inertial", mass=SEED, pos="0 0 0", diaginertia=text([float(SEED)] * 3))
    return moved


def _bump(motor: ET.Element, at: float, stiffness: float) -> None:
    """Adds an elastic stop: an upper limit of the joint with a spring."""
    motor.attrib.update(
        limited="true", range=text([-9.0, at]), solreflimit=text([-stiffness, -0.01 * stiffness]), solimplimit="0.9 0.9 0.001 0.5 2"
    )


def _load(parent: ET.Element, name: str, mass: float, place: Vector) -> None:
    """Adds a ball with 5 kg/dm³."""
    radius = (mass / 5000 * 3 / (4 * np.pi)) ** (1 / 3)
    body = ET.SubElement(parent, "body", name=name, pos=text(place))
    ball = [0.4 * mass * radius**2 + 1e-12] * 3
    ET.SubElement(body, "inertial", mass=repr(float(mass)), pos="0 0 0", diaginertia=text(ball))


def _pendulum(plan: Plan, parent: ET.Element) -> None:
    if plan.body.pendulum is None:
        return
    mass, length, damping = plan.body.pendulum
    body = ET.SubElement(parent, "body", name="pendulum", pos=text(plan.arm.tool))
    inertia = text([mass * length**2 * 0.02] * 3)
    ET.SubElement(body, "inertial", mass=repr(float(mass)), pos=text([0.0, 0.0, -length]), diaginertia=inertia)
    ET.SubElement(body, "joint", name="pendulum", type="ball", damping=repr(float(damping)))


def _bristles(plan: Plan, world: ET.Element, tendons: ET.Element) -> None:
    """Adds springs in series with sliders. Their yield points lie on F (1 − exp(−k x / F)), which starts with the stiffness k."""
    for number, stiffness in plan.body.bristle.items():
        joint = plan.arm.joints[number]
        edges = np.array([0.35, 0.9, 1.8, 3.5])
        curve = 1 - np.exp(-edges)
        slopes = np.diff(np.concatenate([[0.0], curve])) / np.diff(np.concatenate([[0.0], edges]))
        springs = slopes - np.append(slopes[1:], 0.0)
        shares = springs * edges / (springs * edges).sum()
        for k in range(ELEMENTS):
            name = f"slider_{number}_{k}"
            body = ET.SubElement(world, "body", name=name, pos="0 0 -5")
            ET.SubElement(body, "inertial", mass="0.001", pos="0 0 0", diaginertia="1e-6 1e-6 1e-6")
            spring = springs[k] / springs.sum() * stiffness
            rotor = 4e-8 * spring + 1e-7
            slider = ET.SubElement(body, "joint", name=name, type="hinge", axis="0 0 1", armature=repr(float(rotor)))
            slider.attrib.update(frictionloss=repr(float(shares[k] * joint.coulomb)), **FRICTION)
            # The damper is parallel to the spring: a sliding slider must not be viscous.
            fixed = ET.SubElement(tendons, "fixed", name=name, stiffness=repr(float(spring)), springlength="0")
            fixed.set("damping", repr(float(1e-4 * spring)))
            ET.SubElement(fixed, "joint", joint=joint.name, coef="1")
            ET.SubElement(fixed, "joint", joint=name, coef="-1")


def _shafts(plan: Plan, tendons: ET.Element) -> None:
    for number, shaft in enumerate(plan.body.shafts):
        fixed = ET.SubElement(tendons, "fixed", name=f"shaft_{number}", armature=repr(float(shaft.inertia)))
        fixed.attrib.update(damping=repr(float(shaft.viscous)), frictionloss=repr(float(shaft.coulomb)), **FRICTION)
        for joint, factor in ((shaft.joint, 1.0), (shaft.other, shaft.sign)):
            ET.SubElement(fixed, "joint", joint=plan.arm.joints[joint].name, coef=repr(float(factor)))


def _walls(plan: Plan, tendons: ET.Element) -> None:
    """Limits the distance between journal and centre of the bearing to the clearance."""
    for number, clearance in plan.body.clearance.items():
        wall = ET.SubElement(tendons, "spatial", name=f"wall_{number}", limited="true", range=text([0.0, clearance]))
        wall.attrib.update(WALL)
        for site in (f"bearing_{number}", f"journal_{number}"):
            ET.SubElement(wall, "site", site=site)


def _rope(plan: Plan, world: ET.Element, tendons: ET.Element) -> None:
    if plan.body.rope is None:
        return
    stiffness, length, place = plan.body.rope
    ET.SubElement(world, "site", name="hook", pos=text(place))
    rope = ET.SubElement(tendons, "spatial", name="rope", stiffness=repr(float(stiffness)), springlength=text([0.0, length]))
    for site in ("hook", "tool"):
        ET.SubElement(rope, "site", site=site)

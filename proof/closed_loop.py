"""Generates open cases from Freeplay's own plant: an arm under feedback, with Coulomb friction at one joint that the given model lacks.

    python proof/closed_loop.py --urdf ur5_robot.urdf --cases 200 --seed 7 --out DIR
    python proof/peers/measure.py --program freeplay DIR

Each case draws the joint, its friction (1 to 10 N·m), the share of the time at which the joints rest (0 to 50 %), the natural frequency of the feedback (10
to 50 rad/s), the noise (three levels) and the presence of a tool tracker. The masses of the arm are within 2 % of the given model. The folders have the
form of `proof/mujoco`: DIR/0001/{model.toml,arm.urdf,recording.csv,truth.json}, … Under soft feedback much friction holds a light wrist: the plant stops
an arm that cannot follow the motion, or the joint rests for more than half of the time. Such a case is drawn again, and the last line of the output counts
these draws.
"""

from __future__ import annotations

import argparse
import csv
import json
import random
import re
import subprocess
import tempfile
from bisect import bisect_right
from collections.abc import Callable
from pathlib import Path

RATE_HZ = 250
SECONDS = 16.0
MASS_TOLERANCE = 0.02
FRICTION_NM = (1.0, 10.0)
NATURAL_FREQUENCIES = (10.0, 50.0)
NOISES = {"low": (1e-6, 0.02), "medium": (1e-5, 0.1), "high": (5e-5, 0.5)}
"""Noise of positions, rad, and of torques, N·m; ten times that of a position per second for velocities."""
TOOL_NOISE_M = 3e-5
FARTHEST_RAD = 0.6
MOST_REST = 0.5
LOOK_SAMPLES, RESTING_RAD = 100, 1e-3
"""A joint rests if it moves less than that in so many samples."""
STOPPED = 1
"""Exit code of a run in which the plant stopped the arm."""

Position = Callable[[float], float]


def log_uniform(rng: random.Random, bounds: tuple[float, float]) -> float:
    """A number with a uniformly distributed logarithm."""
    low, high = bounds
    return float(low * (high / low) ** rng.random())


def moves(rng: random.Random, start: float, rest: float) -> Position:
    """Position of a joint over time, rad: moves of minimal jerk about `start`, and rests for the share `rest` of the time."""
    times, places = [0.0], [start]
    while times[-1] < SECONDS:
        last, move = places[-1], rng.uniform(0.8, 2.0)
        pause = move * rest / (1 - rest) * rng.uniform(0.5, 1.5)
        times += [times[-1] + pause, times[-1] + pause + move]
        places += [last, start + rng.uniform(-FARTHEST_RAD, FARTHEST_RAD)]

    def at(t: float) -> float:
        k = bisect_right(times, t) - 1
        share = (t - times[k]) / (times[k + 1] - times[k]) if times[k + 1] > times[k] else 1.0
        return places[k] + (places[k + 1] - places[k]) * share**3 * (10 - 15 * share + 6 * share**2)

    return at


def machine(rng: random.Random, urdf: str) -> str:
    """`urdf` with masses within their tolerance; each inertia grows with its mass."""

    def other(inertial: re.Match[str]) -> str:
        scale = 1 + MASS_TOLERANCE * rng.uniform(-1, 1)
        return re.sub(r'(<mass value|\bi[xyz][xyz])="([^"]+)"', lambda number: f'{number[1]}="{float(number[2]) * scale:.12g}"', inertial[0])

    return re.sub(r"<inertial>.*?</inertial>", other, urdf, flags=re.DOTALL)


def generate(program: str, urdf: str, joints: list[str], case: Path, seed: str) -> bool:
    """Writes one case; false if the plant stopped the arm, or if friction held the joint for more than half of the time."""
    rng = random.Random(seed)
    joint, torque = rng.choice(joints), log_uniform(rng, FRICTION_NM)
    rest, frequency, noise = rng.uniform(0.0, 0.5), log_uniform(rng, NATURAL_FREQUENCIES), rng.choice(list(NOISES))
    tracked = rng.random() < 0.5
    position, of_torque = NOISES[noise]
    case.mkdir(parents=True, exist_ok=True)
    (case / "arm.urdf").write_text(urdf)
    (case / "model.toml").write_text('urdf = "arm.urdf"\n')
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        (work / "machine.urdf").write_text(machine(rng, urdf))
        (work / "machine.toml").write_text(f'urdf = "machine.urdf"\n[[effect]]\nkind = "coulomb_friction"\njoint = "{joint}"\ncoulomb = {torque}\n')
        of_joint = [moves(rng, rng.uniform(-1.2, 1.2), rest) for _ in joints]
        with (work / "path.csv").open("w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(["t", *(f"q{k + 1}" for k in range(len(joints)))])
            rows.writerows([k / RATE_HZ, *(at(k / RATE_HZ) for at in of_joint)] for k in range(int(SECONDS * RATE_HZ)))
        (work / "scenario.toml").write_text(
            f'model = "machine.toml"\ncontrollers = ["computed-torque"]\nrecording = "csv"\n'
            f'path = {{ kind = "file", file = "path.csv" }}\n'
            f"controller = {{ model = '{case.resolve() / 'arm.urdf'}', gains = {{ natural_frequency = {frequency} }} }}\n"
            f"[sensors]\ntrack_tool = {str(tracked).lower()}\nposition = {{ noise = {position} }}\nvelocity = {{ noise = {10 * position} }}\n"
            f"torque = {{ noise = {of_torque} }}\ntool = {{ noise = {TOOL_NOISE_M} }}\n"
        )
        command = [program, "run", "-q", "scenario.toml", "--out", "run", "--seed", str(rng.randrange(2**31))]
        done = subprocess.run(command, cwd=work, check=False, stdout=subprocess.DEVNULL)
        if done.returncode == STOPPED:
            return False
        done.check_returncode()
        with (work / "run" / "computed-torque.csv").open(newline="") as recorded:
            samples = list(csv.DictReader(recorded))
        places = [float(sample[f"q{joints.index(joint) + 1}"]) for sample in samples[::LOOK_SAMPLES]]
        at_rest = sum(abs(later - earlier) < RESTING_RAD for earlier, later in zip(places, places[1:], strict=False))
        if at_rest > MOST_REST * (len(places) - 1):
            return False
        wanted = [name for name in samples[0] if re.fullmatch(r"t|(q|qd|tau)\d+" + ("|[xyz]" if tracked else ""), name)]
        with (case / "recording.csv").open("w", newline="") as kept:
            writer = csv.DictWriter(kept, wanted, extrasaction="ignore")
            writer.writeheader()
            writer.writerows(samples)
    effect = {"kind": "coulomb_friction", "joint": joint, "parameters": {"coulomb": torque}, "signal_to_floor": torque / of_torque}
    truth = {"machine": "closed loop", "joints": len(joints), "noise": noise, "rest": rest, "natural_frequency": frequency, "tracked": tracked, "effects": [effect]}
    (case / "truth.json").write_text(json.dumps(truth, indent=2) + "\n")
    return True


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="freeplay")
    parser.add_argument("--urdf", type=Path, required=True)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    read = subprocess.run([options.program, "arm", str(options.urdf), "--format", "json"], check=True, capture_output=True, text=True)
    joints = [joint["name"] for joint in json.loads(read.stdout)["joints"]]
    urdf, again = options.urdf.read_text(), 0
    for number in range(1, options.cases + 1):
        attempt = 0
        while not generate(options.program, urdf, joints, options.out / f"{number:04}", f"{options.seed}/{number}/{attempt}"):
            attempt, again = attempt + 1, again + 1
    print(f"{options.cases} cases in {options.out}; {again} draws were repeated")


if __name__ == "__main__":
    main()

"""Generates recordings of machines with concealed physics in MuJoCo.

`python proof/mujoco --out DIR --cases 40 --seed 7` generates open cases: numbered folders with `model.toml`, `arm.urdf`, recordings and `truth.json`.
Without options the program reads an order from standard input, as `freeplay blind --generator mujoco` writes it.
"""

from __future__ import annotations

import argparse
import sys


def options() -> argparse.Namespace:
    """Parses the command line."""
    parser = argparse.ArgumentParser(prog="python proof/mujoco", description="Recordings of machines with concealed physics, made in MuJoCo.")
    parser.add_argument("--out", help="folder for open cases; without it the program reads an order from standard input")
    parser.add_argument("--cases", type=int, default=40, help="number of cases, with the shares of a small set (40)")
    parser.add_argument("--seed", type=int, default=1, help="seed of all random numbers (1)")
    parser.add_argument("--single", type=int, help="number of cases with one effect; this option and the next three replace --cases")
    parser.add_argument("--negative", type=int, help="number of cases without an effect")
    parser.add_argument("--unknown", type=int, help="number of cases with physics outside the catalogue")
    parser.add_argument("--double", type=int, help="number of cases with two effects")
    parser.add_argument("--kind", action="append", help="use only this kind for single effects; may be repeated")
    parser.add_argument("--family", choices=["catalogue", "friction", "pushes", "setup", "servos"], default="catalogue", help="family of cases")
    parser.add_argument("--jobs", type=int, default=1, help="number of processes that run at a time (1)")
    return parser.parse_args()


def main() -> int:
    """Runs the command line. Returns the exit code: 0 done, 2 usage, 3 bad input, 5 without MuJoCo."""
    asked = options()
    try:
        import mujoco  # noqa: F401
    except ImportError as error:
        print(f"{sys.executable} has no package {error.name}: pip install mujoco, or set FREEPLAY_PYTHON to a Python that has it", file=sys.stderr)
        return 5
    import orders

    return orders.answer(sys.stdin, sys.stdout) if asked.out is None else orders.open_cases(asked)


if __name__ == "__main__":
    sys.exit(main())

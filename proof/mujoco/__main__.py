"""Makes recordings of machines with concealed physics in MuJoCo.

`python proof/mujoco --out DIR --cases 40 --seed 7` makes open cases: numbered folders with `model.toml`, `arm.urdf`, recordings and `truth.json`.
Without options it answers an order on standard input, as `freeplay blind --generator mujoco` gives it.
"""

from __future__ import annotations

import argparse
import sys


def options() -> argparse.Namespace:
    """What the command line asks for."""
    parser = argparse.ArgumentParser(prog="python proof/mujoco", description="Recordings of machines with concealed physics, made in MuJoCo.")
    parser.add_argument("--out", help="folder of open cases; without it an order is read from standard input")
    parser.add_argument("--cases", type=int, default=40, help="cases in the shares of a small set (40)")
    parser.add_argument("--seed", type=int, default=1, help="everything is drawn from it (1)")
    parser.add_argument("--single", type=int, help="cases with one effect; with any of these four --cases is not used")
    parser.add_argument("--negative", type=int, help="cases without an effect")
    parser.add_argument("--unknown", type=int, help="cases outside the catalogue")
    parser.add_argument("--double", type=int, help="cases with two effects")
    parser.add_argument("--kind", action="append", help="single effects of this kind only; may be given several times")
    parser.add_argument("--family", choices=["catalogue", "friction", "pushes", "setup", "servos"], default="catalogue", help="which family of cases")
    parser.add_argument("--jobs", type=int, default=1, help="processes (1)")
    return parser.parse_args()


def main() -> int:
    """0 done, 2 usage, 3 bad input, 5 without MuJoCo."""
    asked = options()
    try:
        import mujoco  # noqa: F401
    except ImportError as error:
        print(f"{sys.executable} has no package {error.name}; pip install mujoco, or let FREEPLAY_PYTHON name a Python that has it", file=sys.stderr)
        return 5
    import orders

    return orders.answer(sys.stdin, sys.stdout) if asked.out is None else orders.open_cases(asked)


if __name__ == "__main__":
    sys.exit(main())

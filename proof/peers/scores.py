"""Scores an answer of `freeplay diagnose --format json` for an open case, by the rules of `freeplay blind`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

Json = dict[str, Any]
Place = tuple[str, str | None]


@dataclass(frozen=True)
class Judged:
    """Score of an answer."""

    group: str
    """The kinds of the concealed effects."""
    outcome: str
    """`right`, `partly`, `extra`, `wrong`, `refused`, `missed` or `failed`."""
    said: str
    covered: tuple[bool, ...]
    """Whether each interval of a rightly named parameter holds the truth."""


def places(effects: list[Json]) -> list[Place]:
    """The kind and joint of each effect."""
    return [(effect["kind"], effect["joint"]) for effect in effects]


def said_by(concealed: Json, named: list[Place]) -> list[int]:
    """The named effects that mean the concealed one: its own name, or that of an equivalent."""
    own = (concealed["kind"], concealed["joint"])
    if own in named:
        return [named.index(own)]
    for other in concealed.get("equivalents", []):
        wanted = [(kind, other["joint"]) for kind in other["kinds"]]
        if all(place in named for place in wanted):
            return [named.index(place) for place in wanted]
    return []


def sort_of(truth: Json) -> str:
    """Sort of a case: `negative`, `single`, `double`, `outside` or `setup`."""
    if truth.get("setup"):
        return "setup"
    effects = truth["effects"]
    if any(not effect.get("catalogued", True) for effect in effects):
        return "outside"
    return ("negative", "single", "double")[min(len(effects), 2)]


def group_of(truth: Json) -> str:
    """The kinds of the concealed effects."""
    if truth.get("setup"):
        return str(truth["setup"][0]["kind"])
    return " + ".join(effect["kind"] for effect in truth["effects"]) or "nothing"


def words(answer: Json) -> str:
    """Short text of the answer."""
    found = [f"{kind}{'' if joint is None else ' of ' + joint}" for kind, joint in places(answer.get("effects", []))]
    found += [f"{it['kind']}{'' if it.get('joint') is None else ' of ' + it['joint']}" for it in answer.get("setup", [])]
    return f"{answer.get('verdict', 'failed')}: {', '.join(found)}".removesuffix(": ")


def judge(truth: Json, answer: Json) -> Judged:
    """Scores `answer` against `truth`."""
    outcome = _setup(truth, answer) if truth.get("setup") else _outcome(truth, answer)
    covered = tuple(_covered(truth, answer)) if outcome == "right" else ()
    return Judged(group_of(truth), outcome, words(answer), covered)


def _outcome(truth: Json, answer: Json) -> str:
    verdict, sort = answer.get("verdict"), sort_of(truth)
    silent = verdict in ("nothing_missing", "insufficient_data")
    if verdict not in ("nothing_missing", "insufficient_data", "unknown", "one_of", "named", "setup"):
        return "failed"
    if sort == "negative":
        return "right" if verdict == "nothing_missing" else "refused" if silent else "wrong"
    if silent:
        return "missed"
    if verdict == "unknown":
        return "right" if sort == "outside" else "refused"
    if sort == "outside" or verdict == "setup":
        return "wrong"
    return _named(truth, answer) if verdict == "named" else _one_of(truth, answer)


def _named(truth: Json, answer: Json) -> str:
    named = places(answer["effects"])
    by = [said_by(concealed, named) for concealed in truth["effects"]]
    found = sum(1 for places_of in by if places_of)
    idle = len(set(range(len(named))) - {place for places_of in by for place in places_of})
    if found == len(by):
        return "extra" if idle else "right"
    return "partly" if found and not idle else "wrong"


def _one_of(truth: Json, answer: Json) -> str:
    rivals = places([other for other in answer.get("alternatives", []) if other.get("indistinguishable")])
    if rivals and _named(truth, answer) == "right" and all(any(said_by(it, [rival]) for it in truth["effects"]) for rival in rivals):
        return "right"
    possible = places(answer["effects"]) + rivals
    among = all(said_by(concealed, possible) for concealed in truth["effects"])
    return "refused" if among and len(answer["effects"]) <= len(truth["effects"]) else "wrong"


def _setup(truth: Json, answer: Json) -> str:
    """Right means: the answer has the kind and joints of every fault, no other fault, and no false effect."""
    kinds = {(fault["kind"]): fault for fault in truth["setup"]}
    found = answer.get("setup", [])
    if answer.get("verdict") == "failed":
        # The program rejects times in another unit, with the remedy.
        return "right" if "time_unit" in kinds and "column t" in answer.get("why", "") else "failed"
    # A data sheet without friction lacks it with any set-up.
    known = () if truth.get("friction", True) else ("coulomb_friction", "viscous_friction", "stribeck_friction", "asymmetric_friction")
    invented = [kind for kind, _ in places(answer.get("effects", [])) if kind not in known]
    if not found:
        return "wrong" if invented else "missed"
    right = all(
        it["kind"] in kinds and (it.get("joint") is None or not kinds[it["kind"]]["joints"] or it["joint"] in kinds[it["kind"]]["joints"])
        for it in found
    )
    if not right:
        return "wrong"
    return "extra" if invented else "right"


def _covered(truth: Json, answer: Json) -> list[bool]:
    """Whether the intervals of numeric parameters contain the true values. Excludes cyclic angles and weak parameters."""
    held = []
    for concealed in truth["effects"]:
        for effect in answer["effects"]:
            if (effect["kind"], effect["joint"]) != (concealed["kind"], concealed["joint"]):
                continue
            for name, estimate in effect["parameters"].items():
                true, interval = concealed["parameters"].get(name), estimate.get("ci95")
                if isinstance(true, float) and interval and name != "phase" and name not in concealed.get("weak", []):
                    held.append(interval[0] <= true <= interval[1])
    return held


def pushes(truth: Json, answer: Json) -> tuple[int, int, int]:
    """The numbers of found pushes, all pushes and false pushes. A found push has the right joint (or the tool), a time within 50 ms and an impulse within a quarter."""
    named = [effect for effect in answer.get("effects", []) if effect["kind"] in ("external_torque", "external_force")]
    used: set[int] = set()
    for concealed in truth["effects"]:
        for place, effect in enumerate(named):
            if place not in used and _is_push(concealed, effect):
                used.add(place)
                break
    return len(used), len(truth["effects"]), len(named) - len(used)


def _is_push(concealed: Json, effect: Json) -> bool:
    if (effect["kind"], effect["joint"]) != (concealed["kind"], concealed["joint"]):
        return False
    true, found = concealed["parameters"], {name: it["value"] for name, it in effect["parameters"].items()}
    near = all(abs(true[name] - found.get(name, 1e9)) <= 0.05 for name in ("start", "end"))
    return near and abs(_impulse(found) / _impulse(true) - 1) <= 0.25


def _impulse(parameters: Json) -> float:
    force: Any = parameters["torque"] if "torque" in parameters else parameters["force"]
    size = sum(x * x for x in force) ** 0.5 if isinstance(force, list) else abs(force)
    return float(size * (parameters["end"] - parameters["start"]))

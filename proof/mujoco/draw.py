"""Draws the cases of a set from one seed, with evenly distributed kinds, severities and levels of noise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from arms import Rng
from cases import CATALOGUE, OUTSIDE, SEVERITIES, Ask
from sensors import LEVELS


@dataclass(frozen=True)
class Quota:
    """Number of cases of each sort."""

    single: int = 0
    negative: int = 0
    unknown: int = 0
    double: int = 0

    @staticmethod
    def small(cases: int) -> Quota:
        """Quota of a small set: of ten cases five with one effect, two without effects, two outside the catalogue, one with two effects."""
        negative, unknown, double = cases // 5, cases // 5, cases // 10
        return Quota(cases - negative - unknown - double, negative, unknown, double)


def deck(kinds: tuple[str, ...], rng: Rng) -> Iterator[tuple[str, str, str]]:
    """A sequence of kinds in rounds that contain every kind once. Severities and levels of noise change from round to round."""
    cells = [(severity, noise) for severity in SEVERITIES for noise in LEVELS]
    shifts = rng.integers(len(cells), size=len(kinds))
    offset = 0
    while True:
        for place in rng.permutation(len(kinds)):
            severity, noise = cells[(offset + shifts[place]) % len(cells)]
            yield kinds[place], severity, noise
        # A step that is coprime to nine reaches every cell.
        offset += 4


def draw(quota: Quota, seed: int, kinds: tuple[str, ...] = CATALOGUE) -> list[Ask]:
    """The cases of `quota` in random order. Single effects have kinds from `kinds`."""
    rng = np.random.default_rng(seed)
    asks = []

    def add(sort: str, cards: list[tuple[str, str, str]], noise: str) -> None:
        named = tuple(card[0] for card in cards), tuple(card[1] for card in cards)
        asks.append(Ask(sort, *named, noise, int(rng.integers(2**62))))

    known, outside = deck(kinds, rng), deck(OUTSIDE, rng)
    for _ in range(quota.single):
        card = next(known)
        add("single", [card], card[2])
    for _ in range(quota.negative):
        add("negative", [], str(rng.choice(list(LEVELS))))
    for _ in range(quota.unknown):
        card = next(outside)
        add("unknown", [card], card[2])
    firsts, seconds = deck(CATALOGUE, rng), deck(CATALOGUE, rng)
    for _ in range(quota.double):
        card = next(firsts)
        other = next(it for it in seconds if it[0] != card[0])
        add("double", [card, other], card[2])
    return [asks[place] for place in rng.permutation(len(asks))]

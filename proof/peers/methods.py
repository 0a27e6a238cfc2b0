"""Other methods for the same cases. Each method returns names, and predicted torques for the held-out part."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import columns
import numpy as np
from columns import BEYOND, Name
from signals import Case, Matrix, Signals

SIGNIFICANT = 10.8
"""Least F of a term, with effective rows: one in a thousand by chance."""
RIDGE = 0.02
"""Of sparse regression, as a share of the rows: columns of unit size that are nearly alike share their coefficient."""
MOST = 6
"""Groups that least squares may name."""
SEED = 7
"""Of symbolic regression."""


@dataclass(frozen=True)
class Result:
    """Result of a method on a case."""

    named: frozenset[Name]
    predict: Callable[[Signals], Matrix]


def _effective(wrong: Matrix) -> float:
    """Effective number of independent rows in a correlated residual."""
    wrong = wrong - wrong.mean()
    size, total = float(wrong @ wrong), 0.0
    if size == 0.0:
        return 1.0
    for lag in range(1, min(200, len(wrong) // 4)):
        rho = float(wrong[:-lag] @ wrong[lag:]) / size
        if rho < 0.05:
            break
        total += rho
    return len(wrong) / (1 + 2 * total)


def _fit(table: Matrix, wanted: Matrix) -> Matrix:
    """Least squares with scaled columns. Directions that the data do not determine stay at zero."""
    size = np.sqrt((table**2).mean(axis=0)) + 1e-12
    return np.linalg.lstsq(table / size, wanted, rcond=1e-5)[0] / size


def least_squares(case: Case) -> Result:
    """Fits the inertial parameters of all links, and Coulomb, viscous, offset and rotor of each joint, by least squares.

    Names: forward selection of groups by an F test with effective rows. The last link's group means a payload, that of another link its mass.
    """
    n, y = case.sheet.dof, case.train.tau - case.nominal(case.train)

    def blocks(signals: Signals) -> dict[Name, Matrix]:
        found: dict[Name, Matrix] = {}
        for joint in range(n):
            name = case.sheet.joints[joint].name
            for kind, column in columns.friction(signals, joint).items():
                found[kind, name] = np.eye(n)[joint][None, :, None] * column[:, None, None]
            group = ("payload", None) if joint + 1 == n else ("link_mass", name)
            found[group] = columns.inertial(case.sheet, signals, joint)
        return found

    mask, found = case.train.moving, blocks(case.train)
    owner = np.nonzero(mask)[1]
    train = {name: np.broadcast_to(block, (*mask.shape, block.shape[2]))[mask] for name, block in found.items()}
    target = y[mask]
    # The residuals of the full model weight the channels.
    scale = _by_channel(target, owner, n)
    for _ in range(2):
        beta = _fit(np.hstack(list(train.values())) / scale[owner, None], target / scale[owner])
        scale = _by_channel(target - np.hstack(list(train.values())) @ beta, owner, n)
    named = _forward(case, {name: table / scale[owner, None] for name, table in train.items()}, target / scale[owner], owner)

    def predict(signals: Signals) -> Matrix:
        table = np.concatenate(list(blocks(signals).values()), axis=2)
        return case.nominal(signals) + table @ beta

    return Result(frozenset(named), predict)


def _by_channel(values: Matrix, owner: Matrix, n: int) -> Matrix:
    """Root mean square of the values, by joint."""
    return np.array([np.sqrt(np.mean(values[owner == joint] ** 2)) if (owner == joint).any() else 1.0 for joint in range(n)]) + 1e-12


def _forward(case: Case, train: dict[Name, Matrix], target: Matrix, owner: Matrix) -> set[Name]:
    """Adds the group that explains most until none is significant. Returns the added groups beyond the tolerances.

    The autocorrelation of the full model's residual reduces the number of rows.
    """
    table = np.hstack(list(train.values()))
    size = np.sqrt((table**2).mean(axis=0)) + 1e-12
    gram, right = (table / size).T @ (table / size), (table / size).T @ target
    share = _effective(target - table @ _fit(table, target)) / len(target)
    ends = np.cumsum([columns_of.shape[1] for columns_of in train.values()])
    places = {name: np.arange(end - train[name].shape[1], end) for name, end in zip(train, ends, strict=True)}

    def left(names: list[Name]) -> float:
        some = np.concatenate([places[name] for name in names])
        return float(target @ target - right[some] @ np.linalg.lstsq(gram[np.ix_(some, some)], right[some], rcond=1e-10)[0])

    chosen: list[Name] = []
    before = float(target @ target)
    while len(chosen) < MOST:
        after = {name: left([*chosen, name]) for name in train if name not in chosen}
        rows = share * len(target)
        worth = {name: (before - rest) / len(places[name]) / rest * rows for name, rest in after.items()}
        best = max(worth, key=lambda name: worth[name])
        if worth[best] < SIGNIFICANT:
            break
        chosen.append(best)
        before = after[best]
    return _beyond(case, {name: train[name] for name in chosen}, target, owner)


def _beyond(case: Case, chosen: dict[Name, Matrix], target: Matrix, owner: Matrix) -> set[Name]:
    """The groups whose traces exceed, in some channel, both the residual and the effect of the tolerances."""
    if not chosen:
        return set()
    n, table = case.sheet.dof, np.hstack(list(chosen.values()))
    beta, named, start = _fit(table, target), set(), 0
    floor = _by_channel(target - table @ beta, owner, n)
    whole = _by_channel((case.train.tau - case.nominal(case.train))[case.train.moving], owner, n)
    unit = whole / _by_channel(target, owner, n)
    for name, columns_of in chosen.items():
        size = _by_channel(columns_of @ beta[start : start + columns_of.shape[1]], owner, n)
        start += columns_of.shape[1]
        least = np.array([BEYOND * columns.tolerated(case, joint, name[0]) for joint in range(n)]) / unit
        if (size > np.maximum(floor, least)).any():
            named.add(name)
    return named


def sindy(case: Case) -> Result:
    """PySINDy's sequentially thresholded least squares on a library of terms, joint by joint. The last third of the training data selects the threshold.

    Names: the kinds of the remaining terms beyond the tolerances. Delays at most joints are one common delay.
    """
    from pysindy.optimizers import STLSQ

    fits: list[tuple[list[tuple[str, str]], Matrix]] = []
    named: set[Name] = set()
    for joint in range(case.sheet.dof):
        rows = case.train.moving[:, joint]
        terms = columns.library(case, case.train, joint)
        table = np.array(list(terms.values())).T[rows]
        y = (case.train.tau - case.nominal(case.train))[rows, joint]
        if len(y) < 100:
            fits.append((list(terms), np.zeros(len(terms))))
            continue
        size = np.sqrt((table**2).mean(axis=0)) + 1e-12
        cut = 2 * len(y) // 3
        best = (np.inf, 0.0)
        for share in (0.1, 0.2, 0.4, 0.8):
            beta = _stlsq(STLSQ, table[:cut] / size, y[:cut], share)
            best = min(best, (float(np.mean((y[cut:] - table[cut:] / size @ beta) ** 2)), share))
        beta = _stlsq(STLSQ, table / size, y, best[1])
        floor = float(np.sqrt(np.mean((y - table / size @ beta) ** 2)))
        for (kind, _), height in zip(terms, beta, strict=True):
            if abs(height) > max(floor, BEYOND * columns.tolerated(case, joint, kind)) and kind != "unnamed":
                named.add((kind, case.sheet.joints[joint].name))
        fits.append((list(terms), beta / size))
    named = _whole(named, case)

    def predict(signals: Signals) -> Matrix:
        extra = [np.array(list(columns.library(case, signals, joint).values())).T @ beta for joint, (_, beta) in enumerate(fits)]
        return case.nominal(signals) + np.array(extra).T

    return Result(frozenset(named), predict)


def _stlsq(optimizer: type, table: Matrix, y: Matrix, share: float) -> Matrix:
    """Coefficients of scaled columns. Those below a share of the torque's size become zero."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fitted = optimizer(threshold=share * float(np.sqrt(np.mean(y**2))) + 1e-12, alpha=RIDGE * len(y)).fit(table, y[:, None])
    return np.nan_to_num(np.asarray(fitted.coef_).ravel())


def _whole(named: set[Name], case: Case) -> set[Name]:
    """Delayed torques at most joints mean one common delay; at a single joint they mean a filter of its sensor."""
    late = {name for name in named if name[0] == "time_delay"}
    rest = named - late
    if len(late) > case.sheet.dof / 2:
        return rest | {("time_delay", None)}
    return rest | {("sensor_lowpass", joint) for _, joint in late}


def symbolic(case: Case) -> Result:
    """Symbolic regression (gplearn) of the data sheet's residual, at the two joints with the largest one.

    Names: the library term to which the formula is nearly proportional (R² of 0.9), if it exceeds the tolerances.
    """
    from gplearn.genetic import SymbolicRegressor

    y = case.train.tau - case.nominal(case.train)
    share = [_share_left(case, y, joint) for joint in range(case.sheet.dof)]
    programs: dict[int, tuple[object, float]] = {}
    named: set[Name] = set()
    for joint in np.argsort(share)[::-1][:2]:
        if share[joint] == 0.0:
            continue
        rows = np.flatnonzero(case.train.moving[:, joint])
        rows = rows[:: max(len(rows) // 500, 1)]
        size = float(np.std(y[rows, joint]) + np.abs(y[rows, joint].mean()))
        program = SymbolicRegressor(
            population_size=400, generations=12, function_set=("add", "sub", "mul", "sin", "abs"), parsimony_coefficient=0.003, random_state=SEED
        )
        program.fit(_features(case, case.train, joint)[rows], y[rows, joint] / size)
        programs[int(joint)] = (program, size)
        found = _called(case, int(joint), size * program.predict(_features(case, case.train, joint)))
        if found is not None:
            named.add(found)

    def predict(signals: Signals) -> Matrix:
        out = case.nominal(signals)
        for joint, (program, size) in programs.items():
            out[:, joint] += size * np.nan_to_num(program.predict(_features(case, signals, joint)))  # type: ignore[attr-defined]
        return out

    return Result(frozenset(_whole(named, case)), predict)


def _share_left(case: Case, y: Matrix, joint: int) -> float:
    """Mean square of the data sheet's residual at a joint, relative to that of its torque. Zero if the joint hardly moves."""
    rows = case.train.moving[:, joint]
    if rows.sum() <= 100:
        return 0.0
    return float(np.mean(y[rows, joint] ** 2) / (np.mean(case.train.tau[:, joint] ** 2) + 1e-12))


def _features(case: Case, signals: Signals, joint: int) -> Matrix:
    """Position, speed, sign of the speed, acceleration and load, scaled to unit size on the training data."""

    def of(part: Signals) -> Matrix:
        return np.array([part.q[:, joint], part.v[:, joint], part.turn[:, joint], part.a[:, joint], part.rigid[:, joint]]).T

    return of(signals) / (np.sqrt((of(case.train) ** 2).mean(axis=0)) + 1e-12)


def _called(case: Case, joint: int, formula: Matrix) -> Name | None:
    rows = case.train.moving[:, joint]
    best: tuple[float, Name | None] = (0.9, None)
    for (kind, _), column in columns.library(case, case.train, joint).items():
        both = np.array([column[rows], formula[rows]])
        size = np.sqrt((both**2).mean(axis=1))
        explained = float((both[0] @ both[1] / len(both[0])) ** 2 / (size[0] * size[1] + 1e-12) ** 2)
        if explained > best[0] and size[1] > BEYOND * columns.tolerated(case, joint, kind) and kind != "unnamed":
            best = (explained, (kind, case.sheet.joints[joint].name))
    return best[1]

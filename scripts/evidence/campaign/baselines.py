# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""STLSQ and ensemble SINDy (PySINDy) on the same records, with the force laws of the same catalogue.

The acceleration comes from a Savitzky-Golay filter; samples whose window may hold an impact are left
out. The terms of the base machine are projected out of the acceleration and of every other term, so that
none of them is ever missing. Each column has length 1; of a path of thresholds the one with the smallest
BIC is taken. The name is the largest term that is left.
"""

import tomllib
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pysindy
from scipy.signal import savgol_filter

ORDER = 4
WINDOWS_PER_PERIOD = 10
"""Length of the filter: a tenth of a drive period, at least 7 samples."""
NEAR_BARRIER = 0.03
"""Share of the extent of the motion within which the body may be in impact."""
STRIBECK_VELOCITY = 0.15
THRESHOLDS = tuple(np.geomspace(0.005, 0.5, 14))
MODELS = 40
INCLUSION = 0.6


@dataclass
class Terms:
    """Acceleration, and the columns of base and effects; `names` are those of the catalogue."""

    acceleration: np.ndarray
    base: np.ndarray
    effects: np.ndarray
    names: list[str]


def read(path: Path) -> tuple[dict[str, float], dict[str, np.ndarray]]:
    """Header and columns of a record."""
    lines = path.read_text().splitlines()
    head = [line[1:].split(":", 1) for line in lines if line.startswith("#")]
    header = {key.strip(): float(value) for key, value in head if key.strip() != "units"}
    names = lines[len(head)].split(",")
    table = np.array([[float(word) for word in line.split(",")] for line in lines[len(head) + 1 :]])
    return header, dict(zip(names, table.T, strict=True))


def terms(base: dict, records: list[Path]) -> Terms:
    """The regression problem of all records."""
    parts = [_terms_of(base, *read(path)) for path in records]
    names = parts[0][3]
    return Terms(*(np.concatenate([part[i] for part in parts]) for i in range(3)), names)


def _terms_of(base: dict, header: dict, columns: dict) -> tuple:
    step = float(np.median(np.diff(columns["t"])))
    frequency = header["drive_ratio"] * np.sqrt(base["restoring"]["stiffness"] / base["body"]["mass"])
    window = max(7, 2 * int(np.pi / frequency / step / WINDOWS_PER_PERIOD) + 1)
    x, v, a = (savgol_filter(columns["x"], window, ORDER, deriv=n, delta=step) for n in range(3))
    if "v" in columns:
        v, a = (savgol_filter(columns["v"], window, ORDER, deriv=n, delta=step) for n in range(2))
    phi = columns.get("phi", header.get("phase", 0.0) + frequency * columns["t"])
    drive = base["drive"]
    waves = [np.exp(1j * n * (phi + drive["angle"])) for n in range(1, 4)]
    pairs = list(zip(drive["cosine"], drive["sine"], waves, strict=True))
    foot = sum(c * wave.real + s * wave.imag for c, s, wave in pairs)
    rate = sum(n * (s * wave.real - c * wave.imag) for n, (c, s, wave) in enumerate(pairs, 1))
    extension = base["restoring"]["free_length"] + drive["mean"] + foot - x
    sign, size = np.sign(v), np.abs(v)
    bases = [extension, foot, rate]
    found = {
        "quadratic_drag": [v * size],
        "stribeck": [sign * np.exp(-((v / STRIBECK_VELOCITY) ** 2))],
        "asymmetric_friction": [size],
        "position_dependent_friction": [x * sign],
        "cubic_spring": [extension**3],
        "offset_force": [np.ones_like(x)],
        "drive_ripple": [rate * np.sin(phi), rate * np.cos(phi)],
    }
    for name, column, laws in (
        ("coulomb", sign, ("coulomb", "coulomb_viscous")),
        ("viscous", v, ("viscous", "coulomb_viscous")),
    ):
        if base["friction"]["law"] in laws:
            bases.append(column)
        else:
            found[name] = [column]
    upper = base["contact"]["upper"]
    near = x > upper - NEAR_BARRIER * np.ptp(x)
    away = ~np.convolve(near, np.ones(window), "same").astype(bool)
    away[: window // 2] = away[len(away) - window // 2 :] = False
    names = [name for name, group in found.items() for _ in group]
    effects = np.stack([column for group in found.values() for column in group], axis=-1)
    # one base per record would be more than the model has: stiffness, scale and friction are shared
    return a[away], np.stack(bases, axis=-1)[away], effects[away], names


def projected(problem: Terms) -> tuple[np.ndarray, np.ndarray]:
    """Effects of length 1 and acceleration without what the base explains."""
    stiff = problem.base / np.linalg.norm(problem.base, axis=0)
    basis = np.linalg.qr(stiff)[0]
    known = problem.acceleration
    effects = problem.effects - basis @ (basis.T @ problem.effects)
    left = known - basis @ (basis.T @ known)
    length = np.linalg.norm(effects, axis=0)
    return effects / np.where(length > 0, length, 1), left / np.linalg.norm(left)


def _bic(effects: np.ndarray, left: np.ndarray, coefficients: np.ndarray) -> float:
    misfit = float(np.sum((left - effects @ coefficients) ** 2))
    return len(left) * np.log(misfit) + np.log(len(left)) * np.count_nonzero(coefficients)


def stlsq(problem: Terms) -> str:
    """Name of the largest term of the best model on the path of thresholds."""
    effects, left = projected(problem)
    best = (_bic(effects, left, np.zeros(effects.shape[1])), np.zeros(effects.shape[1]))
    for threshold in THRESHOLDS:
        coefficients = _fit(pysindy.STLSQ(threshold=threshold, alpha=1e-6), effects, left)
        best = min(best, (_bic(effects, left, coefficients), coefficients), key=lambda one: one[0])
    return _largest(problem, best[1])


def ensemble(problem: Terms, seed: int) -> str:
    """The same with bagging: terms that most of the models have."""
    effects, left = projected(problem)
    random = np.random.default_rng(seed)
    best = (np.inf, np.zeros(effects.shape[1]))
    for threshold in THRESHOLDS[::2]:
        fits = []
        for _ in range(MODELS):
            rows = random.integers(0, len(left), len(left))
            fits.append(_fit(pysindy.STLSQ(threshold=threshold, alpha=1e-6), effects[rows], left[rows]))
        kept = np.mean(np.array(fits) != 0, axis=0) >= INCLUSION
        coefficients = np.where(kept, np.median(fits, axis=0), 0.0)
        best = min(best, (_bic(effects, left, coefficients), coefficients), key=lambda one: one[0])
    return _largest(problem, best[1])


def _fit(optimizer: object, effects: np.ndarray, left: np.ndarray) -> np.ndarray:
    with warnings.catch_warnings():
        # it warns where no term is left
        warnings.simplefilter("ignore")
        return np.ravel(optimizer.fit(effects, left[:, None]).coef_)


def _largest(problem: Terms, coefficients: np.ndarray) -> str:
    if not np.any(coefficients):
        return "none"
    return problem.names[int(np.argmax(np.abs(coefficients)))]


def verdicts(base: Path, records: list[Path], seed: int) -> dict[str, str]:
    """What the baselines name."""
    problem = terms(tomllib.loads(base.read_text()), records)
    return {"STLSQ": stlsq(problem), "ensemble SINDy": ensemble(problem, seed)}

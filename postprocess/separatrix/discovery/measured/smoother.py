# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Position, velocity and acceleration from noisy positions, also through impacts.

A Kalman filter of a body with white jerk and the Rauch-Tung-Striebel smoother over it. At a detected impact
the velocity may jump: the process noise bursts between the two samples around it. The intensity of the jerk
maximises the likelihood of the record.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from separatrix.discovery.measured.signals import runs
from separatrix.discovery.policy import RECORDS


@dataclass
class Smoothed:
    """States (n, 3) of x, v, a with covariances (n, 3, 3), and the impacts."""

    t: np.ndarray
    state: np.ndarray
    covariance: np.ndarray
    # index of the last sample before each impact
    impacts: np.ndarray

    @property
    def v(self) -> np.ndarray:
        """Velocity [m/s]."""
        return self.state[:, 1]

    def nearest(self, t: np.ndarray) -> np.ndarray:
        """Indices of the states next to times `t` [s]."""
        after = np.clip(np.searchsorted(self.t, t), 1, self.t.size - 1)
        return after - (t - self.t[after - 1] < self.t[after] - t)

    def at(self, t: np.ndarray) -> np.ndarray:
        """Position and velocity at times `t` [s], (times, 2)."""
        near = self.nearest(t)
        ahead, (x, v, a) = t - self.t[near], self.state[near].T
        return np.column_stack([x + v * ahead + a * ahead**2 / 2, v + a * ahead])


def smooth(
    t: np.ndarray, x: np.ndarray, sigma: float, period_samples: float | None = None, every: int = 1
) -> Smoothed:
    """Smooth positions of noise `sigma` [m]; the drive period sets the window of detection.

    The jerk is tuned on one of `every` samples: it is indistinguishable from noise between neighbours of a
    record that is sampled far faster than it moves.
    """
    window = int(np.clip((period_samples or 100) / 14, 4, 12))
    impacts = detect_impacts(t, x, sigma, window)
    jerk = _tuned_jerk(t[::every], x[::every], sigma, impacts // every)
    state, covariance, _ = _filter_and_smooth(t, x, sigma, jerk, impacts)
    return Smoothed(t, state, covariance, impacts)


def detect_impacts(t: np.ndarray, x: np.ndarray, sigma: float, window: int) -> np.ndarray:
    """Indices of the samples just before the velocity reverses abruptly."""
    n = x.size
    if n < 4 * window:
        return np.zeros(0, int)
    dt = float(np.median(np.diff(t)))
    before, after, error = _one_sided_velocities(x, dt, sigma, window)
    jump = after - before
    centre = slice(window - 1, n - window)
    size = np.zeros(n)
    size[centre] = np.abs(jump[centre])
    threshold = max(
        RECORDS.impact_sigmas * np.sqrt(2) * error, RECORDS.impact_medians * float(np.median(size[centre]))
    )
    found = []
    for k in np.argsort(-size):
        if size[k] < threshold:
            break
        turned = before[k] * after[k] < 0 and abs(before[k]) > 2 * error
        if turned and all(abs(k - other) > window for other in found):
            found.append(int(k))
    return np.array(sorted(found), int)


def _one_sided_velocities(x: np.ndarray, dt: float, sigma: float, window: int) -> tuple:
    """Velocity half a sample after sample k by parabolas through the samples up to k, and after it."""
    offsets = (np.arange(window) + 0.5) * dt
    design = np.vander(offsets, 3, increasing=True)
    row = np.linalg.pinv(design)[1]
    error = sigma * float(np.linalg.norm(row))
    n = x.size
    after, before = np.zeros(n), np.zeros(n)
    slope = np.correlate(x, row, mode="valid")
    after[: n - window] = slope[1:]
    mirrored = -np.correlate(x, row[::-1], mode="valid")
    before[window - 1 :] = mirrored
    return before, after, error


def impact_table(smoothed: Smoothed) -> np.ndarray:
    """Rows of time [s], x [m], speed before and after [m/s] and their standard errors."""
    rows = []
    for k in smoothed.impacts:
        a, b = smoothed.state[k], smoothed.state[k + 1]
        step = smoothed.t[k + 1] - smoothed.t[k]
        # where the two flights meet
        rate = a[1] - b[1]
        ahead = float(np.clip((b[0] - b[1] * step - a[0]) / rate if rate else 0.5 * step, 0, step))
        rows.append(
            (
                smoothed.t[k] + ahead,
                a[0] + a[1] * ahead,
                a[1] + a[2] * ahead,
                b[1] - b[2] * (step - ahead),
                np.sqrt(smoothed.covariance[k, 1, 1]),
                np.sqrt(smoothed.covariance[k + 1, 1, 1]),
            )
        )
    return np.array(rows).reshape(-1, 6)


def stick_intervals(smoothed: Smoothed) -> list[tuple[float, float]]:
    """Intervals of some samples or more with velocity and acceleration zero within three errors."""
    error = np.sqrt(np.stack([smoothed.covariance[:, i, i] for i in (1, 2)], axis=1))
    still = np.all(np.abs(smoothed.state[:, 1:]) < 3 * error, axis=1)
    still &= np.abs(smoothed.v) < 0.05 * np.sqrt(np.mean(smoothed.v**2))
    return [
        (float(smoothed.t[first]), float(smoothed.t[last - 1]))
        for first, last in runs(still)
        if last - first >= RECORDS.fewest_still
    ]


def in_intervals(t: np.ndarray, intervals: list[tuple[float, float]]) -> np.ndarray:
    """Which times lie in one of some ascending intervals, their ends included."""
    if not intervals:
        return np.zeros(t.size, bool)
    begin, end = np.array(intervals).T
    last = np.searchsorted(begin, t, "right") - 1
    return (last >= 0) & (t <= end[last])


def reversals(smoothed: Smoothed) -> np.ndarray:
    """Times at which the velocity changes its sign without an impact [s]."""
    v, t = smoothed.v, smoothed.t
    turns = np.flatnonzero(v[:-1] * v[1:] < 0)
    turns = turns[~np.isin(turns, smoothed.impacts)]
    return t[turns] - v[turns] * (t[turns + 1] - t[turns]) / (v[turns + 1] - v[turns])


def _tuned_jerk(t: np.ndarray, x: np.ndarray, sigma: float, impacts: np.ndarray) -> float:
    n = min(x.size, RECORDS.tuned_samples)
    dt = float(np.median(np.diff(t[:n])))
    size = max(float(np.std(x)), sigma) / dt**2.5

    def loss(logarithm: float) -> float:
        jerk = size * np.exp(logarithm)
        return -_forward(t[:n], x[:n], sigma, jerk, impacts[impacts < n - 1])[-1]

    best = minimize_scalar(loss, bounds=(-16.0, 4.0), method="bounded", options={"xatol": 0.3, "maxiter": 14})
    return float(size * np.exp(best.x))


def _transition(step: float, jerk: float) -> tuple[np.ndarray, np.ndarray]:
    """Motion over `step` and its process noise, `jerk` [m/s^2.5] the root of the intensity of white jerk."""
    s = step
    motion = np.array([[1.0, s, s * s / 2], [0.0, 1.0, s], [0.0, 0.0, 1.0]])
    noise = jerk**2 * np.array(
        [[s**5 / 20, s**4 / 8, s**3 / 6], [s**4 / 8, s**3 / 3, s**2 / 2], [s**3 / 6, s**2 / 2, s]]
    )
    return motion, noise


def _forward(t: np.ndarray, x: np.ndarray, sigma: float, jerk: float, impacts: np.ndarray) -> tuple:
    n = x.size
    steps = np.diff(t)
    usual = float(np.median(steps))
    motion, noise = _transition(usual, jerk)
    speed = 4 * float(np.max(np.abs(np.diff(x)))) / usual
    burst = np.diag([(speed * usual / 4) ** 2, speed**2, (speed / usual) ** 2])
    hit = np.zeros(n, bool)
    hit[impacts] = True
    state = np.array([x[0], 0.0, 0.0])
    covariance = np.diag([4 * sigma**2 + 1e-300, speed**2, (speed / usual) ** 2])
    filtered, spreads = np.empty((n, 3)), np.empty((n, 3, 3))
    ahead, ahead_spreads, motions = np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, 3, 3))
    likelihood = 0.0
    variance = sigma**2
    for k in range(n):
        if k:
            step = steps[k - 1]
            if abs(step - usual) > 1e-6 * usual:
                used, added = _transition(step, jerk)
            else:
                used, added = motion, noise
            state = used @ state
            covariance = used @ covariance @ used.T + added
            if hit[k - 1]:
                covariance = covariance + burst
            motions[k] = used
        ahead[k], ahead_spreads[k] = state, covariance
        spread = covariance[0, 0] + variance
        miss = x[k] - state[0]
        gain = covariance[:, 0] / spread
        state = state + gain * miss
        covariance = covariance - np.outer(gain, covariance[0])
        covariance = 0.5 * (covariance + covariance.T)
        if k > 2:
            likelihood -= 0.5 * (miss * miss / spread + np.log(spread))
        filtered[k], spreads[k] = state, covariance
    return filtered, spreads, ahead, ahead_spreads, motions, likelihood


def _filter_and_smooth(t: np.ndarray, x: np.ndarray, sigma: float, jerk: float, impacts: np.ndarray) -> tuple:
    filtered, spreads, ahead, ahead_spreads, motions, likelihood = _forward(t, x, sigma, jerk, impacts)
    n = x.size
    # gains of all samples at once: P F' (F P F' + Q)^-1, scaled: x, v and a differ by powers of the step
    scale = np.sqrt(np.einsum("kii->ki", ahead_spreads[1:])) + 1e-300
    scaled = ahead_spreads[1:] / (scale[:, :, None] * scale[:, None, :])
    scaled += 1e-12 * np.eye(3)
    cross = np.einsum("kij,klj->kil", spreads[:-1], motions[1:]) / scale[:, None, :]
    gains = np.linalg.solve(scaled, cross.transpose(0, 2, 1)).transpose(0, 2, 1) / scale[:, None, :]
    state, covariance = filtered.copy(), spreads.copy()
    for k in range(n - 2, -1, -1):
        gain = gains[k]
        state[k] = filtered[k] + gain @ (state[k + 1] - ahead[k + 1])
        covariance[k] = spreads[k] + gain @ (covariance[k + 1] - ahead_spreads[k + 1]) @ gain.T
    return state, covariance, likelihood

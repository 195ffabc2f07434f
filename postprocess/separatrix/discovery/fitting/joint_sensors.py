# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What sensors of force in the joints of several bodies show."""

import numpy as np

from separatrix.discovery.measured.bodies import Structure
from separatrix.discovery.policy import FIT


def joint_force(
    structure: Structure,
    path: str,
    motion: list[np.ndarray],
    jacobian: list[np.ndarray] | None,
    chosen: tuple,
    model,
) -> tuple[np.ndarray, np.ndarray | None]:
    """Force of a spring or soft contact [N] and its derivatives; positive: it pulls its second end back."""
    joint = structure.joint(path)
    active, given, directions = chosen
    n = structure.n
    s, u = motion[0][:, :n] @ joint.row, motion[0][:, n:] @ joint.row
    own = {
        name.rpartition(".")[2]: parameter.value
        for name, parameter in model.parameters.items()
        if name.startswith(f"{path}.")
    }
    indices = {name.rpartition(".")[2]: i for i, name in enumerate(active) if name.startswith(f"{path}.")}
    own |= {key: given[i] for key, i in indices.items()}
    force, by_extension, by_speed = _force(joint.law, own, s, u)
    if jacobian is None:
        return force, None
    slopes = by_extension[:, None] * np.einsum("kij,i->kj", jacobian[0][:, :n], joint.row)
    slopes += by_speed[:, None] * np.einsum("kij,i->kj", jacobian[0][:, n:], joint.row)
    for key, i in indices.items():
        step = FIT.joint_step * max(abs(own[key]), 1e-6)
        moved = (_force(joint.law, {**own, key: own[key] + step}, s, u)[0] - force) / step
        slopes[:, : len(directions)] += moved[:, None] * directions[:, i]
    return force, slopes


def _force(law: str, own: dict[str, float], s: np.ndarray, u: np.ndarray) -> tuple:
    """Force of a joint and its slopes over extension and speed."""
    if law in ("linear", "polynomial"):
        extension = s - own.get("free_length", 0.0)
        k, k2, k3, c = (own.get(key, 0.0) for key in ("stiffness", "quadratic", "cubic", "damping"))
        force = k * extension + k2 * extension**2 + k3 * extension**3 + c * u
        return force, k + 2 * k2 * extension + 3 * k3 * extension**2, np.full(s.shape, c)
    k, c = own["stiffness"], own.get("damping", 0.0)
    force, by_extension, by_speed = np.zeros(s.shape), np.zeros(s.shape), np.zeros(s.shape)
    for key, side in (("upper", 1.0), ("lower", -1.0)):
        depth = side * (s - own.get(key, side * np.inf))
        push = k * depth + side * c * u
        touches = (depth > 0) & ((push > 0) | (own.get("tension", 0.0) > 0))
        force[touches] = side * push[touches]
        by_extension[touches], by_speed[touches] = k, c
    return force, by_extension, by_speed

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
    force, by_extension, by_speed = model.joint_force(path, active, given, s, u)
    if jacobian is None:
        return force, None
    slopes = by_extension[:, None] * np.einsum("kij,i->kj", jacobian[0][:, :n], joint.row)
    slopes += by_speed[:, None] * np.einsum("kij,i->kj", jacobian[0][:, n:], joint.row)
    for i in [i for i, name in enumerate(active) if name.startswith(f"{path}.")]:
        step = FIT.joint_step * max(abs(given[i]), 1e-6)
        step = step if given[i] + step <= model.parameters[active[i]].upper else -step
        moved = np.where(np.arange(given.size) == i, given + step, given)
        change = (model.joint_force(path, active, moved, s, u)[0] - force) / step
        slopes[:, : len(directions)] += change[:, None] * directions[:, i]
    return force, slopes

# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an effect at a joint or motor is made of."""

from collections.abc import Callable
from dataclasses import dataclass, field

from separatrix.discovery.fitting.locations import LocationScales
from separatrix.discovery.measured.bodies import Joint, Location

AT = "@"


@dataclass(frozen=True)
class JointEffect:
    """One effect: its family, its change of a case at a location, and the parameters that this frees.

    `change` (case, location, joint, scales) edits the case and returns the path of the joint whose `keys` are
    fitted, with one or more values to start from. `of` is the kind and law of the joint that it needs there,
    '' for none. Parameters of that joint may move to the path that `change` returns.
    """

    name: str
    meaning: str
    family: str
    change: Callable[[dict, Location, Joint | None, LocationScales], str]
    keys: Callable[[LocationScales], dict[str, list[float]]]
    amplitudes: tuple[str, ...]
    sizes: tuple[str, ...] = ()
    of: tuple[str, str] = ("", "")
    acts: str = "flight"
    # parameters of the joint that move to the returned path
    moved: tuple[str, ...] = ()
    # a key and the key with minus its value
    mirrored: tuple[str, str] = ("", "")
    # how far sizes may go beyond those to start from; 0: as far as usual
    reach: float = 0.0
    # effects that can be the same motion, with their location, and when
    confused: dict[str, tuple[str, str]] = field(default_factory=dict)

# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the motions of impacting and rubbing machines end up (docs/python.md).

    import separatrix as sx

    case = sx.load("machine.toml").with_(drive__ratio=1.3)
    result = sx.basin(case, x0=(0, 1.1, 400), v0=(-6, 6, 400))
    result.separatrix.plot()

Importing the package imports nothing else; each name below brings its module when it is first used.
"""

import importlib
from typing import TYPE_CHECKING

from separatrix.errors import CaseError, GivenUpError, Interrupted, SeparatrixError, SeparatrixWarning
from separatrix.version import __version__

if TYPE_CHECKING:
    from separatrix.boundaries import boundary as boundary
    from separatrix.cache import cached as cached
    from separatrix.cases import Case as Case
    from separatrix.cases import linspace as linspace
    from separatrix.cases import load as load
    from separatrix.discovery.api import Discovery as Discovery
    from separatrix.discovery.api import discover as discover
    from separatrix.exponents import exponents_along as exponents_along
    from separatrix.library import effects as effects
    from separatrix.maps import basin as basin
    from separatrix.maps import points as points
    from separatrix.maps import sweep as sweep
    from separatrix.matching import attractors_of as attractors_of
    from separatrix.measuring.along import measures_along as measures_along
    from separatrix.measuring.api import measures as measures
    from separatrix.measuring.api import tipping as tipping
    from separatrix.measuring.survival import survival as survival
    from separatrix.motions import trajectory as trajectory
    from separatrix.noise import first_passage as first_passage
    from separatrix.noise import noisy as noisy
    from separatrix.open import decode_flags as decode_flags
    from separatrix.open import decode_word as decode_word
    from separatrix.open import decode_words as decode_words
    from separatrix.open import flag_names as flag_names
    from separatrix.open import open_result as open_result
    from separatrix.open import table as table
    from separatrix.orbits import Stability as Stability
    from separatrix.orbits import branches as branches
    from separatrix.orbits import stability as stability
    from separatrix.orbits import stability_of_map as stability_of_map
    from separatrix.sections import section as section

_HOME = {
    "Case": "separatrix.cases",
    "Discovery": "separatrix.discovery.api",
    "Stability": "separatrix.orbits",
    "attractors_of": "separatrix.matching",
    "basin": "separatrix.maps",
    "boundary": "separatrix.boundaries",
    "branches": "separatrix.orbits",
    "cached": "separatrix.cache",
    "decode_flags": "separatrix.open",
    "decode_word": "separatrix.open",
    "decode_words": "separatrix.open",
    "discover": "separatrix.discovery.api",
    "effects": "separatrix.library",
    "exponents_along": "separatrix.exponents",
    "first_passage": "separatrix.noise",
    "flag_names": "separatrix.open",
    "linspace": "separatrix.cases",
    "load": "separatrix.cases",
    "measures": "separatrix.measuring.api",
    "measures_along": "separatrix.measuring.along",
    "noisy": "separatrix.noise",
    "open_result": "separatrix.open",
    "points": "separatrix.maps",
    "section": "separatrix.sections",
    "stability": "separatrix.orbits",
    "stability_of_map": "separatrix.orbits",
    "survival": "separatrix.measuring.survival",
    "sweep": "separatrix.maps",
    "table": "separatrix.open",
    "tipping": "separatrix.measuring.api",
    "trajectory": "separatrix.motions",
}

_WITHOUT_RESULTS = ("separatrix.cases", "separatrix.library")

__all__ = [
    "CaseError",
    "GivenUpError",
    "Interrupted",
    "SeparatrixError",
    "SeparatrixWarning",
    "__version__",
    *sorted(_HOME),
]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'separatrix' has no attribute '{name}'")
    if _HOME[name] not in _WITHOUT_RESULTS:
        # Results have their accessor, whatever computes or opens them.
        importlib.import_module("separatrix.accessor")
    value = getattr(importlib.import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)

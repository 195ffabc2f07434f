# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Event words as text."""

_SYMBOLS = {1: "R", 2: "L", 3: "S", 4: "C", 5: "D", 6: "+", 7: "."}


def decode_word(word: int) -> str:
    """Return the events of one period as text, first event first: 'R.' is one impact a drive period.

    Examples
    --------
    >>> result = sx.basin("examples/basin_coulomb.toml", x0=20, v0=20)
    >>> sx.decode_word(int(result["event_word"].values[0, 0]))
    'R.'
    """
    symbols, rest = [], int(word)
    while rest > 0:
        symbols.append(_SYMBOLS.get(rest & 7, "?"))
        rest >>= 3
    return "".join(symbols)

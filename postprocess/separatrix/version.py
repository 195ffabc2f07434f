# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Version of this package, equal to that of the program."""

__version__ = "0.1.0"

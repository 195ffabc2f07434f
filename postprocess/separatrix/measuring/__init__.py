# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""How safe, how large and how entangled basins are (docs/howto/measures.md)."""

# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Machines fitted to segments: what is free, the catalogue of effects, least squares, what is left over."""

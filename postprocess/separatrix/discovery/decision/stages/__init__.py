# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The stages of the search, in the order of plan.py; each takes a state and returns the next one."""

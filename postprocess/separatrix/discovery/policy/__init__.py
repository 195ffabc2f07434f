# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every threshold of the discovery in one table; docs/reference/thresholds.md is printed from it."""

from separatrix.discovery.policy.fit import FIT
from separatrix.discovery.policy.records import RECORDS
from separatrix.discovery.policy.search import SEARCH

__all__ = ["FIT", "RECORDS", "SEARCH"]

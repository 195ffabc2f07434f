# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is missing: candidates scored against each other, the gates, the verdict and its limits."""

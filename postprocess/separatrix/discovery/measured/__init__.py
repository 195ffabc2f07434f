# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What was measured: records read, checked, smoothed and cut into segments."""

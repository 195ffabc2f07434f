# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Look around in result files: `separatrix-view FILE.h5...`, or in a notebook (docs/viewer.md)."""

# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of docs/start.md, from the case of that page."""

import re
from pathlib import Path

import separatrix as sx

page = Path("../start.md").read_text()
case = sx.Case.from_text(re.search(r"^```toml\n(.*?)^```", page, re.MULTILINE | re.DOTALL)[1])
result = sx.basin(case)
print(result.separatrix.shares().to_string())
result.separatrix.save("start", formats=["png"], shade=True, units=["mm", "mm/s"], dpi=200)

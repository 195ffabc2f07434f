# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface of every Fortran module, by FORD, without what FORD takes from outside."""

import re
import subprocess
import sys
from pathlib import Path

SETTINGS = """\
---
project: Separatrix
summary: Modules, types and procedures of the simulator
src_dir: {source}/src
output_dir: {folder}
display: public
preprocess: false
graph: false
search: false
source: false
incl_src: false
proc_internals: false
print_creation_date: false
quiet: true
---
The public modules, types and procedures of `src/`, from their comments. `src/README.md` shows the layers.
[Back to the documentation](../index.html)
"""
# Bootstrap and MathJax; what is left is styled by docs/_static/fortran.css
OUTSIDE = re.compile(
    r'<link[^>]*href="https?://[^>]*>|<script[^>]*src="https?://[^>]*>\s*</script>'
    r"|<script type=\"text/x-mathjax-config\">.*?</script>", re.DOTALL,
)  # fmt: skip
# FORD links to names within a page that it leaves out
NO_NAME = re.compile(r'#moduleprocedure-[^"]*')
STYLE = '<link rel="stylesheet" href="{up}css/fortran.css">\n</head>'


def write(source: Path, folder: Path, work: Path) -> int:
    """Write the pages into `folder`; return how many there are."""
    project = work / "ford.md"
    project.write_text(SETTINGS.format(source=source, folder=folder))
    done = subprocess.run([Path(sys.executable).with_name("ford"), project], capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"docs: FORD failed\n{done.stdout}{done.stderr}")
    pages = sorted(folder.rglob("*.html"))
    for path in pages:
        up = "../" * (len(path.relative_to(folder).parts) - 1)
        text = NO_NAME.sub("", OUTSIDE.sub("", path.read_text()))
        path.write_text(text.replace("</head>", STYLE.format(up=up), 1))
    (folder / "css" / "fortran.css").write_text((source / "docs/_static/fortran.css").read_text())
    return len(pages)

# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The pages of the gallery: a script of docs/gallery, what it explains, draws and prints."""

import ast
import re
from pathlib import Path

from .reference import MADE

# in the order in which they are shown
ORDER = (
    "petals", "zoom", "flow", "twins", "ratios", "cascade", "shells", "eye", "strange", "islands", "dry",
    "soft", "pendulum", "duffing", "belt", "pounding", "runup",
)  # fmt: skip


def entry(folder: Path, name: str) -> tuple[str, str, str]:
    """Return title, explanation and code of a script."""
    text = (folder / f"{name}.py").read_text()
    title, _, explanation = (ast.get_docstring(ast.parse(text)) or "").partition("\n")
    code = re.sub(r'^(#.*\n)*""".*?"""\n+', "", text, count=1, flags=re.DOTALL)
    return title.strip().rstrip("."), explanation.strip(), code


def write(folder: Path) -> None:
    """Write a page for each script of `folder`, and index.md; a picture that is missing is an error."""
    tiles = []
    for name in ORDER:
        missing = [path for path in (folder / f"{name}.png", folder / f"{name}.txt") if not path.is_file()]
        if missing:
            raise SystemExit(f"docs: {missing[0]} is missing; scripts/gallery {name} makes it")
        title, explanation, code = entry(folder, name)
        (folder / f"{name}.md").write_text(MADE + _page(folder, name, title, explanation, code))
        tiles.append(f"* [![]({name}.png) {title}]({name}.md)")
    (folder / "index.md").write_text(
        MADE + "# Gallery\n\nEach picture is drawn by the script on its page, on one or two cores.\n\n"
        "{.gallery}\n" + "\n".join(tiles) + "\n\n```{toctree}\n:hidden:\n" + "\n".join(ORDER) + "\n```\n"
    )


def _page(folder: Path, name: str, title: str, explanation: str, code: str) -> str:
    text = f"# {title}\n\n![{title}]({name}.png)\n\n{explanation}\n\n"
    text += f"What the script prints:\n\n```text\n{(folder / f'{name}.txt').read_text().rstrip()}\n```\n\n"
    text += f"`docs/gallery/{name}.py`:\n\n```python\n{code.rstrip()}\n```\n"
    for case in sorted(set(re.findall(r'"(\w+\.toml)"', code))):
        body = (folder / case).read_text().split("\n\n", 1)[1]
        text += f"\n`docs/gallery/{case}`:\n\n```toml\n{body.rstrip()}\n```\n"
    return text

# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every link of a built site leads somewhere in it, and no page loads anything from outside."""

from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

# what a page fetches by itself; the others are followed by the reader
LOADED = {("script", "src"), ("img", "src"), ("link", "href"), ("iframe", "src"), ("source", "src")}
NOT_LOADED = {"canonical", "search", "index", "next", "prev"}


class _Page(HTMLParser):
    """The names that can be linked to, and the links, of one page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.names: set[str] = set()
        self.links: list[tuple[str, bool]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {key: value or "" for key, value in attrs}
        self.names |= {values[key] for key in ("id", "name") if key in values}
        for key in ("href", "src"):
            if key in values:
                loaded = (tag, key) in LOADED and values.get("rel") not in NOT_LOADED
                self.links.append((values[key], loaded))


def problems(site: Path, absent: str | None = None) -> list[str]:
    """Return what is wrong with the links of all pages under `site`; `absent`: a folder left out."""
    site = site.resolve()
    pages = {path: _Page(path.read_text(errors="replace")) for path in sorted(site.rglob("*.html"))}
    found = []
    for path, page in pages.items():
        for link, loaded in page.links:
            if absent is not None and link.startswith(f"{absent}/"):
                continue
            wrong = _wrong(site, path, link, loaded, pages)
            if wrong:
                found.append(f"{path.relative_to(site)}: {link}: {wrong}")
    return found


def _wrong(site: Path, path: Path, link: str, loaded: bool, pages: dict[Path, _Page]) -> str | None:
    parts = urlsplit(link)
    if parts.scheme == "data" or (not loaded and parts.scheme in ("http", "https", "mailto", "javascript")):
        return None
    if parts.scheme or parts.netloc:
        return "loaded from outside"
    target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    if not target.is_relative_to(site):
        return "outside the site"
    if target.is_dir():
        target /= "index.html"
    if not target.is_file():
        return "no such file"
    name = unquote(parts.fragment)
    if name and target in pages and name not in pages[target].names:
        return f"no '{name}' there"
    return None

# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""One page that opens offline: the viewer with the answers that it will ask for, and some hundred motions."""

import base64
import contextlib
import gzip
import html
import json
from pathlib import Path
from urllib.parse import urlencode

import numpy as np

from separatrix.errors import SeparatrixError
from separatrix.library import CaseError
from separatrix.view.bundle import module_text, style_text
from separatrix.view.files import ResultFile
from separatrix.view.packing import pack, unpack
from separatrix.view.protocol import Desk

__all__ = ["export_page"]

_CANNOT_CREATE = 73
_FINEST = 2048  # points of a picture in the page, across or up
_SLICES = 32  # of a map that are stored
_VARIABLES = ("attractor", "regime", "settle_time")
_PERIODS, _SAMPLES = 40, 32
_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src 'unsafe-inline'; \
style-src 'unsafe-inline'; img-src data: blob:">
<title>{title}</title>
<link rel="icon" href="data:,">
<style>
{style}
</style>
</head>
<body>
<main id="separatrix"></main>
<script id="stored" type="application/json">{stored}</script>
<script type="module">
{module}
const stored = JSON.parse(document.getElementById("stored").textContent);
mount(document.getElementById("separatrix"), new StoredTransport(stored));
</script>
</body>
</html>
"""


def export_page(paths: list[Path], page: Path, motions: int) -> int:
    """Write a page with the files and some stored motions; return its bytes. SeparatrixError if it cannot."""
    desk = Desk(paths)
    stored: dict[str, object] = {}
    store(stored, desk, "describe", {})
    maps = [source for source in desk.files if source.kind == "basin"]
    starts: list[dict] = []
    for source in desk.files:
        if source.kind == "basin":
            _store_map(stored, desk, source)
            starts += _store_motions(stored, desk, source, motions // len(maps), len(starts))
        else:
            store(stored, desk, "series", {"file": source.number})
    stored["starts"] = starts
    title = desk.files[0].attributes.get("title") or paths[0].name
    # "</script>" must not end the element.
    text = json.dumps(stored, separators=(",", ":")).replace("<", "\\u003c")
    whole = _PAGE.format(title=html.escape(str(title)), style=style_text(), module=module_text(), stored=text)
    desk.close()
    try:
        page.write_text(whole, encoding="utf-8")
    except OSError as error:
        raise SeparatrixError(f"{page}: cannot be written ({error.strerror})", _CANNOT_CREATE) from error
    return page.stat().st_size


def store(stored: dict, desk: Desk, name: str, parameters: dict) -> None:
    """Keep the answer to a request under the address that the page will ask for."""
    answer = desk.answer(name, _texts(parameters))
    stored[_address(name, parameters)] = _text(answer)


def _texts(parameters: dict) -> dict[str, str]:
    return {name: str(value) for name, value in parameters.items()}


def _address(name: str, parameters: dict) -> str:
    """Return the address of a request as the page writes it."""
    return f"{name}?{urlencode(_texts(parameters), safe='')}"


def _text(answer: bytes) -> str:
    return base64.b64encode(gzip.compress(answer, 9, mtime=0)).decode()


def _planes(source: ResultFile) -> tuple[tuple[int, int], list[tuple[int, ...]]]:
    """Return the axes of the picture as the page chooses them, and the slices."""
    axes = source.axes
    starts = [i for i, axis in enumerate(axes) if axis["start"]]
    shown = starts if len(starts) >= 2 else list(dict.fromkeys([*starts, *range(len(axes))]))
    across, up = sorted(shown[:2])
    others = [axis["count"] for i, axis in enumerate(axes) if i not in (across, up)]
    if np.prod(others, dtype=float) > _SLICES:
        raise SeparatrixError(
            f"{source.path}: has {int(np.prod(others))} slices, a page holds {_SLICES}; divide the map"
        )
    slices = []
    for index in np.ndindex(*others):
        rest = iter(index)
        slices.append(tuple(0 if i in (across, up) else next(rest) for i in range(len(axes))))
    return (across, up), slices


def _store_map(stored: dict, desk: Desk, source: ResultFile) -> None:
    (across, up), slices = _planes(source)
    names = [one["name"] for one in source.variables]
    chosen = [names.index(name) for name in _VARIABLES if name in names]
    finest = 0
    while max(source.shape[across], source.shape[up]) >> finest > _FINEST:
        finest += 1
    for at in slices:
        plane = {"file": source.number, "across": across, "up": up, "at": ",".join(map(str, at))}
        asked = {"file": source.number, "at": plane["at"]}
        with contextlib.suppress(CaseError):
            answer = desk.answer("attractors", _texts(asked | {"page": 0, "view": 0}))
            stored[_address("attractors", asked)] = _text(answer)
        for variable in chosen:
            _store_tiles(stored, desk, plane | {"variable": variable}, finest)


def _store_tiles(stored: dict, desk: Desk, plane: dict, finest: int) -> None:
    header, _ = unpack(desk.answer("classes", _texts(plane)))
    for level in range(finest, header["top"] + 1):
        row = 0
        while True:
            column = 0
            while True:
                one = plane | {"level": level, "row": row, "column": column}
                answer = _tile(desk, one)
                if answer is None:
                    break
                names = ("file", "across", "up", "at", "variable", "level", "row", "column")
                stored[_address("tile", {name: one[name] for name in names})] = _text(answer)
                column += 1
            if column == 0:
                break
            row += 1


def _tile(desk: Desk, parameters: dict) -> bytes | None:
    """Return a finished tile; None beyond the last."""
    texts = _texts(parameters)
    plane_texts = {name: texts[name] for name in ("file", "across", "up", "at", "variable")}
    rows, columns = desk.tiles(plane_texts, parameters["level"])
    if parameters["row"] >= rows or parameters["column"] >= columns:
        return None
    desk.finish(plane_texts)
    return desk.answer("tile", texts)


def _store_motions(stored: dict, desk: Desk, source: ResultFile, count: int, first: int) -> list[dict]:
    """Store motions from a lattice of starts over each slice; return where they start."""
    (across, up), slices = _planes(source)
    axes = source.axes
    if not (axes[across]["start"] and axes[up]["start"]) or not count:
        return []
    try:
        desk.machine(source)
    except CaseError:
        return []
    side = max(1, int(np.sqrt(count / len(slices))))
    given = source.case["start"]
    names = {"x0": "x", "v0": "v", "crank_angle": "angle"}
    starts = []
    for at in slices:
        text = ",".join(map(str, at))
        for i, j in np.ndindex(side, side):
            index = list(at)
            index[across] = int((i + 0.5) * axes[across]["count"] / side)
            index[up] = int((j + 0.5) * axes[up]["count"] / side)
            start = {"x": given["x0"], "v": given["v0"], "angle": given["crank_angle"]}
            start |= {
                names[axis["path"]]: float(axis["array"][k])
                for axis, k in zip(axes, index, strict=True)
                if axis["start"]
            }
            asked = {"file": source.number, **start, "at": text, "periods": _PERIODS, "samples": _SAMPLES}
            answer = desk.answer("motion", _texts(asked))
            stored[f"motion?{first + len(starts)}"] = _text(_small(answer))
            width = abs(axes[across]["to"] - axes[across]["from"]) or 1.0
            height = abs(axes[up]["to"] - axes[up]["from"]) or 1.0
            sizes = {"width": float(width), "height": float(height)}
            if axes[across]["path"] != "x0":
                sizes = {"width": float(height), "height": float(width)}
            starts.append({"file": source.number, "at": text, "x": start["x"], "v": start["v"], **sizes})
    return starts


def _small(answer: bytes) -> bytes:
    """Return a motion with what the page draws: columns as differences of whole numbers of 16 bits."""
    header, arrays = unpack(answer)
    time = arrays["time"]
    header["packed"] = {"first": float(time[0]), "step": float(time[1] - time[0]) if len(time) > 1 else 0.0}
    small = {name: arrays[name].astype(np.float32) for name in arrays if name.startswith("event_")}
    small["event_kind"] = arrays["event_kind"].astype(np.int8)
    small["section"] = arrays["section"]
    if "crank" in arrays:
        # an angle is drawn: its turns would take the digits
        arrays["crank"] = np.mod(arrays["crank"], 2 * np.pi)
    for name in [one for one in ("x", "v", "driver", "crank") if one in arrays]:
        values = np.nan_to_num(arrays[name].astype(float))
        low, high = values.min(initial=np.inf), values.max(initial=-np.inf)
        step = (high - low) / 65534 or 1.0
        whole = np.rint((values - low) / step - 32767).astype(np.int16)
        header["packed"][name] = [float(low), float(step)]
        small[name] = np.diff(whole, prepend=np.int16(0))
    for name in ("event_driver_x", "event_driver_v"):
        small.pop(name, None)
    return pack(header, small)

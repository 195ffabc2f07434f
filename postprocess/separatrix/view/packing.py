# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Answers as bytes: length of a header, the header in JSON, arrays, each from a multiple of eight bytes."""

import json
import math

import numpy as np

__all__ = ["clean", "pack", "unpack"]

_ALIGN = 8


def pack(header: dict, arrays: dict[str, np.ndarray] | None = None) -> bytes:
    """Return a header and named arrays as bytes, little-endian."""
    arrays = {
        name: np.ascontiguousarray(one, one.dtype.newbyteorder("<")) for name, one in (arrays or {}).items()
    }
    table, offset = [], 0
    for name, one in arrays.items():
        kind = ("f" if one.dtype.kind == "f" else "u" if one.dtype.kind == "u" else "i") + str(
            8 * one.itemsize
        )
        table.append({"name": name, "type": kind, "shape": list(one.shape), "offset": offset})
        offset += -(-one.nbytes // _ALIGN) * _ALIGN
    text = json.dumps(clean(header | {"arrays": table}), allow_nan=False, separators=(",", ":")).encode()
    text += b" " * (-(len(text) + 4) % _ALIGN)
    parts = [len(text).to_bytes(4, "little"), text]
    for one in arrays.values():
        parts += [one.tobytes(), b"\0" * (-one.nbytes % _ALIGN)]
    return b"".join(parts)


def unpack(data: bytes) -> tuple[dict, dict[str, np.ndarray]]:
    """Return what `pack` packed."""
    length = int.from_bytes(data[:4], "little")
    header = json.loads(data[4 : 4 + length])
    arrays = {}
    for one in header.pop("arrays"):
        kind = np.dtype(f"<{one['type'][0]}{int(one['type'][1:]) // 8}")
        count, start = math.prod(one["shape"]), 4 + length + one["offset"]
        arrays[one["name"]] = np.frombuffer(data, kind, count, start).reshape(one["shape"])
    return header, arrays


def clean(value: object) -> object:
    """Return a value of plain Python types; numbers that are not finite, which JSON lacks, become None."""
    if isinstance(value, dict):
        return {str(key): clean(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [clean(one) for one in value]
    if isinstance(value, np.ndarray):
        return clean(value.tolist())
    if isinstance(value, np.generic):
        return clean(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    return value

# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A map moving through one of its parameters, as a GIF or an MP4."""

import importlib.util
import io
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import xarray as xr
from PIL import Image

from separatrix import style
from separatrix.classes import CLASS_FIELDS
from separatrix.errors import USAGE, SeparatrixError
from separatrix.figures import basin
from separatrix.figures.look import DEFAULT, Look
from separatrix.labels import value_label
from separatrix.whole_files import written_whole

FORMATS = (".gif", ".mp4")


def animate(
    result: xr.Dataset,
    parameter: str,
    path: Path,
    title: str,
    field: str = "attractor",
    look: Look = DEFAULT,
    frames_per_second: float = 5.0,
    dpi: int = 150,
) -> Path:
    """Write the maps over the values of a parameter as frames; the suffix of `path` sets the format.

    Colours and legend are the same in all frames; shares are those of all. Other parameters are fixed by
    `look.slice`.
    """
    if look.ax:
        raise SeparatrixError("ax: not served by films", USAGE)
    check_format(path)
    if field not in CLASS_FIELDS:
        allowed = ", ".join(CLASS_FIELDS)
        raise SeparatrixError(f"animation: found the field '{field}', allowed {allowed}", USAGE)
    dim = parameter.replace(".", "_")
    fixed = [name.replace(".", "_") for name in look.slice]
    varying = [name for name in result[field].dims if result.sizes[name] > 1 and name not in fixed]
    if dim not in varying or len(varying) != 3:
        found = ", ".join(varying)
        raise SeparatrixError(
            f"animation over {parameter}: found the axes {found}, allowed it and two more", USAGE
        )
    return write_film(_frames(result, dim, title, field, look, dpi), path, frames_per_second)


def check_format(path: Path) -> None:
    """Raise a SeparatrixError for a suffix that is no film, and for .mp4 without ffmpeg."""
    if path.suffix not in FORMATS:
        raise SeparatrixError(f"{path}: allowed are {' and '.join(FORMATS)}", USAGE)
    if path.suffix == ".mp4" and ffmpeg() is None:
        raise SeparatrixError(
            f"{path}: needs ffmpeg, which was not found; `pip install imageio-ffmpeg` brings it;"
            " .gif needs nothing",
            USAGE,
        )


def write_film(images: Iterable[Image.Image], path: Path, frames_per_second: float) -> Path:
    """Write frames as a film in the format of the suffix; return the path."""
    frames = [image.convert("RGB") for image in images]
    size = tuple(max(image.size[k] for image in frames) // 2 * 2 for k in (0, 1))
    frames = [_on_page(image, size) for image in frames]
    with written_whole(path, make_folder=True) as temporary:
        if path.suffix == ".gif":
            first, *rest = (image.quantize(128) for image in frames)
            first.save(
                temporary, format="GIF", save_all=True, append_images=rest,
                duration=round(1000 / frames_per_second), loop=0,
            )  # fmt: skip
        else:
            _film(frames, temporary, frames_per_second)
    return path


def _frames(
    result: xr.Dataset, dim: str, title: str, field: str, look: Look, dpi: int
) -> Iterator[Image.Image]:
    codes, numbers = np.unique(look.selected(result)[field].values, return_counts=True)
    totals = dict(zip(codes.tolist(), numbers.tolist(), strict=True))
    # Marks come from the catalogue, which counts the slices of the whole result.
    for value in result[dim].values:
        one = look.at(dim, float(value))
        heading = f"{title}, {value_label(result[dim], float(value))}"
        with style.context():
            figure = basin.basin_map(None, result, field, heading, one, totals)
            page = io.BytesIO()
            figure.savefig(page, format="png", dpi=dpi)
        yield Image.open(page)


def _on_page(image: Image.Image, size: tuple[int, int]) -> Image.Image:
    """All frames on pages of one size: captions may differ by a line."""
    page = Image.new("RGB", size, "white")
    page.paste(image, (0, 0))
    return page


def ffmpeg() -> str | None:
    """Return the program that writes films: that of the system, or of the package imageio-ffmpeg."""
    found = shutil.which("ffmpeg")
    if found is None and importlib.util.find_spec("imageio_ffmpeg"):
        found = importlib.import_module("imageio_ffmpeg").get_ffmpeg_exe()
    return found


def _film(frames: list[Image.Image], path: Path, frames_per_second: float) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for number, frame in enumerate(frames):
            frame.save(Path(folder) / f"{number:06d}.png")
        command = [str(ffmpeg()), "-y", "-loglevel", "error", "-framerate", str(frames_per_second)]
        command += ["-i", str(Path(folder) / "%06d.png"), "-pix_fmt", "yuv420p", "-f", "mp4", str(path)]
        ended = subprocess.run(command, capture_output=True, text=True)
        if ended.returncode:
            raise OSError(ended.stderr.strip().splitlines()[-1] if ended.stderr.strip() else "ffmpeg failed")

# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reference pages from the output of the programs: laws, effects, commands, columns, exit codes."""

import json
import re
import subprocess
from pathlib import Path

import xarray as xr
from evidence.evidence_rows import table

MADE = "<!-- made by scripts/docs -->\n\n"

FAMILIES = {
    "body": "Bodies", "restoring": "Restoring forces", "friction": "Friction", "contact": "Contacts",
    "drive": "Drives", "motor": "Motors", "force": "Forces by expressions", "state": "States by expressions",
    "part": "Parts of a machine of several bodies",
}  # fmt: skip
TOOLS = (
    "separatrix-figures",
    "separatrix-measures",
    "separatrix-view",
    "separatrix-discover",
    "separatrix-structure",
    "separatrix-noise",
)
# one of each kind of file, small
RUNS = {
    "basin": ("basin_coulomb.toml", ["axis[1].count=3", "axis[2].count=3"]),
    "sweep": (
        "sweep_coulomb.toml",
        ["sweep.from=0.84", "sweep.to=0.9", "sweep.step=0.03", "sweep.starts=[2, 2]"],
    ),
    "trajectory": ("trajectory_coulomb_1.2_impact.toml", ["run.duration=2", "run.window=1"]),
    "points": ("basin_coulomb.toml", []),
}  # fmt: skip


def write(program: Path, tools: Path, source: Path, folder: Path, work: Path) -> None:
    """Write laws.md, effects.md, commands.md, columns.md and exit-codes.md into `folder`.

    `tools`: where the Python commands are; `source`: the top of the repository; `work`: for files in between.
    """
    laws = json.loads(_output(program, "laws", "--json"))
    pages = {
        "laws": _laws(laws),
        "effects": _effects(laws),
        "commands": _commands(program, tools),
        "columns": _columns(program, source, work),
        "exit-codes": _exit_codes(program, source),
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in pages.items():
        (folder / f"{name}.md").write_text(MADE + text)


def _output(*words: str | Path) -> str:
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout


def _laws(laws: list[dict]) -> str:
    text = (
        "# Laws\n\nEvery law of `[body]`, `[restoring]`, `[friction]`, `[contact]` and `[drive]` with its "
        "keys, as `separatrix laws` prints them. [Case files](../case-file.md) describe how they are written "
        "down, [effects](effects.md) what can be added to them.\n"
    )
    unknown = {law["family"] for law in laws} - {*FAMILIES, "effect"}
    if unknown:
        raise SystemExit(f"docs: the reference has no heading for the laws of {', '.join(sorted(unknown))}")
    for family, heading in FAMILIES.items():
        text += f"\n## {heading}\n"
        for law in laws:
            if law["family"] == family:
                text += f"\n### {_heading(law)}\n\n{_body(law)}"
    return text


def _effects(laws: list[dict]) -> str:
    text = (
        "# Effects\n\nWhat a machine of one body can have beyond its laws, each in a table "
        "`[effect.NAME]` of the [case](../case-file.md#effects-effectname); "
        "[discovery](../discovery-guide.md) looks for them in records.\n"
    )
    for law in laws:
        if law["family"] == "effect":
            text += f"\n## `[effect.{law['law']}]`\n\n{_body(law)}"
    return text


def _heading(law: dict) -> str:
    if law["family"] in ("force", "state"):
        return f"`[{law['family']}.NAME]`"
    if law["family"] != "part":
        return f'`{law["family"]}.law = "{law["law"]}"`'
    part, _, variant = law["law"].partition(":")
    if part in ("body", "point", "structure"):
        # these have no key `law`
        return f"`[{part}.NAME]`, {variant}"
    return f'`[{part}.NAME]` `law = "{variant}"`'


def _body(law: dict) -> str:
    meaning = _plain(law["meaning"])
    text = f"{meaning[:1].upper() if meaning[:2].islower() else meaning[:1]}{meaning[1:]}.\n\n"
    rows = []
    for one in law["parameters"]:
        default = (
            f"{one['default']:g}" if one["default"] is not None else "none" if one["optional"] else "required"
        )
        unit = "" if one["unit"] == "1" else one["unit"]
        name = f"`{one['name']}`" + (" (list)" if one["list"] else "")
        rows.append([name, unit, _allowed(one), default, _plain(one["meaning"])])
    if rows:
        text += table(["key", "unit", "allowed", "default", "meaning"], rows).rstrip() + "\n\n"
    return text + (f"Source: {law['source']}.\n" if law["source"] else "")


def _allowed(one: dict) -> str:
    lower, upper = one["lower"], one["upper"]
    bounds = []
    if lower is not None:
        bounds.append(f"{'>' if one['lower_open'] else '≥'} {lower:g}")
    if upper is not None:
        bounds.append(f"≤ {upper:g}")
    return ", ".join(bounds) or "any"


def _plain(text: str) -> str:
    """A text of the program as Markdown, letter for letter."""
    return re.sub(r"([|*_\[\]$\\<>])", r"\\\1", text)


def _commands(program: Path, tools: Path) -> str:
    text = "# Commands\n\nWhat each prints with `--help`.\n\n## separatrix\n\n" + _block(
        _output(program, "--help")
    )
    for command in re.findall(r"^  ([a-z]+) ", _output(program, "--help").split("Options:")[0], re.MULTILINE):
        text += f"\n## separatrix {command}\n\n" + _block(_output(program, command, "--help"))
    for tool in TOOLS:
        text += f"\n## {tool}\n\n" + _block(_output(tools / tool, "--help"))
    return text


def _block(text: str) -> str:
    return f"```text\n{text.rstrip()}\n```\n"


def _columns(program: Path, source: Path, work: Path) -> str:
    text = (
        "# Columns\n\nEvery variable of each kind of file with its type, dimensions, unit and codes, "
        "read from files that the program wrote. "
        "[Result files](../file-format.md) describe what else is in them.\n"
    )
    starts = work / "starts.csv"
    starts.write_text("x0,v0\n0.4,0\n")
    for kind, (case, settings) in RUNS.items():
        path = work / f"{kind}.h5"
        words: list[str | Path] = [program, kind, source / "examples" / case, "-o", path, "--force", "-q"]
        for setting in settings:
            words += ["--set", setting]
        _output(*words, *(["--list", starts] if kind == "points" else []))
        text += f"\n## {kind}\n\n" + _variables(path, None)
        for group in ("catalogue", "limits"):
            if {"catalogue": "basin", "limits": "sweep"}[group] == kind:
                text += f"\n### {kind}: /{group}\n\n" + _variables(path, group)
    return text


def _variables(path: Path, group: str | None) -> str:
    rows = []
    with xr.open_dataset(path, engine="h5netcdf", group=group, decode_times=False) as file:
        for name, variable in file.variables.items():
            meaning = str(variable.attrs.get("long_name", ""))
            if "flag_meanings" in variable.attrs:
                names = str(variable.attrs["flag_meanings"]).split()
                codes = zip(variable.attrs["flag_values"].tolist(), names, strict=True)
                meaning += ": " + ", ".join(f"{code} `{word}`" for code, word in codes)
                meaning = meaning.removeprefix(": ")
            unit = str(variable.attrs.get("units", ""))
            kind = "string" if variable.dtype.kind == "O" else str(variable.dtype)
            rows.append(
                [f"`{name}`", kind, ", ".join(map(str, variable.dims)), "" if unit == "1" else unit, meaning]
            )
    return table(["variable", "type", "dimensions", "unit", "meaning"], rows)


def _exit_codes(program: Path, source: Path) -> str:
    """The codes that the user guide lists with their advice; those of `--help` must be among them."""
    listed = _output(program, "--help").split("Exit codes:")[1]
    codes = dict(re.findall(r"(\d+) ([^,.]+)[,.]", listed.replace("\n", " ")))
    advice = dict(
        re.findall(r"^\| (\d+) \| (.*) \|$", (source / "docs/user-guide.md").read_text(), re.MULTILINE)
    )
    if not set(codes) <= set(advice):
        raise SystemExit(f"docs: --help has the exit codes {codes}, docs/user-guide.md has {list(advice)}")
    rows = [[code, codes.get(code, ""), *text.rsplit(" | ", 1)] for code, text in advice.items()]
    # the page is a folder deeper than the guide
    rows = [[part.replace("](#", "](user-guide.md#") for part in row] for row in rows]
    rows = [[re.sub(r"\]\((?!https?:)", "](../", part) for part in row] for row in rows]
    return (
        "# Exit codes\n\nOf all commands; the Python package has them as `error.code` of its exceptions.\n\n"
        + table(["code", "in short", "meaning", "what to do"], rows)
    )

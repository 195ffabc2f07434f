# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Basin maps of scripts/evidence/discovery_tour: wrong and corrected case beside the true one."""

import json
import sys
from pathlib import Path

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from separatrix import open_result, style
from separatrix.discovery.wording import with_error
from separatrix.labels import axis_label
from separatrix.layout import compose
from separatrix.open import flag_names
from separatrix.save import save

_WRONG = "#000000"


def regimes(path: Path) -> tuple[np.ndarray, dict[int, str], list[float], tuple[str, str]]:
    """Names of the regimes over (v0, x0), the extent of the axes and their labels."""
    with open_result(path) as result:
        table = result["regime"].transpose("v0", "x0")
        x, v = result["x0"].values, result["v0"].values
        names = flag_names(result["regime"])
        return (
            np.vectorize(names.get)(table.values),
            names,
            [x[0], x[-1], v[0], v[-1]],
            (axis_label(result["x0"]), axis_label(result["v0"])),
        )


def main(folder: Path, target: Path) -> None:
    """Print how much of each map is wrong, and draw the maps."""
    effects = [path.parent for path in sorted(folder.glob("*/true.h5"), reverse=True)]
    with style.context():
        figure = style.new_figure(style.DOUBLE_COLUMN, 66.0 * len(effects))
        axes = figure.subplots(len(effects), 2, sharex=True, sharey=True, squeeze=False)
        seen: set[str] = set()
        shares = []
        for row, effect in enumerate(effects):
            verdict = json.loads((effect / "verdict.json").read_text(encoding="utf-8"))
            truth, _, extent, labels = regimes(effect / "true.h5")
            gap = verdict["gap"]["held_out"]
            print(f"{effect.name}: {verdict['outcome']}, {', '.join(verdict['effects'])}")
            for path, one in verdict["parameters"].items():
                if path.startswith("effect."):
                    print(f"  {path} = {with_error(one)}")
            print(f"  reduced chi^2 on the held-out record: {gap['before']:.6g} -> {gap['after']:.4g}")
            for column, (label, path) in enumerate(
                (("wrong", folder / "base.h5"), ("corrected", effect / "extended.h5"))
            ):
                table = regimes(path)[0]
                differs = table != truth
                shares.append(100 * differs.mean())
                print(
                    f"  {label} case: {differs.sum()} of {differs.size} starts end elsewhere "
                    f"({shares[-1]:.3g} %)"
                )
                _draw(axes[row, column], table, differs, extent)
                seen |= set(np.unique(table))
                title = f"{effect.name.replace('_', ' ')} hidden: {label} case, {shares[-1]:.3g} % wrong"
                axes[row, column].set_title(f"{'abcdefgh'[2 * row + column]}) {title}", loc="left")
            axes[row, 0].set_ylabel(labels[1])
        for ax in axes[-1]:
            ax.set_xlabel(labels[0])
        handles: list = [
            Patch(color=style.REGIMES[name], label=name.replace("_", "-")) for name in sorted(seen)
        ]
        handles.append(
            Line2D(
                [], [], linestyle="", marker="s", markersize=3, color=_WRONG, label="differs from the truth"
            )
        )
        caption = [
            "Where starts of the published Coulomb machine with a hidden effect end up, ratio 1.2, by the "
            "case without the "
            "effect and by the case that separatrix-discover wrote from two records of 8 s at other ratios"
        ]
        compose(
            figure, "Basin maps before and after the missing effect was found", caption, handles, columns=4
        )
        for path in save(figure, target.with_suffix(""), ["png"], 200):
            print(f"wrote {path}")


def _draw(ax, table: np.ndarray, differs: np.ndarray, extent: list[float]) -> None:
    names = sorted(set(np.unique(table)))
    codes = np.searchsorted(names, table)
    colours = [style.REGIMES[name] for name in names] + [_WRONG]
    codes[differs] = len(names)
    ax.imshow(
        codes, origin="lower", extent=extent, aspect="auto", cmap=ListedColormap(colours), vmin=-0.5,
        vmax=len(names) + 0.5,
    )  # fmt: skip


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))

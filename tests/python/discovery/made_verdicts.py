# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Verdicts and details like those of the workflow, made for tests of their report."""

import json
from pathlib import Path

import h5py
import numpy as np

RATE = 12.0
NAMES = ["cubic_spring", "offset_force", "sensor_bias"]

CHARACTER = [
    {
        "depends_on": ["memory"],
        "formula": "-a z, z' = v - z/tau",
        "constant": {"name": "time constant tau", "value": 0.2034, "unit": "s"},
        "size": {"value": 3.42, "standard_error": 0.08},
        "closed": {"training": 0.92, "held_out": 0.97},
        "text": "a force that depends on memory, -a z, with a time constant tau of about 0.203 s",
    },
    {
        "depends_on": ["speed", "position"],
        "formula": "",
        "constant": None,
        "size": None,
        "closed": {"training": 0.91, "held_out": 0.95},
        "text": "a force that depends on speed and position: it would close 91 % of the gap",
    },
]


def gap_of(before: float, after: float) -> dict:
    """Sizes of a gap, and what both machines miss at a noise of 1 mm and a signal of 50 mm."""
    misses = {"before": 1e-3 * np.sqrt(before - 1), "after": 1e-3 * np.sqrt(after - 1)}
    share = {key: float(one) / 0.05 for key, one in misses.items()}
    misfit = {key: float(one) for key, one in misses.items()} | {"unit": "m", "share": share}
    return {"before": before, "after": after, "noise_floor": 1.0, "misfit": misfit}


def verdict(outcome: str) -> dict:
    """A verdict like those of the workflow."""
    found = outcome in ("named", "ambiguous")
    effects = NAMES[:1] if found else []
    after = 1.013 if found else 7.25
    parameters = {
        "restoring.stiffness": {
            "value": 88.8833, "standard_error": 0.0804, "interval_95": [88.7257, 89.0409], "unit": "N/m",
            "at": "",
        }
    }  # fmt: skip
    parameters["contact.stiffness"] = {
        "value": 1.0, "standard_error": None, "interval_95": None, "note": "at its bound", "unit": "N",
        "at": "",
    }  # fmt: skip
    if found:
        parameters["effect.cubic_spring.stiffness"] = {
            "value": 9.83014, "standard_error": 0.8334, "interval_95": [8.19671, 11.4636], "unit": "N/m^3",
            "at": "",
        }  # fmt: skip
    return {
        "outcome": outcome,
        "compared": "motion",
        "complete": True,
        "effects": effects,
        "alternatives": ["offset_force", "offset_force+sensor_bias"] if outcome == "ambiguous" else [],
        "equivalent": False,
        "in_families": [],
        "locations": {},
        "equivalences": ["offset_force and sensor_bias: a shift"] if outcome == "ambiguous" else [],
        "parameters": parameters,
        "where": [{"map": "position", "text": "a force of 2.55 +- 0.32 N is missing at 0.9 to 1.1 m"}],
        "gap": {
            "training": gap_of(7.25, after),
            "held_out": gap_of(41234.5, 1.0093 if found else 41234.5),
        },
        "character": CHARACTER if outcome == "characterised" else [],
        "added": [],
        "not_added": "nothing is added to the case: no law" if outcome == "characterised" else "",
        "gates": {"converged": True, "detect": True, "separate": outcome == "named"} if found else {},
        "p_value": 5.8e-74 if found else None,
        "reasons": [] if outcome in ("named", "none") else ["gate 'separate' was not passed"],
        "detectable": {
            "cubic_spring": {
                "size": 4.2252, "path": "effect.cubic_spring.stiffness", "unit": "N/m^3", "reason": "",
            },
            "offset_force": {
                "size": None, "path": "effect.offset_force.force", "unit": "N", "reason": "imitated",
            },
            "static_excess": {"size": None, "path": None, "unit": None, "reason": "nothing sticks"},
        },
        "confusability": {"names": NAMES, "matrix": [[1.0, 0.31, 0.2], [0.31, 1.0, 0.98], [0.2, 0.98, 1.0]]},
        "separating_experiment": "measure the barrier" if outcome == "ambiguous" else "",
        "experiments": [
            {"drive_ratio": 1.2, "scale": 1.6, "rate": None, "d_prime": 14.2, "text": "a record"}
        ]
        if outcome == "ambiguous"
        else [],
        "d_prime": {"cubic_spring": 11.879, "offset_force": 8.2804, "sensor_bias": 0.0},
        "candidates": [
            {
                "effect": name, "training": 69.75 / k, "held_out": 99.69 / k, "evidence": 168.44 / k,
                "reduced_chi2": 1.01 * k, "converged": k == 1, "starts": 1,
                "values": {f"effect.{name}.size": 9.83 * k},
            }
            for k, name in enumerate(NAMES[:2], 1)
        ],
        "ceiling": {"speed": {"gain": 130.05, "rank": 7, "p": 6.1e-25}},
        "not_tested": {"static_excess": "it changes nothing"},
        "notes": ["f0: noise is stated"],
        "records": [
            {
                "name": name, "use": use, "samples": 600, "sigma": 1e-3, "memory": 0.0, "resolution": 0.0,
                "drive_frequency": RATE, "drive_scale": 0.5, "phase_known": True, "sensor_bias": None,
            }
            for name, use in (("f0", "training"), ("f1", "held out"))
        ],
        "held_out_chosen": "as asked for",
        "seed": 1,
        "asked_for": None,
        "families": ["friction over speed"],
        "function": None,
        "remains": [
            {
                "use": "training", "closed": 0.998, "size": 0.11, "depends_on": "",
                "text": "in training, 99.8 % of the gap is closed; what remains is below the noise",
            }
        ]
        if found
        else [],
        "units": {"position": "m", "velocity": "m/s", "force": "N"},
        "version": "0.1.0",
        "runtime_s": 7.662,
    }  # fmt: skip


def write_details(path: Path, stages: tuple[str, ...]) -> None:
    """Numbers behind the figures, in the layout of details.h5."""
    random = np.random.default_rng(3)
    t = np.arange(600) / 100
    x, v = 0.7 + 0.3 * np.cos(RATE * t), -0.3 * RATE * np.sin(RATE * t)
    segment = np.arange(t.size) // 50
    hits = np.arange(0.0, 6.0, 0.5)
    speed = 1 + 0.5 * np.sin(hits)
    with h5py.File(path, "w") as file:
        file.attrs["compared"] = "motion"
        file.attrs["position_unit"], file.attrs["velocity_unit"] = "m", "m/s"
        for name, unit, count in (
            ("time in f0", "s", 12),
            ("position", "m", 10),
            ("position and velocity", "m, m/s", 25),
        ):
            group = file.create_group(f"where/{name}")
            group.attrs["unit"], group.attrs["force_unit"] = unit, "N"
            group["edges"] = np.linspace(0, 1, count + 1 if count < 25 else 6)
            if count == 25:
                group["velocity_edges"] = np.linspace(-3, 3, 6)
            group["force"], group["error"] = random.normal(size=count), np.full(count, 0.2)
            group["flagged"] = group["force"][:] > 0.6
        for use, name in (("training", "f0"), ("held_out", "f1")):
            record = file.create_group(f"records/{name}")
            record.attrs["held_out"], record.attrs["sigma"] = use == "held_out", 1e-3
            record["t"], record["x"] = t, x
            record["smoothed"] = np.column_stack([x, v, 0 * v])
            record["impacts"] = np.column_stack(
                [hits, 1.1 + 0 * hits, speed, -0.5 * speed, 0.01 + 0 * hits, 0.01 + 0 * hits]
            )
            for stage in stages:
                group = file.create_group(f"{use}/{name}/{stage}")
                group.attrs["crank_angle"] = 0.0
                group["t"], group["segment"], group["x"], group["v"] = t, segment, x, v
                size = 300 * np.sin(3 * t) if stage == "before" else 0
                group["residual"] = random.normal(size=t.size) + size
                group["good"] = np.ones(segment[-1] + 1, bool)
                group["impacts"] = np.column_stack([0 * hits, hits, speed, 0.45 * speed, 1 + 0 * hits])


def make(folder: Path, outcome: str) -> dict:
    """What separatrix-discover leaves in its folder."""
    made = verdict(outcome)
    (folder / "verdict.json").write_text(json.dumps(made))
    write_details(folder / "details.h5", ("before", "after") if made["effects"] else ("before",))
    return made

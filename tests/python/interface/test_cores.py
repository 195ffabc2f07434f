# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The cores that the package counts are those that the control groups of a container or a job allow."""

import os
import re
from pathlib import Path

import pytest
from separatrix.cores import cores

PACKAGE = Path(__file__).resolve().parents[3] / "postprocess/separatrix"


def group(root: Path, lines: str, **files: str) -> Path:
    """A folder with the files of a process in control groups; `__` in a name stands for `/`."""
    (root / "proc/self").mkdir(parents=True)
    (root / "proc/self/cgroup").write_text(lines)
    for name, text in files.items():
        path = root / "sys/fs/cgroup" / name.replace("__", "/").replace("-", ".")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return root


@pytest.fixture(autouse=True)
def eight_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that may run on eight cores."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)))


@pytest.mark.parametrize(
    ("limit", "count"),
    [
        ("max 100000", 8),
        ("200000 100000", 2),
        ("250000 100000", 3),
        ("10000 100000", 1),
        ("1600000 100000", 8),
    ],
)
def test_a_limit_of_version_2(tmp_path: Path, limit: str, count: int) -> None:
    assert cores(group(tmp_path, "0::/job\n", **{"job__cpu-max": limit})) == count


def test_the_smallest_limit_above_counts(tmp_path: Path) -> None:
    files = {"a__cpu-max": "300000 100000", "a__b__cpu-max": "max 100000"}
    assert cores(group(tmp_path, "0::/a/b\n", **files)) == 3


@pytest.mark.parametrize(("quota", "count"), [("-1", 8), ("400000", 4)])
def test_a_limit_of_version_1(tmp_path: Path, quota: str, count: int) -> None:
    files = {"cpu,cpuacct__job__cpu-cfs_quota_us": quota, "cpu,cpuacct__job__cpu-cfs_period_us": "100000"}
    assert cores(group(tmp_path, "5:memory:/job\n4:cpu,cpuacct:/job\n0::/\n", **files)) == count


def test_without_control_groups(tmp_path: Path) -> None:
    assert cores(tmp_path) == 8


def test_nothing_counts_the_cores_of_the_machine() -> None:
    counted = re.compile(r"cpu_count|sched_getaffinity")
    found = [path.name for path in PACKAGE.rglob("*.py") if counted.search(path.read_text())]
    assert found == ["cores.py"]

# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Helpers of studies: the cache, the joint table of attractors, films of a motion."""

import numpy as np
import pytest
import separatrix as sx
from PIL import Image
from separatrix import cache
from separatrix.figures import animation

CASE = """
body.mass = 2
restoring = { law = "linear", stiffness = 200 }
friction = { law = "viscous", damping = 1 }
contact = { law = "newton", restitution = 0.7, upper = "30 mm" }
drive = { law = "harmonic", amplitude = "10 mm", ratio = 1.25 }
run.duration = 30
attractors.sample = 64
axis = [
  { name = "x0", from = "-120 mm", to = "30 mm", count = 6 },
  { name = "v0", from = "-1.2 m/s", to = "1.2 m/s", count = 6 },
]
"""


@pytest.fixture
def case(separatrix, library, monkeypatch):
    monkeypatch.setenv("SEPARATRIX_PROGRAM", str(separatrix))
    return sx.Case.from_text(CASE)


def test_a_result_is_computed_once(case, tmp_path, monkeypatch):
    """The second call opens the file; another value, argument or version makes another file."""
    calls = []

    def basin(*arguments, output=None, **more):
        calls.append(output.name)
        return sx.basin(*arguments, output=output, **more)

    first = sx.cached(tmp_path / "kept", basin, case, x0=4, v0=4, progress=False)
    again = sx.cached(tmp_path / "kept", basin, case.with_({}), x0=4, v0=4)
    assert len(calls) == 1 and first.identical(again)
    sx.cached(tmp_path / "kept", basin, case.with_(drive__ratio=1.2), x0=4, v0=4)
    sx.cached(tmp_path / "kept", basin, case, x0=5, v0=4)
    sx.cached(tmp_path / "kept", basin, case, x0=np.array([0.0, 0.01]), v0=4)
    monkeypatch.setattr(cache, "version_of_program", lambda: "another")
    sx.cached(tmp_path / "kept", basin, case, x0=4, v0=4)
    assert len(set(calls)) == len(calls) == 5
    assert len(list((tmp_path / "kept").glob("basin_*.h5"))) == 5


def test_a_damaged_file_is_computed_again(case, tmp_path):
    """With a warning that names the file; the result is that of before."""
    first = sx.cached(tmp_path, sx.basin, case, x0=4, v0=4, progress=False).load()
    first.close()
    (path,) = tmp_path.glob("basin_*.h5")
    whole = path.read_bytes()
    for damaged in (b"", whole[:3000], whole[:200] + bytes(len(whole) - 200)):
        path.write_bytes(damaged)
        with pytest.warns(UserWarning, match=f"computed again, as {path}"):
            again = sx.cached(tmp_path, sx.basin, case, x0=4, v0=4, progress=False)
        assert np.array_equal(again.attractor, first.attractor)
        again.close()


def test_the_cache_refuses_what_it_cannot_keep(case, tmp_path):
    with pytest.raises(sx.SeparatrixError, match="trajectory, which writes no file"):
        sx.cached(tmp_path, sx.trajectory, case)
    with pytest.raises(sx.SeparatrixError, match="output given"):
        sx.cached(tmp_path, sx.basin, case, output="x.h5")
    with pytest.raises(sx.SeparatrixError, match="argument of the type object"):
        sx.cached(tmp_path, sx.basin, case, x0=object())


def test_attractors_keep_their_number_over_cases(case):
    """Labels of one map are by their order there: only the joint numbers follow a motion."""
    maps = {ratio: sx.basin(case.with_(drive__ratio=ratio), progress=False) for ratio in (1.1, 1.25, 1.3)}
    found = sx.attractors_of(maps)
    assert found.loc[1.1, "regime"].tolist() == ["impact"]
    assert found.loc[1.25, "regime"].to_dict() == {1: "impact", 2: "non_impact"}
    assert found.loc[1.3, "regime"].to_dict() == {1: "impact", 2: "non_impact"}
    # within its map the motion without impacts is the first
    assert found.loc[(1.25, 2), "attractor"] == 1
    amplitudes = [found.loc[(ratio, 1), "amplitude"] for ratio in maps]
    assert np.all(np.diff(amplitudes) > 0)
    # from the other end: what is there first has the first numbers
    back = sx.attractors_of(dict(reversed(maps.items())))
    assert back.loc[(1.1, 2), "regime"] == "impact"
    assert back.loc[(1.3, 1), "regime"] == "non_impact"


def test_the_joint_table_refuses_other_results(case):
    with pytest.raises(sx.SeparatrixError, match="found a trajectory"):
        sx.attractors_of([sx.trajectory(case, 0.0, 0.0, duration=5)])
    stack = sx.basin(case, {"drive.ratio": [1.25, 1.3]}, progress=False)
    with pytest.raises(sx.SeparatrixError, match="several slices"):
        sx.attractors_of([stack])
    with pytest.raises(sx.SeparatrixError, match="found none"):
        sx.attractors_of([])


@pytest.mark.long
def test_a_film_has_the_frames_of_its_time(case, tmp_path):
    """25 frames in a second of film: two seconds of the motion at half speed are 100."""
    motion = sx.trajectory(case, 0.0, 0.0, duration=10)
    path = motion.separatrix.film(tmp_path / "motion.gif", begin=6, end=8, speed=0.5, dpi=50)
    with Image.open(path) as film:
        assert film.n_frames == 100
        film.seek(0)
        first = np.asarray(film.convert("L"), float)
        film.seek(40)
        assert np.abs(np.asarray(film.convert("L"), float) - first).mean() > 0.2


@pytest.mark.long
def test_a_film_of_several_bodies_and_of_an_angle(separatrix, library, source_dir, tmp_path, monkeypatch):
    monkeypatch.setenv("SEPARATRIX_PROGRAM", str(separatrix))
    for name in ("structure_impact_damper", "basin_pendulum"):
        motion = sx.trajectory(source_dir / "examples" / f"{name}.toml", 0.1, 0.0, duration=20)
        with Image.open(motion.separatrix.film(tmp_path / f"{name}.gif", begin=15, end=16, dpi=40)) as film:
            assert film.n_frames == 25


def test_a_film_that_cannot_be_made_is_refused(case, tmp_path, monkeypatch):
    motion = sx.trajectory(case, 0.0, 0.0, duration=5)
    monkeypatch.setattr(animation, "ffmpeg", lambda: None)
    with pytest.raises(sx.SeparatrixError, match="needs ffmpeg"):
        motion.separatrix.film(tmp_path / "a.mp4")
    with pytest.raises(sx.SeparatrixError, match=r"allowed are .gif and .mp4"):
        motion.separatrix.film(tmp_path / "a.avi")
    with pytest.raises(sx.SeparatrixError, match="allowed within 0 s to 5 s"):
        motion.separatrix.film(tmp_path / "a.gif", begin=4, end=6)
    with pytest.raises(sx.SeparatrixError, match="samples from .* allowed two or more"):
        motion.separatrix.film(tmp_path / "a.gif", begin=1, end=1.0001)
    for given in ({"speed": "fast"}, {"frames_per_second": 0}, {"begin": "1 s"}, {"end": [1]}, {"dpi": 0.5}):
        (name,) = given
        with pytest.raises(sx.SeparatrixError, match=f"film: {name}: found .*, allowed a"):
            motion.separatrix.film(tmp_path / "a.gif", **given)
    with pytest.raises(sx.SeparatrixError, match="frames, allowed 3000"):
        motion.separatrix.film(tmp_path / "a.gif", begin=0, end=5, speed=1e-4)
    assert not list(tmp_path.iterdir())

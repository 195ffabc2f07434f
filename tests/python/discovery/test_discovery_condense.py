# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Condensed records keep the information of the samples: least squares and noise, in proportional memory."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from separatrix.discovery.fitting import noise
from separatrix.discovery.fitting.data import gather
from separatrix.discovery.measured import tables
from separatrix.discovery.measured.condense import (
    _basis,
    _block_noise,
    condense,
    expected_left,
    stride,
)
from separatrix.discovery.measured.preflight import Prepared
from separatrix.discovery.measured.records import make_record, read_record
from separatrix.discovery.policy import RECORDS
from separatrix.errors import SeparatrixError

RATE, PERIOD, SIGMA = 10_000.0, 0.7, 1e-5
KINK = 5.00037


def moving(seconds: float = 7.0, sigma: float = SIGMA, seed: int = 0):
    """An oscillation with a second harmonic, sampled far faster than it moves."""
    t = np.arange(int(seconds * RATE)) / RATE
    x = 0.2 * np.sin(2 * np.pi * t / PERIOD) + 0.02 * np.cos(4 * np.pi * t / PERIOD + 1)
    x = x + sigma * np.random.default_rng(seed).standard_normal(t.size)
    return make_record("moving", {"t": t, "x": x}, {"units": "s, m", "sampling_rate_hz": RATE})


def condensed(record, sigma: float = SIGMA, kept=None, slow=None):
    none = np.zeros(record.t.size, bool)
    events = (none if kept is None else kept, none if slow is None else slow, 20.0)
    return condense(record, PERIOD * RATE, sigma, events)


@pytest.mark.parametrize("size", [16, 64, 256])
def test_values_of_a_block_have_independent_errors_and_follow_their_degree(size):
    q, nodes, values = _basis(size)
    weights = values @ q[:, : RECORDS.block_values].T
    covariance = weights @ weights.T
    assert np.allclose(covariance, np.diag(_block_noise(size, 0.0)[0] ** 2), atol=1e-12)
    for degree in range(RECORDS.block_values + 1):
        # one degree more than the polynomial has
        assert np.allclose(weights @ np.arange(size) ** float(degree), nodes**degree, rtol=1e-9)


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.8])
def test_noise_with_memory_spreads_the_values_and_leaves_what_is_expected(memory):
    size, random = 64, np.random.default_rng(3)
    lags = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
    drawn = random.standard_normal((20_000, size)) @ np.linalg.cholesky(memory**lags).T
    q, _, values = _basis(size)
    terms = drawn @ q[:, : RECORDS.block_values]
    assert np.allclose(np.std(terms @ values.T, axis=0), _block_noise(size, memory)[0], rtol=0.03)
    rest = drawn - terms @ q[:, : RECORDS.block_values].T
    power, product = expected_left(size, memory)
    assert np.isclose(np.mean(np.sum(rest**2, axis=1)), power, rtol=0.02)
    assert np.isclose(np.mean(np.sum(rest[:, 1:] * rest[:, :-1], axis=1)), product, atol=0.02 * power)


@pytest.mark.parametrize("memory", [0.3, 0.5, 0.8])
def test_rows_are_linked_as_the_noise_of_their_samples(memory):
    """Spreads and correlations of neighbours against weights times the dense covariance of the samples."""
    record = moving(0.3)
    kept = np.zeros(record.t.size, bool)
    kept[900:960] = True
    rows = condensed(record, kept=kept)
    count = rows.size.size
    assert len(rows.lengths) > 1
    assert np.any(rows.size == 1)
    spans, weights = [], []
    for k in range(count):
        size, node = int(rows.size[k]), int(rows.node[k])
        if size == 1:
            spans.append((round(rows.offset[k]), 1))
            weights.append(np.ones(1))
        else:
            q, nodes, values = _basis(size)
            spans.append((round(rows.offset[k] - nodes[node]), size))
            weights.append((values @ q[:, : RECORDS.block_values].T)[node])
    design = np.zeros((count, max(first + size for first, size in spans)))
    for k, ((first, size), weight) in enumerate(zip(spans, weights, strict=True)):
        design[k, first : first + size] = weight
    lags = np.abs(np.subtract.outer(np.arange(design.shape[1]), np.arange(design.shape[1])))
    covariance = design @ (memory**lags) @ design.T
    spread = np.sqrt(np.diag(covariance))
    assert np.allclose(rows.spread(memory), spread, rtol=1e-6)
    beside = np.diag(covariance, -1) / (spread[1:] * spread[:-1])
    assert np.allclose(rows.links(memory)[1:], beside, atol=1e-9)


def test_a_fit_to_the_rows_is_the_fit_to_the_samples():
    """Value and error of every parameter of a motion that is linear in them."""
    record = moving()
    rows = condensed(record)
    assert rows.t.size < record.t.size / 20

    def fitted(t, x, size):
        columns = [f(n * 2 * np.pi * t / PERIOD) for n in (1, 2) for f in (np.sin, np.cos)]
        design = np.column_stack([*columns, t, np.ones(t.size)]) / size[:, None]
        covariance = np.linalg.inv(design.T @ design)
        return covariance @ design.T @ (x / size), np.sqrt(np.diag(covariance))

    every, error = fitted(record.t, record.x, np.full(record.t.size, SIGMA))
    few, same = fitted(rows.t, rows.x, SIGMA * rows.spread(0.0))
    assert np.allclose(same, error, rtol=1e-3)
    assert np.all(np.abs(few - every) < 0.05 * error)


def test_the_residual_of_blocks_is_the_noise():
    record = moving()
    rows = condensed(record)
    assert np.isclose(np.sqrt(rows.left.sum() / rows.freedom.sum()), SIGMA, rtol=0.01)


def test_samples_stay_around_events_and_where_a_kink_shows():
    record = moving()
    kept, slow = np.zeros((2, record.t.size), bool)
    kept[20_000:20_040] = True
    slow[30_000:30_100] = True
    # a kink that nobody flagged
    record.x = record.x + np.where(record.t > KINK, 0.5 * (record.t - KINK), 0.0)
    rows = condensed(record, kept=kept, slow=slow)
    single = np.zeros(record.t.size, bool)
    single[rows.offset[rows.size == 1].astype(int)] = True
    assert single[kept].all()
    assert rows.size[(rows.offset >= 30_000) & (rows.offset < 30_100)].max() <= 16
    assert rows.size[np.abs(rows.t - KINK) < 2e-4].max() == 1
    assert np.median(rows.size[np.abs(rows.t - KINK) > 0.1]) >= 256


def test_motions_of_few_samples_and_short_records_are_left_alone():
    assert stride(400, 100_000) == 1
    assert stride(1340, 6210) == 1
    assert stride(1340, 100_000) > 1


def test_gaps_stay_gaps():
    record = moving()
    cut = make_record(
        "gap",
        {"t": np.delete(record.t, slice(9000, 9100)), "x": np.delete(record.x, slice(9000, 9100))},
        {"units": "s, m"},
    )
    rows = condensed(cut)
    assert len(rows.pieces) == 2
    (first, last), (after, _) = rows.pieces
    assert last == after
    assert rows.t[last - 1] < 0.9 < 0.91 <= rows.t[after] + 1e-9
    assert first == 0


def test_records_that_cannot_be_condensed_are_refused_with_words(monkeypatch):
    record = moving(1.0)
    monkeypatch.setattr("separatrix.discovery.measured.condense.RECORDS", replace(RECORDS, most_rows=1000))
    with pytest.raises(SeparatrixError, match="keep every 10th row"):
        condensed(record, kept=np.ones(record.t.size, bool))


@pytest.mark.parametrize(("most", "factor"), [(200_000, 1), (1500, 4)])
def test_condensing_beyond_the_noise_is_reported(monkeypatch, most, factor):
    """If too many rows would stay, blocks need not be smooth within the noise."""
    monkeypatch.setattr("separatrix.discovery.measured.condense.RECORDS", replace(RECORDS, most_rows=most))
    prepared = Prepared(moving(), SIGMA, np.inf, 0.0)
    gather([prepared], 1.0, None)
    count = prepared.samples.t.size
    assert count <= most
    assert prepared.samples.factor == factor
    (text,) = (note for note in prepared.notes if "condensed" in note)
    if factor == 1:
        assert text.endswith(f"in which it is smooth are condensed to {count} values of equal information")
    else:
        assert text.endswith(f"smooth within {factor} times the noise are condensed to {count} values")


def test_the_expected_noise_is_that_of_dense_projections():
    """Against the projectors themselves, which nothing else forms any more."""
    random = np.random.default_rng(0)
    length, counts = 40, np.array([40, 33])
    basis = np.zeros((2, length, 4))
    for k, n in enumerate(counts):
        basis[k, :n] = np.linalg.qr(random.standard_normal((n, 4)))[0]
    powers, products = noise._expected(basis, counts)
    left = np.stack(
        [np.diag((np.arange(length) < n) * 1.0) - b @ b.T for n, b in zip(counts, basis, strict=True)]
    )
    shifted = left[:, 1:].transpose(0, 2, 1) @ left[:, :-1]
    lags = np.abs(np.subtract.outer(np.arange(length), np.arange(length)))
    for i, memory in enumerate(noise._MEMORIES):
        covariance = np.where(lags == 0, 1.0, np.sign(memory) ** lags * np.abs(memory) ** lags)
        assert np.allclose(powers[i], np.sum(left * covariance, axis=(1, 2)))
        assert np.allclose(products[i], np.sum(shifted * covariance, axis=(1, 2)))


def test_reading_takes_memory_in_proportion_to_the_file(tmp_path):
    path = tmp_path / "long.csv"
    record = moving()
    with path.open("w") as file:
        file.write("# units: s, m\nt,x\n")
        np.savetxt(file, np.column_stack([record.t, record.x]), fmt="%.9g", delimiter=",")
    tracemalloc.start()
    read = read_record(path)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert np.array_equal(read.t, np.loadtxt(path, delimiter=",", skiprows=2)[:, 0])
    assert most < 20 * path.stat().st_size


def long_csv(path, first_row: str = "", pause: str = "", end: str = "\n", count: int = 1000):
    """So many rows, the first of which may be short, with a comment among them or none."""
    t = np.arange(count) / 100
    rows = [f"{a:.12f},{np.sin(a):.25f}" for a in t]
    rows[0] = first_row or rows[0]
    rows[count // 2] += pause
    path.write_text(end.join(["# units: s, m", "# operator: none", "t,x", *rows, ""]), newline="")
    return path


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("pause", ["", "\n# a pause"])
@pytest.mark.parametrize("first_row", ["", "0,0"])
def test_rows_are_counted_and_not_guessed_from_bytes(tmp_path, monkeypatch, end, pause, first_row):
    path = long_csv(tmp_path / "long.csv", first_row, pause.replace("\n", end), end)
    monkeypatch.setattr(tables, "RECORDS", replace(RECORDS, most_samples=1000))
    assert read_record(path).t.size == 1000
    monkeypatch.setattr(tables, "RECORDS", replace(RECORDS, most_samples=999))
    with pytest.raises(SeparatrixError, match=r"about 1e\+03 samples.*every 2th row"):
        read_record(path)


def test_lines_are_counted_across_chunks_and_without_an_end(tmp_path, monkeypatch):
    path = tmp_path / "short.csv"
    path.write_text("# one: 1\n# two: 2\nt,x\n0,1\n# three\n1,2")
    for size in range(1, 12):
        monkeypatch.setattr(tables, "RECORDS", replace(RECORDS, chunk=size))
        assert tables._count_lines(path) == (6, 3)


@pytest.mark.parametrize("pause", ["", "\n# a pause"])
def test_too_long_a_record_is_refused_before_it_is_read(tmp_path, monkeypatch, pause):
    path = long_csv(tmp_path / "long.csv", pause=pause)
    monkeypatch.setattr(tables, "RECORDS", replace(RECORDS, most_samples=100))
    monkeypatch.setattr(tables, "_parsed", None)
    monkeypatch.setattr(np, "loadtxt", None)
    with pytest.raises(SeparatrixError, match=r"about 1e\+03 samples.*every 10th row"):
        read_record(path)

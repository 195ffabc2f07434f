# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewer in headless Chromium: skipped without it or Playwright (scripts/bootstrap.sh --browser)."""

import base64
import os
import re
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
from program import succeed
from sample_files import write_boundary
from separatrix import palette
from separatrix.view.export import export_page
from separatrix.view.protocol import Desk
from separatrix.view.server import Server
from test_view_server import start_command

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
pytestmark = [
    pytest.mark.usefixtures("library"),
    pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed"),
]
FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update",
]  # fmt: skip
SIZE = {"width": 1280, "height": 900}


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    """One Chromium for all tests."""
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where views are kept."""
    return tmp_path_factory.mktemp("kept")


@pytest.fixture(scope="module")
def server(results: dict[str, Path], branch_file: Path, folder: Path, build_dir: Path) -> Iterator[Server]:
    """A viewer of a map, a stack, a sweep, a map over parameters, and branches."""
    os.environ.setdefault("SEPARATRIX_LIBRARY", str(build_dir / "lib" / "libseparatrix.so"))
    files = [results[kind] for kind in ("map", "stack", "sweep", "plane")]
    desk = Desk([*files, branch_file], folder)
    with Server(desk) as server:
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        yield server
        server.shutdown()
    desk.close()


@pytest.fixture
def page(browser: object, server: Server) -> Iterator[object]:
    """A page of the viewer; nothing may be written to its console."""
    page = browser.new_page(viewport=SIZE, accept_downloads=True)
    messages: list[str] = []
    # The tests read pixels back, which the viewer never does.
    page.on(
        "console", lambda one: messages.append(one.text) if "willReadFrequently" not in one.text else None
    )
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.goto(server.address)
    page.wait_for_selector("canvas.map")
    ready(page)
    yield page
    assert messages == []
    page.close()


def ready(page: object) -> None:
    """Wait until the picture is there."""
    wait(page, "v.map && v.map.painter && v.map.tiles.overview().length > 0 && !v.map.pending")


def wait(page: object, condition: str) -> None:
    """Poll a condition on the viewer `v`: waiting inside the page is against its content security policy."""
    for _ in range(400):
        if look(page, f"Boolean(v && ({condition}))"):
            return
        page.wait_for_timeout(25)
    raise AssertionError(condition)


def look(page: object, expression: str) -> object:
    """Return an expression of the viewer `v`."""
    return page.evaluate(
        f"() => {{ const v = document.getElementById('separatrix').viewer; return {expression}; }}"
    )


def at_point(page: object, i: float, j: float) -> tuple[float, float]:
    """Return the pixel of an index coordinate within the map."""
    return tuple(look(page, f"[v.map.px({i}), v.map.py({j})]"))


def colour_at(page: object, x: float, y: float) -> list[int]:
    """Return the colour of a pixel of the map."""
    return look(page, f"Array.from(v.canvas.getContext('2d').getImageData({x}, {y}, 1, 1).data).slice(0, 3)")


def test_pixels_have_the_colours_of_the_file(page: object, results: dict[str, Path], server: Server) -> None:
    """The token is not left in the address; points of the map, and what is reported about them."""
    assert server.token not in page.url
    with h5py.File(results["map"]) as file:
        labels, times = file["attractor"][()], file["settle_time"][()]
    colours = {0: palette.NOTHING, 1: palette.ATTRACTORS[0], 2: palette.ATTRACTORS[1]}
    shown = {label: list(bytes.fromhex(colour[1:])) for label, colour in colours.items()}
    chance = np.random.default_rng(2)
    marks = look(page, "v.map.marks.map((m) => [m.x, m.y])")
    assert len(marks) >= 2
    for i, j in chance.integers(0, labels.shape, (40, 2)):
        x, y = at_point(page, i, j)
        if colour_at(page, x + 3, y + 3) != shown[labels[i, j]]:
            near = [abs(a / 1.1 * 18 - i) < 1 and abs((b + 6) / 12 * 30 - j) < 1 for a, b in marks]
            assert any(near), (i, j)
    i, j = 4, 20
    page.locator("canvas.map").hover(position=dict(zip("xy", at_point(page, i, j), strict=True)))
    page.wait_for_selector(".values :text('settle time')")
    text = page.locator(".values").inner_text()
    assert f"attractor {labels[i, j]}" in text
    assert f"settle time {float(f'{times[i, j]:.5g}'):g}" in text


def test_a_click_shows_the_motion_of_points(
    page: object, server: Server, separatrix: Path, tmp_path: Path, results: dict[str, Path]
) -> None:
    """Numbers to the bit, downloads, time, machine; then the same by keyboard alone."""
    x, y = at_point(page, 6, 18)
    page.locator("canvas.map").click(position={"x": x, "y": y})
    wait(page, "v.panel.motion")
    start = look(page, "v.panel.motion.start")
    (tmp_path / "one.csv").write_text(f"x0,v0\n{start[0]!r},{start[1]!r}\n")
    succeed(
        separatrix,
        "points",
        results["map"].parent / "case.toml",
        "--list",
        "one.csv",
        "-o",
        "end.h5",
        folder=tmp_path,
    )
    with h5py.File(tmp_path / "end.h5") as file:
        assert look(page, "[v.panel.motion.summary.x, v.panel.motion.summary.v]") == [
            file["x"][0],
            file["v"][0],
        ]
    with page.expect_download() as caught:
        page.get_by_role("button", name="Events as CSV").click()
    assert Path(caught.value.path()).read_text().startswith("kind,time,x,v_before,v_after\n")
    with page.expect_download() as caught:
        page.get_by_role("button", name="Case file").click()
    assert "[start]\n" in Path(caught.value.path()).read_text()
    page.get_by_role("button", name="Play").click()
    wait(page, "v.panel.time > 0")
    page.get_by_role("button", name="Pause").click()
    before = look(page, "v.panel.motion.start")
    page.locator("canvas.map").focus()
    for key in ("ArrowRight", "ArrowRight", "ArrowDown", "Enter"):
        page.keyboard.press(key)
    wait(page, f"v.panel.motion.start[0] !== {before[0]!r}")
    page.keyboard.press("+")
    wait(page, "v.map.view.a1 - v.map.view.a0 < 12")
    page.keyboard.press("0")
    assert look(page, "v.map.view.a0") == -0.5


def test_zooms_beyond_the_file_and_keeps(page: object, folder: Path) -> None:
    """Live labels at the resolution of the screen, stopped by a pan, then kept as a file that opens."""
    page.set_viewport_size({"width": 640, "height": 600})
    box = page.locator("canvas.map").bounding_box()
    page.mouse.move(box["x"] + box["width"] * 0.6, box["y"] + box["height"] * 0.5)
    for _ in range(4):
        page.mouse.wheel(0, -300)
    wait(page, "v.live.picture && v.live.picture.stride === 1")
    assert "computed now, not in the file" in page.locator("[role=status]").inner_text()
    assert set(look(page, "Array.from(new Set(v.live.picture.arrays.attractor))")) <= {0, 1, 2}
    number = look(page, "v.live.number")
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] * 0.5, box["y"] + box["height"] * 0.55, steps=4)
    page.mouse.up()
    wait(page, f"v.live.number > {number} && v.live.picture.number > {number} && v.live.picture.stride === 1")
    page.get_by_role("button", name="Keep this view").click()
    wait(page, "v.status.textContent.startsWith('wrote')")
    kept = look(page, "v.status.textContent").removeprefix("wrote ")
    with h5py.File(folder / kept) as file:
        shown = look(page, "Array.from(v.live.picture.arrays.attractor)")
        np.testing.assert_array_equal(file["attractor"][()].T.ravel(), shown)


def test_variables_slices_legend_and_sweep(page: object) -> None:
    """Every variable; a class hidden and shown; the slider of a stack; a click in the sweep moves it."""
    show = page.get_by_label("Show").first
    count = show.locator("option").count()
    for i in range(count):
        show.select_option(str(i))
        ready(page)
    show.select_option("1")
    ready(page)
    button = page.locator(".legend button.class").first
    button.click()
    assert page.locator(".legend button.class").first.get_attribute("aria-pressed") == "false"
    page.locator(".legend button.class").first.click()
    page.get_by_label("Map").first.select_option("1")
    ready(page)
    slider = page.locator(".slider input")
    slider.focus()
    before = look(page, "v.at.join()")
    page.keyboard.press("ArrowRight")
    wait(page, f"v.at.join() !== '{before}'")
    sweep = page.locator("section[aria-label=Sweep] canvas")
    sweep.scroll_into_view_if_needed()
    pixel = look(page, "[v.links.diagrams[0].plot.x(1.1), v.links.diagrams[0].plot.box[1] + 40]")
    sweep.click(position={"x": pixel[0], "y": pixel[1]})
    wait(page, "v.at[0] === 0")
    assert look(page, "v.links.diagrams[0].marked") == pytest.approx(1.1)
    page.get_by_label("Map").first.select_option("0")
    ready(page)
    pixel = look(page, "[v.links.diagrams[0].plot.x(1.0), v.links.diagrams[0].plot.box[1] + 40]")
    sweep.click(position={"x": pixel[0], "y": pixel[1]})
    wait(page, "v.with['drive.ratio'] !== undefined && v.live.picture && v.live.picture.stride > 0")
    page.get_by_label("Map").first.select_option("2")
    ready(page)
    assert look(page, "v.variable.name") == "regime"


def test_branches_are_linked_with_the_map(page: object, branch_file: Path) -> None:
    """The saddle at the ratio of the map is drawn in it; a click on a branch shows that ratio."""
    with h5py.File(branch_file) as file:
        over, x, v, branch, stable = (file[name][()] for name in ("parameter", "x", "v", "branch", "stable"))
    joined = (branch[1:] == branch[:-1]) & ((over[1:] - 1.2) * (over[:-1] - 1.2) < 0)
    pieces = np.flatnonzero(joined & (stable[1:] & stable[:-1] == 0))
    share = (1.2 - over[pieces]) / (over[pieces + 1] - over[pieces])
    expected = [(1 - share) * one[pieces] + share * one[pieces + 1] for one in (x, v)]
    assert len(pieces) == 1
    wait(page, "v.map.marks.some((m) => m.kind === 'saddle')")
    marks = look(page, "v.map.marks.filter((m) => m.kind === 'saddle').map((m) => [m.x, m.y])")
    np.testing.assert_allclose(marks, np.transpose(expected), rtol=1e-12)
    assert colour_at(page, *at_point(page, marks[0][0] / 1.1 * 18, (marks[0][1] + 6) / 12 * 30)) == [255] * 3
    # the motion from a saddle returns to it, as far as the line between two points of the branch allows
    x0, v0 = marks[0]
    asked = f"{{file: 0, at: '0,0', x: {x0}, v: {v0}, angle: 0, periods: 1, samples: 0}}"
    answer = look(page, f"v.transport.ask('motion', {asked})")
    assert [answer["summary"]["x"], answer["summary"]["v"]] == pytest.approx(marks[0], abs=2e-3)
    table = page.locator("section[aria-label=Branches] tbody tr")
    assert table.count() == np.count_nonzero(joined)
    assert "period 1, unstable" in " ".join(table.all_inner_texts())
    diagram = page.locator("section[aria-label=Branches] canvas")
    diagram.scroll_into_view_if_needed()
    point = int(np.flatnonzero((stable == 0) & (over > 1.13) & (over < 1.17))[0])
    pixel = look(page, f"((d) => [d.plot.x({over[point]}), d.plot.y(d.answer.arrays.amplitude[{point}])])"
                 "(v.links.diagrams[1])")  # fmt: skip
    diagram.click(position={"x": pixel[0], "y": pixel[1]})
    wait(page, "v.with['drive.ratio'] && v.live.picture && v.map.marks.some((m) => m.kind === 'saddle')")
    assert look(page, "v.with['drive.ratio']") == pytest.approx(over[point], abs=0.01)
    assert look(page, "v.links.diagrams[1].marked") == look(page, "v.links.diagrams[0].marked")
    before = look(page, "v.with['drive.ratio']")
    diagram.focus()
    page.keyboard.press("ArrowRight")
    wait(page, f"v.with['drive.ratio'] > {before}")
    assert look(page, "v.links.differs(v.links.diagrams[1])") == ""
    look(page, "v.with = { 'contact.restitution': 0.6 }")
    assert look(page, "v.links.differs(v.links.diagrams[1])") == "contact.restitution"
    assert look(page, "v.links.saddles.length") == 0
    # a stack of maps shows its slice
    page.get_by_label("Map").first.select_option("1")
    ready(page)
    diagram.click(position={"x": look(page, "v.links.diagrams[1].plot.x(1.29)"), "y": 20})
    wait(page, "v.at[0] === 2 && Math.abs(v.links.diagrams[1].marked - 1.3) < 1e-12")


def test_boundaries_are_drawn_over_their_map(
    browser: object, results: dict[str, Path], tmp_path: Path, library: Path
) -> None:
    """The map beside the file opens with it; curves and saddles of its slice, none of others."""
    stack = tmp_path / "stack.h5"
    shutil.copy(results["stack"], stack)
    desk = Desk([write_boundary(tmp_path / "boundary.h5", stack), results["map"]])
    with Server(desk) as server:
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        page = browser.new_page(viewport=SIZE)
        messages: list[str] = []
        page.on("pageerror", lambda error: messages.append(str(error)))
        page.goto(server.address)
        page.wait_for_selector("canvas.map")
        ready(page)
        panel = page.locator("section[aria-label=Boundaries]")
        assert look(page, "v.map.curves.length") == 0
        assert "Open stack.h5 with it" in panel.inner_text()
        page.get_by_label("Map").first.select_option("1")
        ready(page)
        assert look(page, "[v.at[0], v.map.curves.length, v.boundaries[0].saddles.length]") == [1, 0, 0]
        slider = page.locator(".slider input")
        slider.focus()
        for key, piece, x in (("ArrowRight", 1, 0.25), ("Home", 0, 0.85)):
            page.keyboard.press(key)
            wait(page, f"v.map.marks.some((m) => m.kind === 'saddle' && m.x === {x}) && !v.map.pending")
            assert look(page, "v.map.curves.length") == 1
            assert look(page, "v.map.marks.filter((m) => m.kind === 'saddle').map((m) => [m.x, m.y])") == [
                [x, 0]
            ]
            assert look(page, "v.map.curves[0].xs.length") == 41
            page.wait_for_timeout(100)
            pixel = look(page, "[v.map.px(v.map.curves[0].xs[10]), v.map.py(v.map.curves[0].ys[10])]")
            dark = colour_at(page, *pixel)
            assert max(dark) < 110 if piece == 0 else dark != colour_at(page, pixel[0], pixel[1] - 30)
        assert panel.locator("tbody tr").count() == 2
        panel.get_by_label("draw them over the map").uncheck()
        assert look(page, "v.map.curves.length") == 0
        assert messages == []
        page.close()
        server.shutdown()
    desk.close()


@pytest.mark.long
def test_two_tabs_and_a_server_that_stops(browser: object, results: dict[str, Path], library: Path) -> None:
    """Both tabs work; when the server is gone they report it."""
    process, address = start_command(results)
    context = browser.new_context(viewport=SIZE)
    pages = [context.new_page() for _ in range(2)]
    for page in pages:
        page.goto(address)
        page.wait_for_selector("canvas.map")
        ready(page)
    for page in pages:
        page.locator("canvas.map").click(position={"x": 300, "y": 200})
        wait(page, "v.panel.motion")
    pages[0].reload()
    pages[0].wait_for_selector("canvas.map")
    ready(pages[0])
    stranger = context.new_page()
    stranger.goto(address.partition("#")[0])
    stranger.wait_for_selector(".problem:not([hidden])")
    assert "token" in stranger.locator(".problem").inner_text()
    process.kill()
    process.wait()
    for page in pages:
        page.locator("canvas.map").click(position={"x": 350, "y": 250})
        page.wait_for_selector(".problem:not([hidden])")
        assert "does not answer" in page.locator(".problem").inner_text()
    context.close()


def test_the_exported_page_works_offline(
    browser: object, results: dict[str, Path], branch_file: Path, tmp_path: Path
) -> None:
    """One file, no network, no outside address: map, table, diagrams, stored motions, empty console."""
    path = tmp_path / "page.html"
    size = export_page([results["map"], results["stack"], results["sweep"], branch_file], path, 36)
    assert size < 3e6
    text = path.read_text()
    assert re.findall(r"https?://[^\s\"'<]+", text) == []
    context = browser.new_context(viewport=SIZE, offline=True)
    page = context.new_page()
    messages: list[str] = []
    page.on("console", lambda message: messages.append(message.text))
    page.on("pageerror", lambda error: messages.append(str(error)))
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(path.as_uri())
    page.wait_for_selector("canvas.map")
    ready(page)
    page.locator("canvas.map").click(position={"x": 400, "y": 250})
    wait(page, "v.panel.motion")
    assert look(page, "v.panel.motion.arrays.x.length") > 1000
    assert page.locator("table tbody tr").count() >= 2
    wait(page, "v.map.marks.some((m) => m.kind === 'saddle')")
    page.get_by_label("Map").first.select_option("1")
    ready(page)
    assert messages == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []
    context.close()


def test_can_be_read_and_used_by_everybody(page: object) -> None:
    """Names of controls, contrast of texts, no width that scrolls sideways."""
    unnamed = page.evaluate(
        """() => Array.from(document.querySelectorAll('button, select, input, canvas'))
           .filter((e) => e.offsetParent && !(e.getAttribute('aria-label') || e.textContent.trim()))
           .filter((e) => !e.closest('label')).map((e) => e.outerHTML)"""
    )
    assert unnamed == []
    poor = page.evaluate(
        """() => {
          const linear = (v) => (v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
          const weights = [0.2126, 0.7152, 0.0722];
          const light = (c) => weights.reduce((sum, weight, i) => sum + weight * linear(c[i] / 255), 0);
          const parse = (text) => text.match(/[\\d.]+/g).map(Number);
          const back = (e) => {
            for (; e; e = e.parentElement) {
              const c = parse(getComputedStyle(e).backgroundColor);
              if (c.length === 3 || c[3] > 0) return c;
            }
            return [255, 255, 255];
          };
          const written = (e) => Array.from(e.childNodes).some((n) => n.nodeType === 3 && n.data.trim());
          const ratio = (e) => {
            const [a, b] = [light(parse(getComputedStyle(e).color)), light(back(e))];
            return (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
          };
          return Array.from(document.querySelectorAll('.separatrix *'))
            .filter((e) => e.offsetParent && written(e) && ratio(e) < 4.5)
            .map((e) => e.outerHTML.slice(0, 80));
        }"""
    )
    assert poor == []
    assert "period" in page.locator("canvas.map").get_attribute("aria-label")
    for width in (1280, 700, 320):
        page.set_viewport_size({"width": width, "height": 800})
        page.wait_for_timeout(100)
        assert page.evaluate("() => document.documentElement.scrollWidth") <= width


def test_the_widget_of_notebooks(browser: object, results: dict[str, Path]) -> None:
    """The same module over a kernel's messages: map, motion, stopped work, refusals."""
    widget = pytest.importorskip("separatrix.view.widget", reason="anywidget is not installed")
    viewer = widget.Viewer(results["map"])
    sent: list[tuple[dict, list[bytes]]] = []
    viewer.send = lambda message, buffers=None: sent.append((message, buffers or []))

    def kernel(message: dict) -> list:
        sent.clear()
        viewer._answer(message)
        reply, buffers = sent[-1]
        return [reply, base64.b64encode(buffers[0]).decode() if buffers else ""]

    page = browser.new_page(viewport=SIZE)
    messages: list[str] = []
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.expose_function("kernel", kernel)
    page.set_content(f"<style>{viewer._css}</style><div id='cell'></div>")
    page.evaluate(
        """async (text) => {
          const listeners = [];
          const model = { on: (name, call) => listeners.push(call), send: async (message) => {
            const [reply, data] = await window.kernel(message);
            const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
            for (const call of listeners) call(reply, data ? [new DataView(bytes.buffer)] : []);
          } };
          const module = await import(URL.createObjectURL(new Blob([text], { type: 'text/javascript' })));
          await module.default.render({ model, el: document.getElementById('cell') });
          document.querySelector('.separatrix').id = 'separatrix';
        }""",
        viewer._esm,
    )
    ready(page)
    page.locator("canvas.map").click(position={"x": 300, "y": 200})
    wait(page, "v.panel.motion")
    assert kernel({"id": 1, "name": "tile", "parameters": {}})[0]["status"] == 400
    assert kernel({"id": 2})[0]["status"] == 400
    assert messages == []
    page.close()


def test_answers_are_as_documented(source_dir: Path) -> None:
    """Every request is in the documentation."""
    from separatrix.view.protocol import REQUESTS

    text = (source_dir / "docs" / "viewer.md").read_text()
    for name in REQUESTS:
        assert f"`{name}`" in text

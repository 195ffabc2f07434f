// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The viewer: files, controls, the map and what belongs to it.
import { Address, restored } from "./address.js";
import { BoundaryPanel } from "./boundaries.js";
import { BranchPanel } from "./branches.js";
import { fill, h, quantity, save, words } from "./dom.js";
import { attractorTable, classLegend, describeAttractor, scaleLegend, wordClass } from "./legend.js";
import { Inspector } from "./inspector.js";
import { Links } from "./links.js";
import { LiveLayer } from "./live.js";
import { marksOf } from "./marks.js";
import { MapView, axisLabel, valueAt } from "./mapview.js";
import { MotionPanel, units } from "./motion.js";
import { PALETTE, Painter, rangeOf } from "./palette.js";
import { PointsPanel, SweepPanel } from "./series.js";
import { Starter, asMotion } from "./starter.js";
import { Tiles } from "./tiles.js";

/** Builds the viewer in an element; returns it once the files are known. */
export async function mount(root, transport) {
  root.classList.add("separatrix");
  const viewer = new Viewer(root, transport);
  try {
    await viewer.start();
  } catch (error) {
    viewer.fail(error);
  }
  root.viewer = viewer;
  return viewer;
}

class Viewer {
  constructor(root, transport) {
    Object.assign(this, { root, transport });
    this.problem = h("div", { class: "problem", role: "alert", hidden: true });
    root.replaceChildren(this.problem);
    this.hidden = new Map();
    this.with = {};
    this.links = new Links(this);
    this.boundaries = [];
    this.inspector = new Inspector(this);
    this.starter = new Starter(this);
    this.address = new Address(this);
  }

  fail(error) {
    if (error.name === "AbortError" || error.status === 409) return;
    this.problem.hidden = false;
    fill(this.problem, error.message);
  }

  async start() {
    this.described = await this.transport.ask("describe");
    Object.assign(PALETTE, this.described.palette);
    const { files } = this.described;
    this.maps = files.map((file, index) => ({ ...file, index })).filter((file) => file.kind === "basin");
    this.panel = new MotionPanel(this.described, this.transport.live ? (what) => this.starter.download(what) : null);
    this.build();
    for (const [index, file] of files.entries()) if (file.kind !== "basin") await this.addSeries(file, index);
    if (this.maps.length) this.openMap(restored());
    this.links.show();
  }

  build() {
    const title = this.described.files.map((file) => file.title || file.name)[0];
    this.controls = h("div", { class: "bar" });
    this.canvas = h("canvas", { class: "map", tabindex: "0", role: "application", "aria-roledescription": "map",
      "aria-describedby": "separatrix-keys" });
    this.sliders = h("div");
    this.legend = h("div");
    this.table = h("div", { class: "scroll" });
    this.hovered = h("div", { class: "values", "aria-live": "polite" });
    this.status = h("p", { class: "note", role: "status" });
    this.tools = h("div", { class: "bar" });
    this.left = h("div", {}, this.controls, this.canvas, this.tools, this.status, this.sliders, this.legend, this.hovered,
      h("p", { class: "note", id: "separatrix-keys" }, "Drag or Shift + arrows: pan. Wheel, pinch, + and −: zoom. Arrows: move the cursor. Enter or click: the motion from there. 0: everything."));
    this.right = h("div", {}, h("section", { "aria-label": "Attractors" }, h("h2", {}, "Attractors"), this.table), this.panel.element);
    this.header = h("header", {}, h("h1", {}, title), h("span", { class: "note" }, this.described.files.map((file) => file.name).join(", ")));
    if (!this.maps.length) this.left.hidden = this.right.firstChild.hidden = true;
    this.root.replaceChildren(this.header, this.problem, this.left, this.right);
    this.map = new MapView(this.canvas, {
      hover: (point, keyed) => this.inspector.hover(point, keyed), pick: (point) => this.starter.pick(point), moved: () => this.moved(),
    });
    this.live = new LiveLayer(this.transport, () => this.planeRequest(), () => this.map.draw(), (text) => { fill(this.status, text); this.inspector.again(); });
    this.map.live = this.live;
  }

  async addSeries(file, index) {
    try {
      const answer = await this.transport.ask("series", { file: index });
      if (file.kind === "sweep") {
        this.right.append(this.links.add(new SweepPanel(file, answer, this.links)));
      } else if (file.kind === "branches") {
        this.right.append(this.links.add(new BranchPanel(file, answer, this.links)));
      } else if (file.kind === "boundary") {
        this.boundaries.push(new BoundaryPanel(file, answer, this));
        this.right.append(this.boundaries.at(-1).element);
      } else if (file.kind === "points") {
        this.right.append(new PointsPanel(file, answer).element);
      } else {
        const panel = this.maps.length ? new MotionPanel(this.described, null) : this.panel;
        panel.download = null;
        this.right.append(panel.element);
        panel.show(asMotion(file, answer), file.machine, `${file.title || file.name}: ${words(file.attributes.regime)}, ended as ${words(file.attributes.reason)}`);
      }
    } catch (error) {
      this.fail(error);
    }
  }

  openMap({ file = 0, variable = null, at = null, view = null }) {
    this.file = this.maps[Math.min(file, this.maps.length - 1)];
    const { axes, variables } = this.file;
    const starts = axes.map((axis, i) => (axis.start ? i : -1)).filter((i) => i >= 0);
    const shown = starts.length >= 2 ? starts : [...starts, ...axes.keys()].filter((i, k, all) => all.indexOf(i) === k);
    [this.across, this.up] = shown.slice(0, 2).sort((a, b) => a - b);
    const given = (at || "").split(",").map(Number);
    this.at = axes.map((axis, i) => (at && given[i] >= 0 && given[i] < axis.count ? given[i] : Math.floor((axis.count - 1) / 2)));
    const slices = axes.filter((axis) => !axis.start).length;
    const first = slices === axes.length ? "regime" : "attractor";
    this.variable = variables.find((one) => one.name === (variable || first)) || variables[0];
    this.with = {};
    this.starter.clear();
    this.buildControls();
    this.map.view = null;
    this.show(false);
    const bounds = (view || "").split(",").map(Number);
    if (bounds.length === 4 && bounds.every(Number.isFinite) && bounds[1] > bounds[0] && bounds[3] > bounds[2]) {
      this.map.view = { a0: bounds[0], a1: bounds[1], b0: bounds[2], b1: bounds[3] };
      this.map.changed();
    }
  }

  buildControls() {
    const { axes, variables } = this.file;
    const option = (value, text, selected) => h("option", { value, selected }, text);
    const files = this.maps.length > 1 ? h("label", {}, "Map", h("select", { onchange: (event) => this.openMap({ file: Number(event.target.value) }) },
      ...this.maps.map((file, i) => option(i, file.title || file.name, file === this.file)))) : null;
    const choose = h("select", { onchange: (event) => { this.variable = variables[Number(event.target.value)]; this.show(true); } },
      ...variables.map((one, i) => option(i, words(one.name), one === this.variable)));
    const axisOptions = (current) => axes.map((axis, i) => option(i, words(axis.key), i === current));
    const planes = axes.length > 2 ? ["across", "up"].map((side) => h("label", {}, side === "across" ? "Across" : "Up",
      h("select", { onchange: (event) => this.chooseAxis(side, Number(event.target.value)) }, ...axisOptions(this[side])))) : [];
    this.checks = {};
    const check = (name, text, on, changed) => {
      this.checks[name] = h("input", { type: "checkbox", checked: on, onchange: changed });
      return h("label", {}, this.checks[name], text);
    };
    const timed = variables.some((one) => one.name === "settle_time");
    fill(this.controls, files, h("label", {}, "Show", choose), ...planes,
      timed ? check("shade", "lightness: time to settle", false, () => this.show(true)) : null,
      check("mix", "mix colours by share", true, () => this.paint()));
    const live = this.transport.live && !this.file.no_motions;
    fill(this.tools,
      h("button", { onclick: () => this.map.zoom(0.5, ...this.centre()), "aria-label": "Zoom in" }, "+"),
      h("button", { onclick: () => this.map.zoom(2, ...this.centre()), "aria-label": "Zoom out" }, "−"),
      h("button", { onclick: () => this.map.reset() }, "Everything"),
      live ? check("follow", "motion under the mouse", false, () => {}) : null,
      live ? check("live", "compute where the file has no more points", true, () => this.moved()) : null,
      live ? h("button", { onclick: () => { this.live.number++; this.live.halt(); fill(this.status, "stopped"); } }, "Stop") : null,
      live && this.described.keeps ? h("button", { onclick: () => this.keep() }, "Keep this view as a file") : null,
      h("button", { onclick: () => this.canvas.toBlob((blob) => save(blob, "map.png")) }, "PNG"));
    if (this.file.no_motions) fill(this.status, `No motions: ${this.file.no_motions}`);
    this.buildSliders();
  }

  buildSliders() {
    const rows = this.file.axes.map((axis, i) => {
      if (i === this.across || i === this.up || axis.count < 2) return null;
      const shown = h("output", {}, this.slicePlace(axis, i));
      const slider = h("input", { type: "range", min: "0", max: String(axis.count - 1), value: String(this.at[i]), "aria-label": axisLabel(axis),
        "aria-valuetext": this.slicePlace(axis, i), oninput: (event) => { this.setSlice(i, Number(event.target.value)); } });
      return h("div", { class: "slider", "data-axis": String(i) }, h("span", {}, axisLabel(axis)), slider, shown);
    });
    fill(this.sliders, ...rows);
  }

  slicePlace(axis, i) { return quantity(valueAt(axis, this.at[i]), axis.unit); }

  setSlice(i, position) {
    this.at[i] = position;
    const row = this.sliders.querySelector(`[data-axis="${i}"]`), axis = this.file.axes[i];
    row.querySelector("input").value = String(position);
    row.querySelector("input").setAttribute("aria-valuetext", this.slicePlace(axis, i));
    fill(row.querySelector("output"), this.slicePlace(axis, i));
    this.with = {};
    clearTimeout(this.sliding);
    this.sliding = setTimeout(() => this.show(true), 30);
  }

  chooseAxis(side, value) {
    const other = side === "across" ? "up" : "across";
    if (this[other] === value) this[other] = this[side];
    this[side] = value;
    this.buildControls();
    this.map.view = null;
    this.show(false);
  }

  get withText() { return Object.entries(this.with).map(([path, value]) => `${path}:${value}`).join(";"); }

  planeRequest() {
    const { index } = this.file;
    const plane = { file: index, across: this.across, up: this.up, at: this.fixedAt().join(",") };
    return this.withText ? { ...plane, with: this.withText } : plane;
  }

  fixedAt() { return this.at.map((value, i) => (i === this.across || i === this.up ? 0 : value)); }

  centre() { const v = this.map.view; return this.map.cursor || [(v.a0 + v.a1) / 2, (v.b0 + v.b1) / 2]; }

  /** Shows the plane and the variable that are chosen. */
  async show(keepView) {
    const { axes, variables } = this.file, plane = this.planeRequest();
    delete plane.with;
    const points = [axes[this.across].count, axes[this.up].count];
    const make = (variable) => {
      const tiles = new Tiles(this.transport, plane, variables.indexOf(variable), points, () => this.loaded(), (error) => this.fail(error));
      tiles.name = variable.name;
      return tiles;
    };
    const slow = this.checks.shade && this.checks.shade.checked && this.variable.name === "attractor" ? make(variables.find((one) => one.name === "settle_time")) : null;
    this.names = { ...this.variable.codes };
    const asked = (this.asking = {});
    this.map.painter = null;
    this.map.show([axes[this.across], axes[this.up]], make(this.variable), slow, keepView);
    this.paint();
    this.listAttractors();
    this.links.show();
    this.moved();
    if (this.variable.name === "event_word") {
      const answer = await this.transport.ask("classes", { ...plane, variable: variables.indexOf(this.variable) }).catch(() => null);
      if (answer && asked === this.asking) this.names = answer.names;
    }
  }

  /** More tiles are there: draw, and settle the range and the legend once. */
  loaded() {
    this.map.draw();
    if (!this.map.tiles) return;
    const seen = this.map.tiles.overview().length, tile = this.map.tiles.has(this.map.tiles.top, 0, 0);
    if (seen && this.sized !== tile) {
      this.sized = tile;
      this.paint();
      if (this.variable.name === "event_word") this.renameWords();
    } else if (this.map.slow && !this.shaded && this.map.slow.overview().length) {
      this.paint();
    }
  }

  async renameWords() {
    const { file, across, up, at } = this.planeRequest();
    const answer = await this.transport.ask("classes", { file, across, up, at, variable: this.file.variables.indexOf(this.variable) }).catch(() => null);
    if (!answer || this.variable.name !== "event_word") return;
    this.names = answer.names;
    this.paint();
  }

  get hiddenNow() {
    const key = `${this.file.index}/${this.variable.name}`;
    if (!this.hidden.has(key)) this.hidden.set(key, new Set());
    return this.hidden.get(key);
  }

  /** Colours of the classes of the variable that have one of their own. */
  get own() { return { attractor: this.file.colours, regime: PALETTE.regimes }[this.variable.name]; }

  /** New colours: of classes, or over the range of the numbers. */
  paint() {
    const { map, variable } = this;
    const overview = map.tiles.overview();
    const offset = { attractor: 1, regime: 1, reason: 1, period: 1, event_word: 0, origin: 0 }[variable.name] ?? 0;
    const shade = map.slow ? this.settling(map.slow.overview()) : null;
    this.shaded = Boolean(shade);
    const options = variable.classes ? {} : rangeOf(overview);
    map.painter = new Painter({ classes: variable.classes, offset, own: this.own, hidden: this.hiddenNow, mix: this.checks.mix.checked, shade, ...options });
    map.classOf = variable.name === "event_word" ? (word) => wordClass(this.names, word) : null;
    if (variable.name === "attractor") fill(this.legend);
    else if (variable.classes) {
      const values = map.tiles.classesSeen();
      const names = variable.name === "period" ? Object.fromEntries(values.map((v) => [v, v ? `period ${v}` : "no known period"])) : this.names;
      fill(this.legend, classLegend({ values, names, offset, own: this.own, hidden: this.hiddenNow, toggle: (value, alone) => this.toggle(value, alone, values) }));
    } else if (overview.length) fill(this.legend, scaleLegend(map.painter, words(variable.name), variable.unit));
    map.draw();
  }

  settling(values) {
    const { range } = rangeOf(values);
    return values.length && range[0] > 0 ? [range[0], Math.max(range[1], 1.01 * range[0])] : null;
  }

  toggle(value, alone, all) {
    const hidden = this.hiddenNow;
    if (alone) {
      const others = all.filter((one) => one !== value), only = others.every((one) => hidden.has(one)) && !hidden.has(value);
      hidden.clear();
      if (!only) others.forEach((one) => hidden.add(one));
    } else if (hidden.has(value)) hidden.delete(value);
    else hidden.add(value);
    this.paint();
    if (this.variable.name === "attractor") this.renderTable();
  }

  sliceNumber() {
    return this.file.axes.reduce((slice, axis, i) => (axis.start ? slice : slice * axis.count + this.at[i]), 0);
  }

  /** The attractors of the slice: those of the file at once, with all their points from the library after that. */
  async listAttractors() {
    const { axes, catalogue, points } = this.file;
    const slices = axes.reduce((count, axis) => (axis.start ? count : count * axis.count), 1);
    const planeHasParameter = !axes[this.across].start || !axes[this.up].start;
    const changed = Object.keys(this.with).length > 0;
    this.fromFile = !changed;
    this.entries = changed || planeHasParameter ? [] : catalogue.filter((one) => one.slice === this.sliceNumber());
    this.total = points / slices;
    this.attractorPoints = [];
    this.renderTable();
    if (this.file.no_motions || planeHasParameter) return this.mark();
    const token = (this.searching = {});
    try {
      const { page } = this.live;
      const parameters = { file: this.file.index, at: this.fixedAt().join(","), page, view: this.live.number };
      const answer = await this.transport.ask("attractors", this.withText ? { ...parameters, with: this.withText } : parameters);
      if (token !== this.searching) return undefined;
      this.attractorPoints = answer.attractors;
      if (changed) this.entries = answer.attractors;
      this.renderTable();
    } catch (error) {
      if (error.status !== 404) this.fail(error);
    }
    return this.mark();
  }

  renderTable() {
    const known = this.entries, counted = known.reduce((sum, one) => sum + (one.count || 0), 0);
    const hidden = this.variable.name === "attractor" ? this.hiddenNow : new Set();
    const labels = [...known.map((one) => one.attractor), 0];
    fill(this.table, ...(known.length ? attractorTable({
      entries: known, total: this.fromFile ? this.total : 0, unlabelled: this.fromFile ? this.total - counted : 0, own: this.file.colours, hidden,
      regimes: this.described.regimes, fromFile: this.fromFile, unit: units(this.file.machine)[0], toggle: (label, alone) => { if (this.variable.name === "attractor") this.toggle(label, alone, labels); },
    }) : [h("p", { class: "note" }, "No attractors are listed for this picture.")]));
    const shares = known.filter((one) => one.count).map((one) => `${describeAttractor(one, this.described.regimes)}: ${((100 * one.count) / this.total).toFixed(1)} %`).join("; ");
    this.canvas.setAttribute("aria-label", `Map of ${words(this.variable.name)} over ${axisLabel(this.file.axes[this.across])} and ${axisLabel(this.file.axes[this.up])}. ${shares}`);
  }

  mark() {
    if (!this.file) return;
    this.map.curves = this.boundaries.flatMap((one) => one.curves());
    this.map.marks = marksOf(this);
    this.map.draw();
  }

  /** The view has changed. */
  moved() {
    if (!this.file || !this.map.view) return;
    this.address.remember();
    this.inspector.again();
    const changed = Object.keys(this.with).length > 0;
    const v = this.map.view, { axes } = this.map;
    const inside = v.a1 - v.a0 < 0.97 * axes[0].count || v.b1 - v.b0 < 0.97 * axes[1].count;
    const fine = inside && Math.max(...this.map.perPixel) < 0.6;
    const beyond = (v.a0 < -0.6 || v.b0 < -0.6 || v.a1 > axes[0].count - 0.4 || v.b1 > axes[1].count - 0.4);
    const wanted = this.transport.live && this.checks.live && this.checks.live.checked && (fine || changed || beyond);
    if (!wanted && this.transport.live) fill(this.status, "");
    this.live.restart(this.map, wanted);
  }

  async keep() {
    const one = this.live.picture, v = this.map.view, [, , width, height] = this.map.box;
    const columns = Math.round(width), rows = Math.round(height);
    const da = (v.a1 - v.a0) / columns, db = (v.b1 - v.b0) / rows;
    const lattice = one && one.stride === 1 ? { a: one.a, da: one.da, b: one.b, db: one.db, columns: one.columns, rows: one.rows } : { a: v.a0 + da / 2, da, b: v.b0 + db / 2, db, columns, rows };
    fill(this.status, "computing and writing …");
    try {
      const answer = await this.transport.ask("keep", { ...this.planeRequest(), page: this.live.page, view: this.live.number, ...lattice }, { act: true });
      fill(this.status, `wrote ${answer.written}`);
    } catch (error) {
      fill(this.status, "nothing was written");
      this.fail(error);
    }
  }
}

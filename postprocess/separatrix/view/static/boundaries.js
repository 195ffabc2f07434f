// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Boundaries between basins as curves over their map, and the saddles that they lead to.
import { fill, h, number, words } from "./dom.js";
import { wordText } from "./legend.js";
import { indexOf } from "./mapview.js";
import { PALETTE } from "./palette.js";

// What a curve leads to: text and dashes; its colour is in the palette.
const LINES = {
  stable_set: ["stable set of a saddle", []], recurrent: ["recurrent edge state", []], graze: ["edge of a graze", [6, 3]],
  stick: ["edge of a set of sticking states", [6, 3]], chatter: ["edge of a completed chatter", [6, 3]], other_event: ["edge at another event", [6, 3]],
  not_known: ["edge state not known", [6, 3, 1, 3]], edge: ["edge of the unlabelled region", [2, 3]],
};

export class BoundaryPanel {
  constructor(file, answer, viewer) {
    Object.assign(this, { file, answer, viewer, axes: file.attributes.axes.split(" ") });
    this.check = h("input", { type: "checkbox", checked: true, onchange: () => viewer.mark() });
    this.status = h("p", { class: "note" });
    const { arrays } = answer, curves = arrays.first.length, found = arrays.across.reduce((sum, one) => sum + (one >= 0), 0);
    this.element = h("section", { "aria-label": "Boundaries" }, h("h2", {}, `Boundaries: ${file.title || file.name}`),
      h("div", { class: "bar" }, h("label", {}, this.check, "draw them over the map"), h("span", { class: "note" }, `${found} points, ${curves} pieces`)),
      this.status, this.legend(), this.table());
  }

  /** The name of a piece. */
  nameOf(piece) {
    const { arrays, variables } = this.answer;
    return arrays.label_one[piece] === 0 || arrays.label_two[piece] === 0 ? "edge" : variables.piece_name.codes[arrays.piece_name[piece]];
  }

  legend() {
    const names = new Set(Array.from(this.answer.arrays.first, (_, piece) => this.nameOf(piece)));
    const entries = [...names].filter((name) => name in LINES).map((name) => {
      const [text, dashes] = LINES[name], colour = PALETTE.boundaries[name], box = h("span", { class: "line", "aria-hidden": "true" });
      box.style.borderTop = `2px ${dashes.length ? (dashes.length > 2 || dashes[0] < 6 ? "dotted" : "dashed") : "solid"} ${colour}`;
      return h("span", {}, box, " ", text);
    });
    return h("div", { class: "legend" }, ...entries);
  }

  table() {
    const { arrays, shapes } = this.answer, count = (arrays.saddles_period || []).length;
    if (!count) return h("p", { class: "note" }, "No saddles were found.");
    const columns = ["saddle", "period", "word", "multipliers", "boundary points"], wide = shapes.saddles_multipliers[1];
    const rows = Array.from({ length: count }, (_, i) => [i + 1, arrays.saddles_period[i], wordText(arrays.saddles_event_word[i]),
      Array.from(arrays.saddles_multipliers.subarray(i * wide, (i + 1) * wide), (one) => number(one, 4)).join(", "), arrays.saddles_boundary_points[i]]);
    return h("div", { class: "scroll" }, h("table", {}, h("thead", {}, h("tr", {}, ...columns.map((text) => h("th", { scope: "col" }, text)))),
      h("tbody", {}, ...rows.map((row) => h("tr", {}, ...row.map((text) => h("td", {}, String(text))))))));
  }

  /** Why nothing can be drawn over the picture; empty if it can. */
  reason() {
    const { file, across, up } = this.viewer;
    if (!file || file.identity !== this.file.attributes.map_identity) return `Open ${this.file.attributes.map} with it: they are the boundaries of that map.`;
    if (Object.keys(this.viewer.with).length) return "The picture is of a machine with other values: its boundaries are not known.";
    const shown = [file.axes[across].key, file.axes[up].key];
    return this.axes.every((name) => shown.includes(name)) ? "" : `They are those over ${this.axes.map(words).join(" and ")}.`;
  }

  /** Whether a piece or an orbit is of the slice that is shown. */
  here(prefix, row) {
    const { file, at } = this.viewer;
    return file.axes.every((axis, i) => this.axes.includes(axis.key) || axis.count < 2 || !(`${prefix}${axis.key}` in this.answer.arrays)
      || Math.abs(indexOf(axis, this.answer.arrays[`${prefix}${axis.key}`][row]) - at[i]) < 1e-6);
  }

  /** The curves of the picture in index coordinates. */
  curves() {
    const reason = this.reason();
    fill(this.status, reason);
    if (reason || !this.check.checked) return [];
    const { file, across, up } = this.viewer, { arrays } = this.answer, found = [];
    const [a, b] = [file.axes[across], file.axes[up]].map((axis) => ({ axis, values: arrays[axis.key] }));
    for (let piece = 0; piece < arrays.first.length; piece++) {
      if (!this.here("piece_", piece)) continue;
      const first = arrays.first[piece], count = arrays.points[piece] + (arrays.closed[piece] ? 1 : 0);
      const [xs, ys] = [a, b].map(({ axis, values }) => Float64Array.from({ length: count }, (_, i) => indexOf(axis, values[first + (i % arrays.points[piece])])));
      found.push({ xs, ys, colour: PALETTE.boundaries[this.nameOf(piece)], dashes: LINES[this.nameOf(piece)][1] });
    }
    return found;
  }

  /** Points of the saddles on the section, for the picture of position and velocity. */
  get saddles() {
    const { arrays } = this.answer;
    if (this.reason() || !this.check.checked || !arrays.saddles_saddle) return [];
    return Array.from(arrays.saddles_saddle, (saddle, i) => ({ x: arrays.saddles_x[i], v: arrays.saddles_v[i], orbit: saddle - 1 }))
      .filter(({ orbit }) => this.here("saddles_", orbit));
  }
}

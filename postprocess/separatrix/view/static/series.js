// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Files that are no maps: diagrams of sweeps, linked with maps, and points of lists.
import { h, prepare, words } from "./dom.js";
import { Diagram, nearest } from "./diagram.js";
import { PALETTE } from "./palette.js";
import { INK, Plot, extent, line } from "./plot.js";

export class SweepPanel extends Diagram {
  constructor(file, answer, links) {
    const { arrays, shapes } = answer;
    const key = Object.keys(arrays).find((name) => shapes[name].length === 1 && shapes.amplitude && shapes[name][0] === shapes.amplitude[1] && answer.variables[name] && name !== "amplitude");
    const names = ["section_x", "section_v", "x_max", "amplitude", "v_max", "mean_impact_speed", "impacts_per_period"].filter((name) => name in arrays);
    super({ file, answer, key, kind: "Sweep", names, note: "orange: run-up, blue: run-down, grey: many starts; click: this value in the map", links });
  }

  get values() { return this.answer.arrays[this.key]; }

  draw() {
    if (!this.canvas.isConnected) return;
    const [context, width, height] = prepare(this.canvas);
    const { arrays, shapes, variables, limits } = this.answer, name = this.select.value;
    const many = name.startsWith("section") ? [] : [`branch_${name}`, name === "x_max" ? "branch_x_min" : ""].filter((one) => one in arrays);
    const runs = name === "x_max" ? ["x_max", "x_min"] : [name];
    const unit = variables[name].unit ? ` (${variables[name].unit})` : "";
    const plot = new Plot(context, width, height, extent(this.values), extent(...runs.map((one) => arrays[one]), ...many.map((one) => arrays[one])),
      [(variables[this.key] || {}).label || words(this.key), `${this.text(name)}${unit}`]);
    this.plot = plot;
    plot.clip(() => {
      for (const one of many) this.dots(plot, arrays[one], shapes[one][1], PALETTE.many, 1.4, 0);
      for (const [direction, colour] of [[1, PALETTE.down], [0, PALETTE.up]]) {
        for (const one of runs) {
          const [, count, samples = 1] = shapes[one], size = count * samples;
          this.dots(plot, arrays[one].subarray(direction * size, (direction + 1) * size), samples, colour, samples > 1 ? 0.9 : 2 - 0.7 * (1 - direction), 0);
        }
      }
      context.strokeStyle = INK;
      context.setLineDash([2, 3]);
      for (const limit of (limits.lower || [])) line(context, plot.x(limit), plot.box[1], plot.x(limit), plot.box[1] + plot.box[3]);
      context.setLineDash([]);
      this.drawMarked(plot);
    });
    plot.frame();
    this.name();
  }

  dots(plot, values, samples, colour, radius) {
    const { context } = plot;
    context.fillStyle = colour;
    for (let i = 0; i < values.length; i++) {
      const x = plot.x(this.values[Math.floor(i / samples)]), y = plot.y(values[i]);
      if (y === y) context.fillRect(x - radius, y - radius, 2 * radius, 2 * radius);
    }
  }

  beside(value, step) {
    const now = value === null ? 0 : nearest(this.values, value);
    return this.values[Math.min(Math.max(now + step, 0), this.values.length - 1)];
  }

  choose(value) { super.choose(this.values[nearest(this.values, value)]); }
}

/** Final states of a list of starts. */
export class PointsPanel {
  constructor(file, answer) {
    Object.assign(this, { file, answer });
    this.canvas = h("canvas", { class: "sweep", role: "img" });
    const codes = answer.variables.regime.codes, counts = new Map();
    for (const regime of answer.arrays.regime) counts.set(regime, (counts.get(regime) || 0) + 1);
    const legend = [...counts].map(([regime, count]) => `${words(codes[regime] || regime)}: ${count}`).join("; ");
    this.element = h("section", { "aria-label": "Points" }, h("h2", {}, file.title || file.name), this.canvas, h("p", { class: "note" }, `${answer.arrays.x.length} points at the end of the duration. ${legend}`));
    this.canvas.setAttribute("aria-label", `States of ${answer.arrays.x.length} points at the end of the duration. ${legend}`);
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  draw() {
    if (!this.canvas.isConnected) return;
    const [context, width, height] = prepare(this.canvas);
    const { x, v, regime } = this.answer.arrays;
    const plot = new Plot(context, width, height, extent(x), extent(v), ["position x (m)", "velocity v (m/s)"]);
    plot.clip(() => {
      for (let i = 0; i < x.length; i++) {
        context.fillStyle = PALETTE.regimes[regime[i]];
        context.fillRect(plot.x(x[i]) - 1.3, plot.y(v[i]) - 1.3, 2.6, 2.6);
      }
    });
    plot.frame();
  }
}

// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Branches of periodic orbits over a parameter, linked with the maps, whose saddles they give.
import { fill, h, number, prepare, quantity, words } from "./dom.js";
import { Diagram } from "./diagram.js";
import { wordText } from "./legend.js";
import { INK, Plot, extent } from "./plot.js";

const SHOWN = ["amplitude", "x", "v", "x_max", "multiplier"];
const UNSTABLE = "#9a3412", NEAR = 25, STEPS = 200;
const MOST_TEXTS = 60;

export class BranchPanel extends Diagram {
  constructor(file, answer, links) {
    const { arrays, shapes } = answer, count = shapes.parameter[0];
    arrays.amplitude = arrays.x_max.map((high, i) => (high - arrays.x_min[i]) / 2);
    arrays.multiplier = Float64Array.from({ length: count }, (_, i) => Math.max(...multipliers(answer, i).map(([re, im]) => Math.hypot(re, im))));
    super({ file, answer, key: file.attributes.parameter.replaceAll(".", "_"), kind: "Branches", names: SHOWN, links,
      note: "full: stable, broken: unstable; click: this value in the map, where a white diamond is a saddle" });
    this.path = file.attributes.parameter;
    this.table = h("div", { class: "scroll" });
    this.element.append(this.table);
  }

  text(name) {
    return { amplitude: "amplitude (xmax − xmin)/2", x: "x on the section", v: "v on the section", multiplier: "largest |multiplier|" }[name] || super.text(name);
  }

  draw() {
    if (!this.canvas.isConnected) return;
    const [context, width, height] = prepare(this.canvas);
    const { arrays, variables } = this.answer, name = this.select.value, shown = name === "x_max" ? ["x_max", "x_min"] : [name];
    const unit = (variables[{ amplitude: "x" }[name] || name] || {}).unit || "";
    const plot = new Plot(context, width, height, extent(arrays.parameter), extent(...shown.map((one) => arrays[one])),
      [words(this.path), `${this.text(name)}${unit ? ` (${unit})` : ""}`]);
    this.plot = plot;
    this.shown = shown;
    plot.clip(() => {
      for (const one of shown) this.drawLines(plot, arrays[one]);
      context.setLineDash([]);
      this.drawMarked(plot);
    });
    this.drawLabels(plot, arrays[shown[0]]);
    plot.frame();
    this.name();
    this.list();
  }

  /** Pieces between two points are stable where both are. */
  drawLines(plot, ys) {
    const { context } = plot, { parameter, branch, stable } = this.answer.arrays;
    for (const wanted of [false, true]) {
      context.strokeStyle = wanted ? INK : UNSTABLE;
      context.lineWidth = wanted ? 1.8 : 1.3;
      context.setLineDash(wanted ? [] : [5, 3]);
      context.beginPath();
      for (let i = 1, end = 0; i < parameter.length; i++) {
        if (branch[i] !== branch[i - 1] || (stable[i] === 1 && stable[i - 1] === 1) !== wanted) continue;
        if (!Number.isFinite(ys[i]) || !Number.isFinite(ys[i - 1])) continue;
        if (end !== i - 1 || i === 1) context.moveTo(plot.x(parameter[i - 1]), plot.y(ys[i - 1]));
        context.lineTo(plot.x(parameter[i]), plot.y(ys[i]));
        end = i;
      }
      context.stroke();
    }
  }

  /** Bifurcations as points, their names beside them where there is room. */
  drawLabels(plot, ys) {
    const { context } = plot, { parameter, label } = this.answer.arrays, taken = [];
    context.font = "11px system-ui, Arial, sans-serif";
    context.textBaseline = "middle";
    for (let i = 0; i < parameter.length && taken.length < MOST_TEXTS; i++) {
      const text = this.labelText(label[i]);
      if (!text || !Number.isFinite(ys[i])) continue;
      plot.dot(parameter[i], ys[i], 3, "#ffffff", INK);
      const x = plot.x(parameter[i]) + 6, y = plot.y(ys[i]), wide = context.measureText(text).width;
      const box = [x, y - 6, x + wide, y + 6];
      if (box[2] > plot.box[0] + plot.box[2] || taken.some((one) => one[0] < box[2] && box[0] < one[2] && one[1] < box[3] && box[1] < one[3])) continue;
      taken.push(box);
      context.textAlign = "left";
      context.strokeStyle = "#ffffff";
      context.lineWidth = 3;
      context.strokeText(text, x, y);
      context.fillStyle = INK;
      context.fillText(text, x, y);
    }
  }

  labelText(code) {
    const name = this.answer.variables.label.codes[code];
    return { none: "", end_of_range: "", closed: "" }[name] ?? words(name);
  }

  /** The branch nearby, else the value under the mouse. */
  pick(px, py) {
    const { arrays } = this.answer;
    let best = NEAR, value = this.at(px);
    for (const name of this.shown) {
      for (let i = 0; i < arrays.parameter.length; i++) {
        const far = Math.hypot(this.plot.x(arrays.parameter[i]) - px, this.plot.y(arrays[name][i]) - py);
        if (far < best) [best, value] = [far, arrays.parameter[i]];
      }
    }
    this.choose(value);
  }

  beside(value, step) {
    const [low, high] = extentOf(this.answer.arrays.parameter);
    return Math.min(Math.max((value ?? low) + (step * (high - low)) / STEPS, low), high);
  }

  /** The orbits at a value of the parameter, each between two points of its branch. */
  orbitsAt(value) {
    const { parameter, branch, x, v, stable, period, impacts, event_word: word } = this.answer.arrays, found = [];
    for (let i = 1; i < parameter.length; i++) {
      const step = parameter[i] - parameter[i - 1];
      if (branch[i] !== branch[i - 1] || step === 0 || (value - parameter[i - 1]) * (value - parameter[i]) > 0) continue;
      const t = (value - parameter[i - 1]) / step, mix = (one) => one[i - 1] + t * (one[i] - one[i - 1]);
      // A value that is a point of the branch lies in two pieces.
      if (t === 0 && i > 1 && branch[i - 2] === branch[i] && (parameter[i - 2] - value) * (parameter[i] - value) <= 0) continue;
      const near = t < 0.5 ? i - 1 : i;
      found.push({ branch: branch[i], x: mix(x), v: mix(v), stable: stable[i] === 1 && stable[i - 1] === 1, period: period[near],
        impacts: impacts[near], word: wordText(word[near]), multipliers: multipliers(this.answer, near) });
    }
    return found;
  }

  /** The saddles at the marked value: what the map may draw. */
  saddles() {
    return this.marked === null || this.links.differs(this) ? [] : this.orbitsAt(this.marked).filter((one) => !one.stable);
  }

  list() {
    if (this.marked === this.listed) return;
    this.listed = this.marked;
    if (this.marked === null) return void fill(this.table);
    const orbits = this.orbitsAt(this.marked), columns = ["orbit", "word", "impacts", "multipliers", "x, v on the section"];
    const rows = orbits.map((one) => h("tr", {}, ...[`period ${one.period}, ${one.stable ? "stable" : "unstable"}`, one.word, String(one.impacts),
      multiplierText(one.multipliers), `${number(one.x, 5)}, ${number(one.v, 5)}`].map((text) => h("td", {}, text))));
    const other = this.links.differs(this);
    fill(this.table, h("p", { class: "note" }, `${orbits.length} orbits at ${this.path} = ${quantity(this.marked, "", 8)}, between points of their branches`),
      orbits.length ? h("table", {}, h("thead", {}, h("tr", {}, ...columns.map((text) => h("th", { scope: "col" }, text)))), h("tbody", {}, ...rows)) : null,
      other ? h("p", { class: "note" }, `The map is of another machine (${other}): its saddles are not drawn there.`) : null);
  }
}

/** Multipliers of a point as pairs of real and imaginary part; those without a value are left out. */
function multipliers({ arrays, shapes }, i) {
  const count = shapes.multiplier_real[1];
  return Array.from({ length: count }, (_, k) => [arrays.multiplier_real[i * count + k], arrays.multiplier_imag[i * count + k]])
    .filter(([re, im]) => Number.isFinite(re) && Number.isFinite(im));
}

function multiplierText(list) {
  const [one, other] = list;
  if (list.length === 2 && one[1] !== 0 && one[0] === other[0] && one[1] === -other[1]) return `${number(one[0], 4)} ± ${number(Math.abs(one[1]), 4)}i`;
  return list.map(([re, im]) => (im === 0 ? number(re, 4) : `${number(re, 4)} ${im < 0 ? "−" : "+"} ${number(Math.abs(im), 4)}i`)).join(", ");
}

function extentOf(values) {
  let low = Infinity, high = -Infinity;
  for (const value of values) [low, high] = [Math.min(low, value), Math.max(high, value)];
  return [low, high];
}

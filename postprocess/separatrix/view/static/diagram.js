// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// A diagram over a parameter that is linked with the maps: a click or the arrow keys choose the value that they show.
import { fill, h, words } from "./dom.js";
import { line } from "./plot.js";

export class Diagram {
  /** `names`: what can be shown; `links` passes the picked value of the parameter to the map. */
  constructor({ file, answer, key, kind, names, note, links }) {
    Object.assign(this, { file, answer, key, kind, links, marked: null });
    this.select = h("select", { onchange: () => this.draw() }, ...names.map((name) => h("option", { value: name }, this.text(name))));
    this.canvas = h("canvas", { class: "sweep", tabindex: "0", role: "application", "aria-roledescription": "diagram" });
    this.status = h("p", { class: "note", "aria-live": "polite" });
    this.element = h("section", { "aria-label": kind }, h("h2", {}, `${kind}: ${file.title || file.name}`),
      h("div", { class: "bar" }, h("label", {}, "Show", this.select), h("span", { class: "note" }, note)), this.canvas, this.status);
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    const pick = (event) => event.buttons && this.pick(event.offsetX, event.offsetY);
    this.canvas.addEventListener("pointerdown", pick);
    this.canvas.addEventListener("pointermove", pick);
    this.canvas.addEventListener("keydown", (event) => this.keyed(event));
  }

  text(name) {
    return { section_x: "stroboscopic x", section_v: "stroboscopic v", x_max: "largest and smallest x" }[name] || (this.answer.variables[name] || {}).label || words(name);
  }

  /** Shows which value the map is for; null if for none. */
  mark(value) {
    this.marked = value;
    this.draw();
  }

  /** Unstable orbits at the value that is shown. */
  saddles() { return []; }

  drawMarked(plot) {
    if (this.marked === null) return;
    plot.context.strokeStyle = "#1b1f24";
    plot.context.lineWidth = 2;
    line(plot.context, plot.x(this.marked), plot.box[1], plot.x(this.marked), plot.box[1] + plot.box[3]);
  }

  name() {
    this.canvas.setAttribute("aria-label", `${this.kind} diagram: ${this.text(this.select.value)} over ${words(this.key)}; arrow keys move the marked value, Enter shows it in the map`);
  }

  /** The value of the parameter at a pixel. */
  at(pixel) {
    const [left, , width] = this.plot.box, [low, high] = this.plot.xs;
    return low + ((pixel - left) / width) * (high - low);
  }

  pick(pixel) { this.choose(this.at(pixel)); }

  keyed(event) {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step && event.key !== "Enter") return;
    event.preventDefault();
    this.choose(this.beside(this.marked, step || 0));
  }

  choose(value) {
    if (value === this.marked) return;
    this.mark(value);
    fill(this.status, this.links.choose(this.key, value));
  }
}

/** The index of the value that is nearest. */
export function nearest(values, value) {
  let best = 0;
  for (let i = 1; i < values.length; i++) if (Math.abs(values[i] - value) < Math.abs(values[best] - value)) best = i;
  return best;
}

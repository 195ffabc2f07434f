// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// What is under the mouse or the cursor, in words.
import { fill, h, quantity, words } from "./dom.js";
import { describeAttractor } from "./legend.js";
import { valueAt } from "./mapview.js";

export class Inspector {
  constructor(viewer) {
    this.viewer = viewer;
  }

  /** The view has changed under the mouse. */
  again() {
    if (this.last) this.hover(this.viewer.map.index(...this.last), true);
  }

  hover(point, keyed) {
    if (!keyed) this.last = point ? [this.viewer.map.px(point[0]), this.viewer.map.py(point[1])] : null;
    if (!point || !this.viewer.file) return fill(this.viewer.hovered);
    const { axes } = this.viewer.file, across = axes[this.viewer.across], up = axes[this.viewer.up];
    const live = this.viewer.live.look(...point);
    const inFile = !Object.keys(this.viewer.with).length;
    const found = live || !inFile ? null : this.viewer.map.tiles.look(this.viewer.map.level, ...point);
    const at = live ? [live.a, live.b] : found ? point.map(Math.round) : point;
    const head = `${words(across.key)} = ${quantity(valueAt(across, at[0]), across.unit, 10)}, ${words(up.key)} = ${quantity(valueAt(up, at[1]), up.unit, 10)}`;
    let body = "";
    if (live) body = this.valuesText(this.namedValues(live.values), true);
    else if (found) body = this.cellText(found);
    else if (inFile) body = "beyond the file";
    fill(this.viewer.hovered, h("b", {}, head), h("div", {}, body));
    clearTimeout(this.asked);
    if (found) this.asked = setTimeout(() => this.askValues(at, head), 130);
    if (this.viewer.checks.follow && this.viewer.checks.follow.checked && !keyed) this.viewer.starter.followMouse(point);
    return undefined;
  }

  cellText(found) {
    const name = (value) => this.className(value);
    if (!this.viewer.variable.classes) return `${words(this.viewer.variable.name)}: ${quantity(found.value, this.viewer.variable.unit, 6)}${found.level ? ` (${2 ** found.level} × ${2 ** found.level} points)` : ""}`;
    if (found.share === undefined || !found.rest) return `${words(this.viewer.variable.name)}: ${name(found.value)}`;
    return `${2 ** found.level} × ${2 ** found.level} points: ${(100 * found.share).toFixed(0)} % ${name(found.value)}, ${(100 * found.rest).toFixed(0)} % ${name(found.second)}`;
  }

  className(value) {
    if (this.viewer.variable.name === "attractor") {
      const one = this.viewer.entries.find((entry) => entry.attractor === value);
      return value === 0 ? "none" : one ? `${value} (${describeAttractor(one, this.viewer.described.regimes)})` : String(value);
    }
    return words(this.viewer.names[value] ?? value);
  }

  /** Codes of live values as words. */
  namedValues(values) {
    const found = { ...values };
    found.regime = this.viewer.described.regimes[values.regime];
    found.reason = values.reason === 0 ? "not allowed here" : this.viewer.described.reasons[values.reason];
    delete found.event_word;
    return found;
  }

  async askValues(at, head) {
    const index = [...this.viewer.at];
    [index[this.viewer.across], index[this.viewer.up]] = at;
    const answer = await this.viewer.transport.ask("values", { file: this.viewer.file.index, at: index.join(",") }).catch(() => null);
    if (answer && this.viewer.hovered.firstChild && this.viewer.hovered.firstChild.textContent === head) fill(this.viewer.hovered, h("b", {}, head), h("div", {}, this.valuesText(answer.values, false)));
  }

  valuesText(values, now) {
    const parts = this.viewer.file.variables.filter((one) => values[one.name] !== undefined).map((one) => {
      const value = values[one.name];
      return `${words(one.name)} ${typeof value === "string" ? words(value) || "–" : quantity(value, one.unit, 5)}`;
    });
    return `${parts.join(", ")}${now ? " (computed now)" : ""}`;
  }
}

// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The attractors with their shares, and the legend of any variable.
import { h, number, prepare, quantity, words } from "./dom.js";
import { INK, tickTexts, ticks } from "./plot.js";
import { scaleColour } from "./palette.js";
import { swatch } from "./tiles.js";

/** An attractor in words. */
export function describeAttractor(one, regimes) {
  const regime = words(regimes[one.regime] || one.regime);
  return one.period === 0 ? `${regime}, no known period` : `${regime}, period ${one.period}`;
}

/** The table of a slice's attractors. `entries` have label, regime, period, ..., count; `toggle(label, alone)`. */
export function attractorTable({ entries, total, unlabelled, own, hidden, regimes, toggle, fromFile, unit }) {
  const rows = entries.map((one) => row(one, total, own, hidden, regimes, toggle));
  if (unlabelled > 0) rows.push(row({ attractor: 0, count: unlabelled, none: true }, total, own, hidden, regimes, toggle));
  const columns = [["", ""], ["attractor", ""], ["share", "number"], ["word", ""], [`amplitude (${unit})`, "number"], ["impacts", "number"], ["multiplier", "number"]];
  const head = h("tr", {}, ...columns.map(([text, kind]) => h("th", { class: kind, scope: "col", title: text === "impacts" ? "impacts per drive period" : null }, text || h("span", { class: "sr" }, "shown"))));
  const chaotic = entries.some((one) => one.period === 0);
  return [
    h("table", {}, h("thead", {}, head), h("tbody", {}, ...rows)),
    chaotic ? h("p", { class: "note" }, "“Not periodic” is what the search saw over 512 periods after the transient that the case allows; a long transient looks the same. A larger run.extension decides between the two.") : null,
    fromFile ? null : h("p", { class: "note" }, "Found now, not in the file; shares are not known."),
  ];
}

function row(one, total, own, hidden, regimes, toggle) {
  const label = one.attractor, off = hidden.has(label);
  const name = one.none ? "none (not captured)" : `${label}: ${describeAttractor(one, regimes)}`;
  const button = h("button", { class: "swatch", "aria-pressed": String(!off), title: "Click: hide or show; Shift-click: this one alone", "aria-label": `${off ? "Show" : "Hide"} ${name}`, onclick: (event) => toggle(label, event.shiftKey) });
  button.style.background = off ? "#ffffff" : swatch(label, 1, own);
  const share = one.count === undefined || !total ? "–" : shareText(one.count, total);
  const cells = one.none ? ["", "", "", ""] : [one.word || "", number(one.amplitude, 4), number(one.impacts_per_period, 4), number(one.multiplier, 4)];
  return h("tr", { class: off ? "hidden-class" : "" }, h("td", {}, button), h("td", {}, name), h("td", { class: "number" }, share),
    h("td", {}, cells[0]), ...cells.slice(1).map((text) => h("td", { class: "number" }, text)));
}

export function shareText(count, total) {
  const share = (100 * count) / total;
  return count > 0 && share < 0.01 ? "< 0.01 %" : `${share.toFixed(2)} %`;
}

/** The legend of the classes that are in sight: buttons that hide and show. */
export function classLegend({ values, names, offset, own, hidden, toggle }) {
  const shown = values.slice(0, 40);
  const buttons = shown.map((value) => {
    const off = hidden.has(value), box = h("span", { class: "swatch", "aria-hidden": "true" });
    box.style.background = off ? "#ffffff" : swatch(value, offset, own);
    return h("button", { class: "class", "aria-pressed": String(!off), onclick: (event) => toggle(value, event.shiftKey) }, box, h("span", { class: off ? "off" : "" }, words(names[value] ?? value)));
  });
  const more = values.length > shown.length ? h("span", { class: "note" }, `and ${values.length - shown.length} more`) : null;
  return h("div", { class: "legend", role: "group", "aria-label": "Legend" }, ...buttons, more);
}

/** The events of one period as text: 'R.' is one impact a drive period. */
export function wordText(word) {
  let text = "";
  for (let rest = word; rest > 0; rest = Math.floor(rest / 8)) text += ["", "R", "L", "S", "C", "D", "+", "."][rest % 8];
  return text;
}

/** The class of an event word that was computed now: that of the file, or a new one in `names`. */
export function wordClass(names, word) {
  const text = wordText(word);
  const found = Object.entries(names).find(([, name]) => name === (text || "none"));
  if (found) return Number(found[0]);
  const next = Object.keys(names).length;
  names[next] = text || "none";
  return next;
}

/** The scale of a variable of numbers. */
export function scaleLegend(painter, label, unit) {
  const canvas = h("canvas", { class: "scale", role: "img", "aria-label": `Colours from ${quantity(painter.range[0], unit, 3)} (dark) to ${quantity(painter.range[1], unit, 3)} (light)${painter.log ? ", logarithmic" : ""}` });
  const draw = () => {
    if (!canvas.isConnected) return;
    const [context, width] = prepare(canvas);
    for (let x = 0; x < width - 40; x++) {
      context.fillStyle = `rgb(${scaleColour(x / (width - 41)).join(" ")})`;
      context.fillRect(20 + x, 2, 1.5, 13);
    }
    context.fillStyle = INK;
    context.font = "11px system-ui, Arial, sans-serif";
    context.textAlign = "center";
    const [low, high] = painter.range;
    const values = painter.log ? [low, Math.sqrt(low * high), high] : ticks(low, high, 3).values;
    const texts = painter.log ? values.map((v) => number(v, 2)) : tickTexts(ticks(low, high, 3)).texts;
    values.forEach((value, i) => {
      const t = painter.log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
      context.fillText(texts[i], 20 + t * (width - 40), 29);
    });
  };
  requestAnimationFrame(draw);
  return h("div", { class: "legend" }, h("span", {}, `${label}${unit ? ` (${unit})` : ""}${painter.log ? ", logarithmic" : ""}`), canvas, h("span", { class: "note" }, "grey: no value"));
}

// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Axes of plots: ticks, frames, lines.
import { number } from "./dom.js";

export const INK = "#1b1f24", SOFT = "#4a5560", GRID = "#e4e8eb";
const FONT = "12px system-ui, 'Segoe UI', Arial, sans-serif";

/** Round values between low and high, about `count` of them. */
export function ticks(low, high, count) {
  const span = high - low;
  if (!(span > 0) || !Number.isFinite(span)) return { values: [low], step: 1 };
  const rough = span / Math.max(1, count), power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((m) => m * power >= rough * 0.999);
  const values = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * span && values.length < 100; i++) values.push(i * step);
  return { values, step };
}

/** Texts of ticks; where they have too many digits in common these become an offset. */
export function tickTexts({ values, step }) {
  const size = Math.max(...values.map(Math.abs), step);
  const digits = Math.ceil(Math.log10(size / step) + 1e-9) + 1;
  if (digits <= 7 || !values.length) return { texts: values.map((v) => number(Math.abs(v) < step / 1e3 ? 0 : v, Math.max(digits, 1))), offset: null };
  const base = values[0], power = Math.floor(Math.log10(step * values.length) + 1e-9);
  return { texts: values.map((v) => number((Math.round((v - base) / step) * step) / 10 ** power, 3)), offset: base, power };
}

/** A frame with ticks. `box` = [left, top, width, height]; axes have low, high, label, and pixel(value) in pixels. */
export function frame(context, box, across, up) {
  const [left, top, width, height] = box;
  context.save();
  context.font = FONT;
  context.strokeStyle = INK;
  context.fillStyle = INK;
  context.lineWidth = 1;
  context.strokeRect(left + 0.5, top + 0.5, width - 1, height - 1);
  const a = ticks(across.low, across.high, width / 90), aText = tickTexts(a);
  context.textAlign = "center";
  context.textBaseline = "top";
  a.values.forEach((value, i) => {
    const x = Math.round(across.pixel(value)) + 0.5;
    if (x < left - 1 || x > left + width + 1) return;
    line(context, x, top + height, x, top + height + 5);
    context.fillText(aText.texts[i], Math.min(x, left + width - 8), top + height + 7);
  });
  const b = ticks(up.low, up.high, height / 42), bText = tickTexts(b);
  context.textAlign = "right";
  context.textBaseline = "middle";
  b.values.forEach((value, i) => {
    const y = Math.round(up.pixel(value)) + 0.5;
    if (y < top - 1 || y > top + height + 1) return;
    line(context, left - 5, y, left, y);
    context.fillText(bText.texts[i], left - 7, y);
  });
  context.textAlign = "center";
  context.textBaseline = "bottom";
  context.fillText(named(across.label, aText), left + width / 2, top + height + 41);
  context.translate(1, top + height / 2);
  context.rotate(-Math.PI / 2);
  context.textBaseline = "top";
  context.fillText(named(up.label, bText), 0, 0);
  context.restore();
}

function named(label, { offset, power }) {
  return offset === null ? label : `${label} = ${number(offset, 15)} + … · 10^${String(power).replace("-", "−")}`;
}

export function line(context, x0, y0, x1, y1) {
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
}

/** A plot with linear axes that knows its box and its ranges. */
export class Plot {
  constructor(context, width, height, xs, ys, labels, margins = [66, 8, 12, 44]) {
    const [left, top, right, bottom] = margins;
    Object.assign(this, { context, box: [left, top, width - left - right, height - top - bottom] });
    this.xs = xs;
    this.ys = ys;
    this.labels = labels;
  }

  x(value) { return this.box[0] + ((value - this.xs[0]) / (this.xs[1] - this.xs[0])) * this.box[2]; }

  y(value) { return this.box[1] + this.box[3] - ((value - this.ys[0]) / (this.ys[1] - this.ys[0])) * this.box[3]; }

  frame() {
    frame(this.context, this.box, { low: this.xs[0], high: this.xs[1], label: this.labels[0], pixel: (v) => this.x(v) },
      { low: this.ys[0], high: this.ys[1], label: this.labels[1], pixel: (v) => this.y(v) });
  }

  clip(draw) {
    const { context } = this;
    context.save();
    context.beginPath();
    context.rect(...this.box);
    context.clip();
    draw(context);
    context.restore();
  }

  /** A line through points, begun anew after those that are not numbers. */
  path(xs, ys, from, to) {
    const { context } = this;
    context.beginPath();
    let begun = false;
    for (let i = from; i < to; i++) {
      if (!Number.isFinite(ys[i]) || !Number.isFinite(xs[i])) { begun = false; continue; }
      if (begun) context.lineTo(this.x(xs[i]), this.y(ys[i]));
      else context.moveTo(this.x(xs[i]), this.y(ys[i]));
      begun = true;
    }
    context.stroke();
  }

  dot(x, y, radius, colour, edge = null) {
    const { context } = this;
    context.beginPath();
    context.arc(this.x(x), this.y(y), radius, 0, 2 * Math.PI);
    context.fillStyle = colour;
    context.fill();
    if (edge) {
      context.strokeStyle = edge;
      context.lineWidth = 1.2;
      context.stroke();
    }
  }
}

/** The range of numbers with a little room on both sides. */
export function extent(...lists) {
  let low = Infinity, high = -Infinity;
  for (const list of lists) {
    for (const value of list) {
      if (!Number.isFinite(value)) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  if (!(low <= high)) return [0, 1];
  const room = 0.05 * (high - low) || 0.05 * Math.abs(low) || 0.5;
  return [low - room, high + room];
}

/** A barrier with the hatched side that cannot be entered: side +1 beyond larger values. */
export function hatch(context, x, top, height, side) {
  context.save();
  context.strokeStyle = INK;
  context.lineWidth = 1.6;
  line(context, x, top, x, top + height);
  context.lineWidth = 0.8;
  for (let y = top + 6; y < top + height + 8; y += 7) line(context, x, y, x + 8 * side, y - 8);
  context.restore();
}

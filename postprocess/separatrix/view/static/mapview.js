// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The picture of a plane: tiles, what is computed live, marks; pan, zoom, keys, the mouse.
import { prepare } from "./dom.js";
import { frame } from "./plot.js";
import { TILE } from "./tiles.js";

const MARGINS = [84, 10, 14, 48];
const DEEPEST = 1e-12;

export class MapView {
  /** Calls back: hover(point), pick(point), moved(), failed(error). */
  constructor(canvas, callbacks) {
    this.canvas = canvas;
    this.callbacks = callbacks;
    this.view = null;
    this.tiles = null;
    this.slow = null;
    this.painter = null;
    this.marks = [];
    this.curves = [];
    this.live = null;
    this.cursor = null;
    this.pointers = new Map();
    this.observer = new ResizeObserver(() => this.draw());
    this.observer.observe(canvas);
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    for (const [name, action] of Object.entries({ pointerdown: "down", pointermove: "move", pointerup: "up", pointercancel: "up", pointerleave: "leave" })) {
      canvas.addEventListener(name, (event) => this[action](event));
    }
    canvas.addEventListener("keydown", (event) => this.keyed(event));
  }

  /** Shows a plane: `axes` across and up, as described; tiles of its variable and of the settling time (or null). */
  show(axes, tiles, slow, keepView) {
    if (this.tiles && this.tiles !== tiles) this.tiles.close();
    if (this.slow && this.slow !== slow) this.slow.close();
    Object.assign(this, { axes, tiles, slow });
    if (!keepView || !this.view) this.reset();
    this.draw();
  }

  reset() {
    const [a, b] = this.axes;
    this.view = { a0: -0.5, a1: a.count - 0.5, b0: -0.5, b1: b.count - 0.5 };
    this.changed();
  }

  get box() {
    const { width, height } = this.canvas.getBoundingClientRect();
    return [MARGINS[0], MARGINS[1], Math.max(20, width - MARGINS[0] - MARGINS[2]), Math.max(20, height - MARGINS[1] - MARGINS[3])];
  }

  /** Pixels of an index coordinate. */
  px(a) { const [left, , width] = this.box; return left + ((a - this.view.a0) / (this.view.a1 - this.view.a0)) * width; }

  py(b) { const [, top, , height] = this.box; return top + height - ((b - this.view.b0) / (this.view.b1 - this.view.b0)) * height; }

  /** Index coordinates of a pixel. */
  index(x, y) {
    const [left, top, width, height] = this.box, v = this.view;
    return [v.a0 + ((x - left) / width) * (v.a1 - v.a0), v.b0 + ((top + height - y) / height) * (v.b1 - v.b0)];
  }

  /** Points of the map in a pixel of the page, across and up. */
  get perPixel() {
    const [, , width, height] = this.box, v = this.view;
    return [(v.a1 - v.a0) / width, (v.b1 - v.b0) / height];
  }

  get level() {
    const ratio = window.devicePixelRatio || 1;
    const fine = Math.min(...this.perPixel) / ratio;
    return Math.min(Math.max(0, Math.floor(Math.log2(Math.max(fine, 1e-9)) + 0.25)), this.tiles.top);
  }

  changed() {
    this.draw();
    this.callbacks.moved();
  }

  draw() {
    if (this.pending) return;
    this.pending = requestAnimationFrame(() => {
      this.pending = null;
      if (this.tiles && this.view && this.canvas.isConnected) this.drawNow();
    });
  }

  drawNow() {
    const [context, width, height] = prepare(this.canvas);
    const box = this.box;
    context.save();
    context.beginPath();
    context.rect(...box);
    context.clip();
    context.fillStyle = "#f3f5f7";
    context.fillRect(...box);
    this.drawTiles(context);
    if (this.live) this.live.draw(context, this);
    this.drawCurves(context);
    this.drawMarks(context);
    context.restore();
    const [a, b] = this.axes;
    frame(context, box, this.scale(a, this.view.a0, this.view.a1, (i) => this.px(i)),
      this.scale(b, this.view.b0, this.view.b1, (i) => this.py(i)));
    this.size = [width, height];
  }

  /** An axis of the frame: values at its ends, and pixels of values. */
  scale(axis, from, to, pixel) {
    return { low: valueAt(axis, from), high: valueAt(axis, to), label: axisLabel(axis), pixel: (value) => pixel(indexOf(axis, value)) };
  }

  drawTiles(context) {
    if (!this.painter) return;
    const level = this.level, size = TILE * 2 ** level, v = this.view, [columns, rows] = this.tiles.points;
    const first = [Math.floor(Math.max(0, v.b0 + 0.5) / size), Math.floor(Math.max(0, v.a0 + 0.5) / size)];
    const last = [Math.floor(Math.min(rows - 1, v.b1 + 0.5) / size), Math.floor(Math.min(columns - 1, v.a1 + 0.5) / size)];
    const wanted = new Set([this.tiles.key(this.tiles.top, 0, 0)]);
    this.tiles.want(this.tiles.top, 0, 0);
    if (this.slow) this.slow.want(this.slow.top, 0, 0);
    for (let row = first[0]; row <= last[0]; row++) {
      for (let column = first[1]; column <= last[1]; column++) wanted.add(this.tiles.key(level, row, column));
    }
    this.tiles.keepOnly(wanted);
    if (this.slow) this.slow.keepOnly(wanted);
    for (let row = first[0]; row <= last[0]; row++) {
      for (let column = first[1]; column <= last[1]; column++) this.drawTile(context, level, row, column);
    }
  }

  drawTile(context, level, row, column) {
    let tile = this.tiles.want(level, row, column), up = level, r = row, c = column;
    const slow = this.slow && this.slow.want(level, row, column);
    while ((!tile || !tile.cells) && up < this.tiles.top) {
      up++;
      [r, c] = [r >> 1, c >> 1];
      tile = this.tiles.has(up, r, c);
    }
    if (!tile || !tile.cells) return;
    const other = this.slow && (up === level ? slow : this.slow.has(up, r, c));
    const matching = other && other.cells && other.rows === tile.rows ? other : null;
    const picture = this.tiles.paint(tile, this.painter, matching);
    // The part of the tile that is shown here.
    const size = 2 ** up, [points, lines] = this.tiles.points, edge = 2 ** level * TILE;
    const a = [column * edge, Math.min((column + 1) * edge, points)], b = [row * edge, Math.min((row + 1) * edge, lines)];
    const sx = (a[0] - c * TILE * size) / size, sw = (a[1] - a[0]) / size, sh = (b[1] - b[0]) / size;
    const sy = tile.rows - (b[0] - r * TILE * size) / size - sh;
    const x0 = Math.round(this.px(a[0] - 0.5)), x1 = Math.round(this.px(a[1] - 0.5));
    const y0 = Math.round(this.py(b[1] - 0.5)), y1 = Math.round(this.py(b[0] - 0.5));
    context.imageSmoothingEnabled = (x1 - x0) < sw;
    context.drawImage(picture, sx, Math.max(0, sy), sw, sh, x0, y0, x1 - x0, y1 - y0);
  }

  /** Curves in index coordinates, dark on a white edge. */
  drawCurves(context) {
    const [left, top, width, height] = this.box, v = this.view;
    const across = width / (v.a1 - v.a0), up = height / (v.b1 - v.b0);
    for (const { xs, ys, colour, dashes } of this.curves) {
      context.beginPath();
      for (let i = 0; i < xs.length; i++) context.lineTo(left + (xs[i] - v.a0) * across, top + height - (ys[i] - v.b0) * up);
      for (const [stroke, thick, gaps] of [["#ffffff", 3.5, []], [colour, 1.6, dashes]]) {
        context.strokeStyle = stroke;
        context.lineWidth = thick;
        context.setLineDash(gaps);
        context.stroke();
      }
    }
    context.setLineDash([]);
  }

  drawMarks(context) {
    for (const mark of this.marks) {
      const x = this.px(indexOf(this.axes[0], mark.x)), y = this.py(indexOf(this.axes[1], mark.y));
      context.lineWidth = 1.5;
      context.beginPath();
      if (mark.kind === "start") {
        for (const [colour, thick] of [["#ffffff", 4.5], ["#000000", 1.8]]) {
          context.strokeStyle = colour;
          context.lineWidth = thick;
          context.beginPath();
          context.moveTo(x - 8, y); context.lineTo(x + 8, y);
          context.moveTo(x, y - 8); context.lineTo(x, y + 8);
          context.stroke();
        }
        continue;
      }
      if (mark.kind === "saddle") {
        diamond(context, x, y);
        continue;
      }
      context.arc(x, y, mark.kind === "section" ? 2 : 5, 0, 2 * Math.PI);
      context.fillStyle = mark.colour;
      context.fill();
      context.strokeStyle = mark.kind === "section" ? "#ffffff" : "#000000";
      context.lineWidth = mark.kind === "section" ? 0.7 : 1.3;
      context.stroke();
      if (mark.kind === "attractor") {
        context.beginPath();
        context.arc(x, y, 6.3, 0, 2 * Math.PI);
        context.strokeStyle = "#ffffff";
        context.stroke();
      }
    }
    if (this.cursor) {
      const [x, y] = [this.px(this.cursor[0]), this.py(this.cursor[1])];
      for (const [colour, thick] of [["#ffffff", 3], ["#000000", 1]]) {
        context.strokeStyle = colour;
        context.lineWidth = thick;
        context.strokeRect(x - 6, y - 6, 12, 12);
      }
    }
  }

  /** Zooms by a factor (below 1: in) about index coordinates. */
  zoom(factor, a, b) {
    const v = this.view, spans = [v.a1 - v.a0, v.b1 - v.b0];
    const most = Math.max(...this.axes.map((axis, i) => (spans[i] * factor) / (4 * axis.count)));
    const least = Math.min(...this.axes.map((axis, i) => (spans[i] * factor) / (DEEPEST * axis.count)));
    if ((factor > 1 && most > 1) || (factor < 1 && least < 1)) return;
    this.view = { a0: a - (a - v.a0) * factor, a1: a + (v.a1 - a) * factor, b0: b - (b - v.b0) * factor, b1: b + (v.b1 - b) * factor };
    this.changed();
  }

  pan(da, db) {
    const v = this.view;
    this.view = { a0: v.a0 + da, a1: v.a1 + da, b0: v.b0 + db, b1: v.b1 + db };
    this.changed();
  }

  inside(x, y) {
    const [left, top, width, height] = this.box;
    return x >= left && x <= left + width && y >= top && y <= top + height;
  }

  wheel(event) {
    if (!this.view || !this.inside(event.offsetX, event.offsetY)) return;
    event.preventDefault();
    const turn = Math.max(-300, Math.min(300, event.deltaY * (event.deltaMode === 1 ? 30 : 1)));
    this.zoom(Math.exp(turn * 0.0022), ...this.index(event.offsetX, event.offsetY));
  }

  down(event) {
    if (!this.view) return;
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, { x: event.offsetX, y: event.offsetY, startX: event.offsetX, startY: event.offsetY, moved: false });
  }

  move(event) {
    if (!this.view) return;
    const one = this.pointers.get(event.pointerId);
    const [x, y] = [event.offsetX, event.offsetY];
    if (!one) {
      if (this.inside(x, y)) this.callbacks.hover(this.index(x, y), false);
      return;
    }
    if (Math.hypot(x - one.startX, y - one.startY) > 4) one.moved = true;
    if (this.pointers.size === 2) {
      const other = [...this.pointers.entries()].find(([id]) => id !== event.pointerId)[1];
      const before = Math.hypot(one.x - other.x, one.y - other.y), now = Math.hypot(x - other.x, y - other.y);
      if (before > 10 && now > 10) this.zoom(before / now, ...this.index((x + other.x) / 2, (y + other.y) / 2));
      one.moved = other.moved = true;
    } else if (one.moved) {
      const [pa, pb] = this.perPixel;
      this.pan(-(x - one.x) * pa, (y - one.y) * pb);
    }
    [one.x, one.y] = [x, y];
  }

  up(event) {
    const one = this.pointers.get(event.pointerId);
    this.pointers.delete(event.pointerId);
    if (event.type !== "pointerup" || !one || one.moved || !this.inside(event.offsetX, event.offsetY)) return;
    this.cursor = null;
    this.callbacks.pick(this.index(event.offsetX, event.offsetY));
  }

  leave() {
    this.callbacks.hover(null, false);
  }

  keyed(event) {
    if (!this.view || event.ctrlKey || event.metaKey || event.altKey) return;
    const v = this.view, centre = [(v.a0 + v.a1) / 2, (v.b0 + v.b1) / 2];
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    if (event.key in arrows) {
      const [da, db] = arrows[event.key];
      if (event.shiftKey) this.pan(da * 0.12 * (v.a1 - v.a0), db * 0.12 * (v.b1 - v.b0));
      else this.moveCursor(da, db, centre);
    } else if (event.key === "+" || event.key === "=") this.zoom(0.5, ...(this.cursor || centre));
    else if (event.key === "-") this.zoom(2, ...(this.cursor || centre));
    else if (event.key === "0") this.reset();
    else if (event.key === "Enter" || event.key === " ") this.callbacks.pick(this.cursor || centre);
    else if (event.key === "Escape") { this.cursor = null; this.draw(); } else return;
    event.preventDefault();
  }

  moveCursor(da, db, centre) {
    const v = this.view, step = [Math.max(1, (v.a1 - v.a0) / 60), Math.max(1, (v.b1 - v.b0) / 60)];
    if (v.a1 - v.a0 < 30) [step[0], step[1]] = [(v.a1 - v.a0) / 60, (v.b1 - v.b0) / 60];
    const before = this.cursor || centre.map(Math.round);
    this.cursor = [Math.min(Math.max(before[0] + da * step[0], v.a0), v.a1), Math.min(Math.max(before[1] + db * step[1], v.b0), v.b1)];
    this.draw();
    this.callbacks.hover(this.cursor, true);
  }
}

/** A saddle: a white diamond with a dark edge. */
function diamond(context, x, y) {
  context.beginPath();
  context.moveTo(x - 6, y);
  context.lineTo(x, y - 6);
  context.lineTo(x + 6, y);
  context.lineTo(x, y + 6);
  context.closePath();
  context.fillStyle = "#ffffff";
  context.fill();
  context.strokeStyle = "#000000";
  context.stroke();
}

/** Value of an axis at an index coordinate: lines between the values of the file, and beyond. */
export function valueAt(axis, i) {
  const n = axis.count;
  if (n < 2) return axis.from;
  if (axis.uniform) {
    if (axis.values && Number.isInteger(i) && i >= 0 && i < n) return axis.values[i];
    return axis.from + i * ((axis.to - axis.from) / (n - 1));
  }
  const below = Math.min(Math.max(Math.floor(i), 0), n - 2);
  return axis.values[below] + (i - below) * (axis.values[below + 1] - axis.values[below]);
}

/** Index coordinate of a value. */
export function indexOf(axis, value) {
  const n = axis.count;
  if (n < 2) return 0;
  if (axis.uniform) return ((value - axis.from) / (axis.to - axis.from)) * (n - 1);
  let low = 0, high = n - 2;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (axis.values[middle] <= value) low = middle; else high = middle - 1;
  }
  return low + (value - axis.values[low]) / (axis.values[low + 1] - axis.values[low]);
}

export function axisLabel(axis) {
  const known = { x0: "initial position x₀", v0: "initial velocity v₀", crank_angle: "initial crank angle φ₀", drive_ratio: "frequency ratio Ω/ω₀" };
  const text = known[axis.key] || axis.label || axis.key.replaceAll("_", " ");
  return axis.unit ? `${text} (${axis.unit})` : text;
}

// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Tiles of a plane: asked for as they come into sight, kept, painted when they or the colours change.
import { classColour } from "./palette.js";

export const TILE = 256;
const MOST = 320, AT_ONCE = 6, AGAIN = 600;

export class Tiles {
  /** `plane` are the parameters of a plane without the variable; `changed` is called when there is more to draw. */
  constructor(transport, plane, variable, points, changed, failed) {
    Object.assign(this, { transport, plane, variable, points, changed, failed });
    this.top = 0;
    while (Math.max(...points) / 2 ** this.top > TILE) this.top++;
    this.cache = new Map();
    this.queue = [];
    this.busy = 0;
    this.complete = true;
    this.closed = false;
  }

  close() {
    this.closed = true;
    this.queue = [];
  }

  key(level, row, column) { return `${level}/${row}/${column}`; }

  has(level, row, column) { return this.cache.get(this.key(level, row, column)); }

  /** The tile if it is there; otherwise it is asked for. */
  want(level, row, column) {
    const key = this.key(level, row, column);
    const one = this.cache.get(key);
    if (one) {
      this.cache.delete(key);
      this.cache.set(key, one);
      if (!one.stale || one.asked) return one;
      one.asked = true;
    } else {
      this.cache.set(key, { cells: null, asked: true, stale: false });
    }
    this.queue.push({ level, row, column, key });
    this.next();
    return one && one.cells ? one : null;
  }

  /** Forgets requests that nobody looks at any more. */
  keepOnly(wanted) {
    this.queue = this.queue.filter((one) => {
      if (wanted.has(one.key)) return true;
      const found = this.cache.get(one.key);
      if (found && !found.cells) this.cache.delete(one.key);
      else if (found) found.asked = false;
      return false;
    });
  }

  async next() {
    while (this.busy < AT_ONCE && this.queue.length && !this.closed) {
      const one = this.queue.shift();
      this.busy++;
      this.load(one).finally(() => {
        this.busy--;
        this.next();
      });
    }
  }

  async load({ level, row, column, key }) {
    try {
      const answer = await this.transport.ask("tile", { ...this.plane, variable: this.variable, level, row, column });
      if (this.closed) return;
      const [rows, columns] = answer.shapes.first;
      const stale = !answer.complete;
      this.cache.set(key, { cells: answer.arrays, rows, columns, stale, asked: stale, painted: null });
      if (stale) setTimeout(() => this.again(key), AGAIN);
      this.trim();
      this.changed();
    } catch (error) {
      if (this.closed) return;
      if (error.status === 404) {
        // A page with stored answers has no finer tiles: what is there stays.
        const known = this.cache.get(key);
        if (known && !known.cells) known.missing = true;
      } else {
        this.cache.delete(key);
        this.failed(error);
      }
    }
  }

  again(key) {
    const one = this.cache.get(key);
    if (one) one.asked = false;
    this.changed();
  }

  trim() {
    for (const key of this.cache.keys()) {
      if (this.cache.size <= MOST) break;
      if (this.cache.get(key).cells) this.cache.delete(key);
    }
  }

  /** A canvas with the cells of a tile in colour; `slow` is the tile of settling times where that is shown. */
  paint(tile, painter, slow) {
    if (tile.painted && tile.painter === painter && tile.slow === slow) return tile.painted;
    const canvas = tile.painted || document.createElement("canvas");
    const { rows, columns, cells } = tile;
    if (canvas.width !== columns || canvas.height !== rows) [canvas.width, canvas.height] = [columns, rows];
    const context = canvas.getContext("2d");
    const image = context.createImageData(columns, rows);
    for (let row = 0; row < rows; row++) {
      let p = 4 * columns * (rows - 1 - row);
      for (let i = row * columns; i < (row + 1) * columns; i++, p += 4) painter.put(image.data, p, cells, i, slow ? slow.cells.first[i] : undefined);
    }
    context.putImageData(image, 0, 0);
    Object.assign(tile, { painted: canvas, painter, slow });
    return canvas;
  }

  /** What is known about the point at index coordinates, from the finest tile that is there. */
  look(level, a, b) {
    const column = Math.round(a), row = Math.round(b);
    if (column < 0 || row < 0 || column >= this.points[0] || row >= this.points[1]) return null;
    for (let up = level; up <= this.top; up++) {
      const size = TILE * 2 ** up;
      const tile = this.has(up, Math.floor(row / size), Math.floor(column / size));
      if (!tile || !tile.cells) continue;
      const x = Math.floor((column % size) / 2 ** up), y = Math.floor((row % size) / 2 ** up);
      const i = y * tile.columns + x;
      const { first, second, share, rest } = tile.cells;
      const found = { level: up, value: first[i] };
      if (share) Object.assign(found, { second: second[i], share: share[i] / 255, rest: rest[i] / 255 });
      return found;
    }
    return null;
  }

  /** Values of the coarsest tile. */
  overview() {
    const tile = this.has(this.top, 0, 0);
    return tile && tile.cells ? tile.cells.first : [];
  }

  /** Classes in the coarsest tile, the second of its cells too. */
  classesSeen() {
    const tile = this.has(this.top, 0, 0), found = new Set(this.overview());
    if (tile && tile.cells && tile.cells.second) tile.cells.second.forEach((value, i) => tile.cells.rest[i] && found.add(value));
    return [...found].sort((a, b) => a - b);
  }
}

/** A swatch's colour of a class. */
export function swatch(value, offset, own) {
  return `rgb(${classColour(value, offset, own).join(" ")})`;
}

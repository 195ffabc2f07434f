// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Points between and beyond those of the file: computed now at the resolution of the screen, coarse ones first.

const STRIDES = [16, 8, 4, 2, 1], POINTS = 6000, AT_ONCE = 3, QUIET = 180;

export class LiveLayer {
  /** `state()` returns what to compute: parameters of the plane and of the machine; `changed`, `report` call back. */
  constructor(transport, state, changed, report) {
    Object.assign(this, { transport, state, changed, report });
    this.page = Math.floor(Math.random() * 1e9);
    this.number = 0;
    this.picture = null;
    this.timer = null;
  }

  /** The view has changed: what is under way for the old one ends, the new one begins when it rests. */
  restart(map, wanted) {
    clearTimeout(this.timer);
    this.halt();
    if (!wanted) {
      this.picture = null;
      this.report("");
      return;
    }
    this.timer = setTimeout(() => this.begin(map), QUIET);
  }

  halt() {
    if (!this.running) return;
    this.running = false;
    this.transport.ask("stop", { page: this.page, view: this.number }, { act: true }).catch(() => {});
  }

  async begin(map) {
    const [, , width, height] = map.box, v = { ...map.view };
    const columns = Math.round(width), rows = Math.round(height);
    const number = ++this.number;
    const da = (v.a1 - v.a0) / columns, db = (v.b1 - v.b0) / rows;
    const lattice = { a: v.a0 + da / 2, da, b: v.b0 + db / 2, db, columns, rows };
    const next = { number, view: v, ...lattice, stride: 0, arrays: {}, filled: new Uint8Array(columns * rows), dirty: true };
    this.running = true;
    const began = performance.now();
    try {
      for (const stride of STRIDES) {
        await this.pass(next, stride, stride < STRIDES[0], () => number === this.number && this.running);
        if (number !== this.number || !this.running) return;
        next.stride = stride;
        this.report(stride > 1 ? `computing now, ${Math.round(100 / stride ** 2)} % of the points` : `computed now, not in the file: ${columns} × ${rows} points in ${((performance.now() - began) / 1000).toFixed(1)} s`);
      }
      this.running = false;
    } catch (error) {
      if (number === this.number) {
        this.running = false;
        if (error.status !== 409) this.report(error.message);
      }
    }
  }

  /** Computes the points of a stride that coarser ones have left out, in bands, some at a time. */
  async pass(next, stride, skip, current) {
    const columns = Math.ceil(next.columns / stride), rows = Math.ceil(next.rows / stride);
    const band = Math.max(2, 2 * Math.floor(POINTS / columns / 2));
    const firsts = [];
    for (let row = 0; row < rows; row += band) firsts.push(row);
    const work = async () => {
      while (firsts.length && current()) {
        const row = firsts.shift(), count = Math.min(band, rows - row);
        const answer = await this.transport.ask("points", {
          ...this.state(), page: this.page, view: next.number, a: next.a, da: next.da * stride, columns,
          b: next.b + row * stride * next.db, db: next.db * stride, rows: count, skip: skip ? 1 : 0,
        });
        if (!current()) return;
        this.put(next, answer.arrays, stride, skip, row, columns, count);
        if (this.picture !== next) this.picture = next;
        next.dirty = true;
        this.changed();
      }
    };
    await Promise.all(Array.from({ length: AT_ONCE }, work));
  }

  put(next, arrays, stride, skip, first, columns, count) {
    const size = next.columns * next.rows;
    for (const [name, values] of Object.entries(arrays)) {
      if (!next.arrays[name]) next.arrays[name] = name === "event_word" ? new Float64Array(size) : new Float32Array(size);
      const target = next.arrays[name];
      let k = 0;
      for (let row = 0; row < count; row++) {
        for (let column = 0; column < columns; column++) {
          if (skip && row % 2 === 0 && column % 2 === 0) continue;
          const x = column * stride, y = (first + row) * stride;
          const p = y * next.columns + x;
          target[p] = values[k++];
          next.filled[p] = stride;
        }
      }
    }
  }

  /** Draws over the tiles; while the view moves, the picture of the old one moves with it. */
  draw(context, map) {
    const one = this.picture;
    if (!one || !map.painter) return;
    const name = map.tiles.name;
    if (!one.arrays[name]) return;
    if (one.dirty || one.painter !== map.painter || one.name !== name) this.paint(one, map, name);
    const x0 = map.px(one.view.a0), x1 = map.px(one.view.a1), y0 = map.py(one.view.b1), y1 = map.py(one.view.b0);
    context.imageSmoothingEnabled = false;
    context.drawImage(one.canvas, x0, y0, x1 - x0, y1 - y0);
  }

  paint(one, map, name) {
    if (!one.canvas) {
      one.canvas = document.createElement("canvas");
      [one.canvas.width, one.canvas.height] = [one.columns, one.rows];
    }
    const context = one.canvas.getContext("2d"), image = context.createImageData(one.columns, one.rows);
    const values = map.classOf ? Float64Array.from(one.arrays[name], map.classOf) : one.arrays[name];
    const cells = { first: values }, slow = map.painter.shade ? one.arrays.settle_time : null;
    const data = new Uint32Array(image.data.buffer), pixel = new Uint8ClampedArray(4), whole = new Uint32Array(pixel.buffer);
    // Coarse points first, so that finer ones cover what they know better.
    for (const stride of STRIDES) {
      for (let y = 0; y < one.rows; y += stride) {
        for (let x = 0; x < one.columns; x += stride) {
          const i = y * one.columns + x;
          if (one.filled[i] !== stride) continue;
          map.painter.put(pixel, 0, cells, i, slow ? slow[i] : undefined);
          if (one.arrays.reason[i] === 0) pixel.set([222, 222, 222, 255]);
          for (let v = y; v < Math.min(y + stride, one.rows); v++) {
            const p = (one.rows - 1 - v) * one.columns;
            for (let u = x; u < Math.min(x + stride, one.columns); u++) data[p + u] = whole[0];
          }
        }
      }
    }
    context.putImageData(image, 0, 0);
    Object.assign(one, { dirty: false, painter: map.painter, name });
  }

  /** All variables of the point computed at index coordinates, if any. */
  look(a, b) {
    const one = this.picture;
    if (!one) return null;
    let x = Math.floor((a - one.view.a0) / one.da), y = Math.floor((b - one.view.b0) / one.db);
    if (x < 0 || y < 0 || x >= one.columns || y >= one.rows) return null;
    for (let stride = 1; stride <= STRIDES[0]; stride *= 2) {
      const [u, v] = [x - (x % stride), y - (y % stride)], i = v * one.columns + u;
      if (!one.filled[i]) continue;
      const found = Object.fromEntries(Object.entries(one.arrays).map(([name, values]) => [name, values[i]]));
      return { a: one.a + u * one.da, b: one.b + v * one.db, values: found };
    }
    return null;
  }
}

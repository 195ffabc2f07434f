// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Colours of the figures: the server sends them (separatrix/palette.py).

/** classes, nothing, regimes (by code), boundaries (by name), up, down, many, motion, impact. */
export const PALETTE = {};
// Up to so many classes of their own take the colours of the palette in order.
const FEW = 8;
const HIDDEN = [250, 250, 250];
// cividis (Nuñez, Anderton, Renslow 2018) at equal steps
const CIVIDIS = ["#00224e", "#083370", "#35456c", "#4f576c", "#666970", "#7d7c78", "#948e77", "#aea371", "#c8b866",
  "#e5cf52", "#fee838"];

function rgb(hex) {
  return [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
}

const SCALE_RGB = CIVIDIS.map(rgb);

/** Colour of a class: its own, else that of its index. Classes beyond get hues, so that many can be distinguished. */
export function classColour(value, first = 1, own = {}) {
  if (own[value]) return rgb(own[value]);
  if (value < first) return rgb(PALETTE.nothing);
  const rank = value - first;
  if (rank < PALETTE.classes.length && Object.keys(own).length <= FEW) return rgb(PALETTE.classes[rank]);
  const hue = (rank * 137.508) % 360, light = 0.35 + 0.3 * ((rank * 0.618) % 1);
  return fromHue(hue, 0.55, light);
}

function fromHue(hue, saturation, light) {
  const a = saturation * Math.min(light, 1 - light);
  const part = (n) => {
    const k = (n + hue / 30) % 12;
    return Math.round(255 * (light - a * Math.max(-1, Math.min(k - 3, 9 - k, 1))));
  };
  return [part(0), part(8), part(4)];
}

/** Colour of a number from 0 to 1. */
export function scaleColour(t) {
  const position = Math.min(Math.max(t, 0), 1) * (SCALE_RGB.length - 1);
  const i = Math.min(Math.floor(position), SCALE_RGB.length - 2), f = position - i;
  return SCALE_RGB[i].map((value, k) => Math.round(value + f * (SCALE_RGB[i + 1][k] - value)));
}

const TABLE = new Uint8Array(3 * 256);
for (let i = 0; i < 256; i++) TABLE.set(scaleColour(i / 255), 3 * i);

export function css([r, g, b]) {
  return `rgb(${r} ${g} ${b})`;
}

/** What paints cells of one variable: classes, or numbers over a range. */
export class Painter {
  /** `offset`: the class that gets the first colour; `own`: colours of classes by number. */
  constructor({ classes, offset = 1, own = {}, hidden = new Set(), mix = true, range = [0, 1], log = false, shade = null }) {
    Object.assign(this, { classes, offset, own, hidden, mix, log, range, shade });
    this.nothing = rgb(PALETTE.nothing);
    this.colours = new Map();
    const [low, high] = range;
    this.low = log ? Math.log(low) : low;
    this.span = (log ? Math.log(high) : high) - this.low || 1;
  }

  colour(value) {
    let found = this.colours.get(value);
    if (!found) {
      found = this.hidden.has(value) ? HIDDEN : classColour(value, this.offset, this.own);
      this.colours.set(value, found);
    }
    return found;
  }

  /** Puts the colour of cell i into data at p; `slow` is its time to settle where that is shown by lightness. */
  put(data, p, cells, i, slow) {
    let r, g, b;
    if (this.classes) {
      [r, g, b] = this.colour(cells.first[i]);
      if (this.mix && cells.share && cells.rest[i] > 0) {
        const other = this.colour(cells.second[i]), a = cells.share[i], c = cells.rest[i], all = a + c;
        r = (r * a + other[0] * c) / all;
        g = (g * a + other[1] * c) / all;
        b = (b * a + other[2] * c) / all;
      }
      if (slow !== undefined && slow === slow && this.shade) {
        // Quick to settle: towards white; slow: towards black.
        const [fast, late] = this.shade;
        const t = Math.min(Math.max(Math.log(Math.max(slow, fast) / fast) / Math.log(late / fast), 0), 1);
        const white = Math.max(0, 0.5 - t), black = 1 - 0.55 * Math.max(0, t - 0.35);
        r = (r + (255 - r) * white) * black;
        g = (g + (255 - g) * white) * black;
        b = (b + (255 - b) * white) * black;
      }
    } else {
      const value = cells.first[i];
      if (value !== value) [r, g, b] = this.nothing;
      else {
        const t = ((this.log ? Math.log(value) : value) - this.low) / this.span;
        const k = 3 * Math.round(255 * Math.min(Math.max(t, 0), 1));
        [r, g, b] = [TABLE[k], TABLE[k + 1], TABLE[k + 2]];
      }
    }
    data[p] = r;
    data[p + 1] = g;
    data[p + 2] = b;
    data[p + 3] = 255;
  }
}

/** A range for numbers: the middle 98 %, on a logarithmic scale if they span decades. */
export function rangeOf(values) {
  const finite = Array.from(values).filter(Number.isFinite).sort((a, b) => a - b);
  if (!finite.length) return { range: [0, 1], log: false };
  const at = (share) => finite[Math.min(finite.length - 1, Math.floor(share * finite.length))];
  let low = at(0.01), high = at(0.99);
  if (high === low) [low, high] = [finite[0], finite[finite.length - 1]];
  if (high === low) high = low + (Math.abs(low) || 1);
  return { range: [low, high], log: low > 0 && high / low > 30 };
}

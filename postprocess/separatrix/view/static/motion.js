// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// One motion: time history, phase portrait, the machine moving, events, downloads.
import { fill, h, number, prepare, quantity, save, words } from "./dom.js";
import { drawMachine } from "./machine.js";
import { PALETTE } from "./palette.js";
import { INK, Plot, SOFT, extent, hatch, line } from "./plot.js";

const DRIVER = "#7d8891", SECTION = "#000000";
const SHOWN = 400, FLASH = 0.06;

export class MotionPanel {
  /** `download(what)` returns a promise of a text; null where that cannot be. */
  constructor(codes, download) {
    this.codes = codes;
    this.download = download;
    this.motion = null;
    this.playing = false;
    this.time = 0;
    this.canvases = {
      history: h("canvas", { class: "small", role: "img", tabindex: "0" }),
      phase: h("canvas", { class: "phase", role: "img" }),
      machine: h("canvas", { class: "machine", role: "img" }),
    };
    this.summary = h("p", { class: "note", "aria-live": "polite" }, "Click a point of the map to see the motion from there.");
    this.range = h("select", { "aria-label": "Part of the motion", onchange: () => this.setPart() },
      ...[["first", "first 10 periods"], ["last", "last 10 periods"], ["all", "all of it"]].map(([value, text]) => h("option", { value }, text)));
    this.play = h("button", { onclick: () => this.toggle() }, "Play");
    this.slider = h("input", { type: "range", min: "0", max: "1000", value: "0", "aria-label": "Time", oninput: () => this.scrub() });
    this.clock = h("span", { class: "note" });
    this.events = h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Events" });
    const buttons = ["samples", "events", "case"].map((what) => h("button", { onclick: () => this.fetch(what) },
      { samples: "Samples as CSV", events: "Events as CSV", case: "Case file" }[what]));
    this.downloads = h("div", { class: "bar" }, ...buttons);
    this.body = h("div", { hidden: true },
      h("div", { class: "bar" }, this.range, this.play, this.slider, this.clock),
      this.canvases.history, h("div", { class: "pair" }, this.canvases.phase, h("div", {}, this.canvases.machine)),
      this.downloads, h("details", {}, h("summary", {}, "Events"), this.events));
    this.element = h("section", { "aria-label": "Motion" }, h("h2", {}, "Motion"), this.summary, this.body);
    new ResizeObserver(() => this.draw()).observe(this.canvases.history);
    this.canvases.history.addEventListener("pointermove", (event) => event.buttons && this.pointAt(event));
    this.canvases.history.addEventListener("pointerdown", (event) => this.pointAt(event));
  }

  /** Shows a motion; `machine` is that of its case, `quiet`: while the mouse is followed. */
  show(answer, machine, text, quiet = false) {
    this.motion = answer;
    this.machine = machine;
    this.body.hidden = false;
    this.downloads.hidden = !this.download || quiet;
    const { arrays } = answer;
    this.line = this.merge(arrays);
    // Of stops that the driving body carries, the motion relative to it is shown.
    this.relative = Boolean(answer.summary.two_bodies && arrays.driver_v && String((machine.body || {}).law).includes("backlash"));
    this.plane = this.relative ? relativeTo(arrays) : arrays;
    this.loop = this.relative ? this.merge(this.plane) : this.line;
    if (!quiet) this.listEvents();
    fill(this.summary, text);
    if (!this.chosen && !quiet) this.range.value = "first";
    this.setPart(quiet);
    // The foot is drawn so far off that the body never comes to it.
    this.apart = answer.summary.two_bodies ? 0 : arrays.x.reduce((most, x, i) => Math.max(most, arrays.driver[i] - x), 0);
    const limits = finite([answer.summary.barrier_upper, answer.summary.barrier_lower]);
    const [low, high] = extent(arrays.x, arrays.driver.map((x) => x - this.apart));
    this.reach = answer.summary.two_bodies ? [low, high] : extent([low, high], limits);
    this.draw();
  }

  clear() {
    this.stop();
    this.motion = null;
    this.body.hidden = true;
    fill(this.summary, "Click a point of the map to see the motion from there.");
  }

  /** The line through samples and events, in which the velocity jumps at impacts: times, x, v; not numbers at a jump. */
  merge({ time, x, v, event_time: at, event_x, event_v_before: before, event_v_after: after }) {
    const line = { time: [], x: [], v: [] };
    const add = (t, position, speed) => { line.time.push(t); line.x.push(position); line.v.push(speed); };
    let k = 0;
    for (let i = 0; i < time.length; i++) {
      for (; k < at.length && at[k] <= time[i]; k++) {
        add(at[k], event_x[k], before[k]);
        if (before[k] !== after[k]) {
          add(at[k], event_x[k], NaN);
          add(at[k], event_x[k], after[k]);
        }
      }
      add(time[i], x[i], v[i]);
    }
    return line;
  }

  get period() { return this.motion.summary.drive_period; }

  setPart(quiet = false) {
    const { time } = this.motion.arrays, end = time[time.length - 1], ten = 10 * this.period;
    const part = { first: [0, Math.min(ten, end)], last: [Math.max(0, end - ten), end], all: [0, end] }[this.range.value];
    this.part = part;
    this.from = lowest(time, part[0]);
    this.to = lowest(time, part[1] + 1e-12 * end) || time.length;
    const between = ({ time: times }) => [lowest(times, part[0]), lowest(times, part[1] + 1e-12 * end)];
    this.drawn = between(this.line);
    this.looped = between(this.loop);
    if (!quiet) this.setTime(part[0]);
    this.draw();
  }

  setTime(time) {
    this.time = Math.min(Math.max(time, this.part[0]), this.part[1]);
    this.slider.value = String(Math.round((1000 * (this.time - this.part[0])) / (this.part[1] - this.part[0] || 1)));
    fill(this.clock, `t = ${quantity(this.time, "s", 5)}`);
    this.draw();
  }

  scrub() {
    this.stop();
    this.setTime(this.part[0] + (Number(this.slider.value) / 1000) * (this.part[1] - this.part[0]));
  }

  pointAt(event) {
    if (!this.history) return;
    this.stop();
    const [left, , width] = this.history.box;
    this.setTime(this.part[0] + ((event.offsetX - left) / width) * (this.part[1] - this.part[0]));
  }

  toggle() {
    if (this.playing) return this.stop();
    this.playing = true;
    fill(this.play, "Pause");
    if (this.time >= this.part[1]) this.setTime(this.part[0]);
    // A drive period in one and a half seconds, whatever it is.
    const speed = this.period / 1.5;
    let before = performance.now();
    const step = (now) => {
      if (!this.playing || !this.element.isConnected) return;
      this.setTime(this.time + ((now - before) / 1000) * speed);
      before = now;
      if (this.time >= this.part[1]) return this.stop();
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
    return undefined;
  }

  stop() {
    this.playing = false;
    fill(this.play, "Play");
  }

  draw() {
    if (!this.motion || this.pending) return;
    this.pending = requestAnimationFrame(() => {
      this.pending = null;
      if (!this.element.isConnected || !this.motion) return;
      this.drawHistory();
      this.drawPhase();
      this.drawMachine();
    });
  }

  drawHistory() {
    const [context, width, height] = prepare(this.canvases.history);
    const { arrays, summary } = this.motion;
    const part = (values) => values.subarray(this.from, this.to);
    const barriers = this.fixedBarriers();
    const plot = new Plot(context, width, height, this.part, extent(part(arrays.x), part(arrays.driver), barriers), ["time t (s)", summary.two_bodies ? "positions (m)" : `${this.unitText()}`]);
    this.history = plot;
    plot.clip(() => {
      context.strokeStyle = SOFT;
      context.setLineDash([6, 4]);
      for (const barrier of barriers) line(context, plot.box[0], plot.y(barrier), plot.box[0] + plot.box[2], plot.y(barrier));
      context.setLineDash([]);
      context.strokeStyle = DRIVER;
      context.lineWidth = 1;
      plot.path(arrays.time, arrays.driver, this.from, this.to);
      context.strokeStyle = PALETTE.motion;
      context.lineWidth = 1.5;
      plot.path(this.line.time, this.line.x, ...this.drawn);
      for (let k = 0; k < arrays.event_kind.length; k++) {
        const time = arrays.event_time[k];
        if (time >= this.part[0] && time <= this.part[1] && [1, 2, 9, 10].includes(arrays.event_kind[k])) plot.dot(time, arrays.event_x[k], 2.4, PALETTE.impact);
      }
      context.strokeStyle = INK;
      context.lineWidth = 1;
      line(context, plot.x(this.time), plot.box[1], plot.x(this.time), plot.box[1] + plot.box[3]);
    });
    plot.frame();
    this.canvases.history.setAttribute("aria-label", `Time history of the position from ${number(this.part[0], 4)} to ${number(this.part[1], 4)} s; blue: body, grey: ${summary.two_bodies ? "driving body" : "foot of the spring"}, dots: impacts`);
  }

  unitText() { return isAngle(this.machine) ? "angle x (rad)" : "position x (m)"; }

  fixedBarriers() {
    const { summary } = this.motion;
    if (summary.two_bodies && String((this.machine.body || {}).law).includes("backlash")) return [];
    return finite([summary.barrier_upper, summary.barrier_lower]);
  }

  drawPhase() {
    const [context, width, height] = prepare(this.canvases.phase);
    const arrays = this.plane, { summary } = this.motion;
    const part = (values) => values.subarray(this.from, this.to);
    const barriers = this.relative ? finite([summary.barrier_upper, summary.barrier_lower]) : this.fixedBarriers();
    const labels = this.relative ? ["relative position (m)", "relative velocity (m/s)"] : [this.unitText(), `velocity v (${units(this.machine)[1]})`];
    const plot = new Plot(context, width, height, extent(part(arrays.x), barriers), extent(part(arrays.v)), labels);
    plot.clip(() => {
      context.strokeStyle = PALETTE.motion;
      context.lineWidth = 1.1;
      plot.path(this.loop.x, this.loop.v, ...this.looped);
      context.strokeStyle = PALETTE.impact;
      context.setLineDash([3, 3]);
      for (let k = 0; k < arrays.event_kind.length; k++) {
        if (arrays.event_time[k] < this.part[0] || arrays.event_time[k] > this.part[1] || arrays.event_v_before[k] === arrays.event_v_after[k]) continue;
        line(context, plot.x(arrays.event_x[k]), plot.y(arrays.event_v_before[k]), plot.x(arrays.event_x[k]), plot.y(arrays.event_v_after[k]));
      }
      context.setLineDash([]);
      for (const i of arrays.section || []) {
        if (i >= this.from && i < this.to) plot.dot(arrays.x[i], arrays.v[i], 3, SECTION, "#ffffff");
      }
      const i = Math.min(lowest(arrays.time, this.time), arrays.time.length - 1);
      plot.dot(arrays.x[i], arrays.v[i], 4.5, PALETTE.motion, "#ffffff");
      for (const barrier of barriers) hatch(context, plot.x(barrier), plot.box[1], plot.box[3], barrier === this.motion.summary.barrier_upper ? 1 : -1);
    });
    plot.frame();
    this.canvases.phase.setAttribute("aria-label", "Phase portrait: velocity over position; black dots: points on the stroboscopic section; dashed: jumps at impacts; hatched: barriers");
  }

  drawMachine() {
    const [context, width, height] = prepare(this.canvases.machine);
    const { arrays, summary } = this.motion;
    const i = Math.min(lowest(arrays.time, this.time), arrays.time.length - 1);
    let hit = 0, side = 0;
    for (let k = 0; k < arrays.event_kind.length && arrays.event_time[k] <= this.time; k++) {
      if (![1, 2, 9, 10].includes(arrays.event_kind[k])) continue;
      hit = Math.max(0, 1 - (this.time - arrays.event_time[k]) / (FLASH * this.period));
      side = arrays.event_kind[k] % 2 ? 1 : -1;
    }
    drawMachine(context, width, height, this.machine, summary, this.reach, { x: arrays.x[i], driver: arrays.driver[i] - this.apart, crank: arrays.crank ? arrays.crank[i] : null, hit, side });
    const turned = arrays.crank ? `, crank at ${number(((arrays.crank[i] * 180) / Math.PI) % 360, 3)} degrees` : "";
    this.canvases.machine.setAttribute("aria-label", `The machine at ${number(this.time, 4)} s: x = ${quantity(arrays.x[i], units(this.machine)[0], 4)}${turned}`);
  }

  listEvents() {
    const { arrays } = this.motion, kinds = arrays.event_kind, rows = [], [length, speed] = units(this.machine);
    for (let k = 0; k < Math.min(kinds.length, SHOWN); k++) {
      const cells = [arrays.event_time[k], arrays.event_x[k], arrays.event_v_before[k], arrays.event_v_after[k]];
      rows.push(h("tr", { onclick: () => this.setTime(cells[0]) }, h("td", {}, words(this.codes.events[kinds[k] - 1] || kinds[k])),
        ...cells.map((value) => h("td", { class: "number" }, number(value, 8)))));
    }
    const head = h("tr", {}, h("th", { scope: "col" }, "event"), ...["time (s)", `x (${length})`, `v before (${speed})`, `v after (${speed})`].map((text) => h("th", { class: "number", scope: "col" }, text)));
    const more = kinds.length > SHOWN ? h("p", { class: "note" }, `${kinds.length - SHOWN} more in the CSV`) : null;
    fill(this.events, h("table", {}, h("thead", {}, head), h("tbody", {}, ...rows)), more);
  }

  async fetch(what) {
    const text = await this.download(what);
    if (text !== null) save(text, { samples: "motion.csv", events: "events.csv", case: "case.toml" }[what], what === "case" ? "application/toml" : "text/csv");
  }
}

function isAngle(machine) {
  return (machine.restoring || {}).law === "pendulum";
}

/** Units of position and velocity of a machine. */
export function units(machine) {
  return isAngle(machine) ? ["rad", "rad/s"] : ["m", "m/s"];
}

function finite(values) {
  return values.filter((one) => one !== null && Number.isFinite(one));
}

/** The motion of the driven body relative to the driving one; how fast that is after an impact is not in the events. */
function relativeTo(arrays) {
  const less = (values, others) => values.map((value, i) => value - others[i]);
  return {
    ...arrays, x: less(arrays.x, arrays.driver), v: less(arrays.v, arrays.driver_v), event_x: less(arrays.event_x, arrays.event_driver_x),
    event_v_before: less(arrays.event_v_before, arrays.event_driver_v), event_v_after: arrays.event_v_after.map(() => NaN),
  };
}

/** The first index whose time is not before `value`. */
function lowest(times, value) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < value) low = middle + 1; else high = middle;
  }
  return low;
}

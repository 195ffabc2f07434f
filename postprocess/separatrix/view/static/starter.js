// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Motions from starts that are picked in the map, or under the mouse.
import { fill, number, quantity, words } from "./dom.js";
import { valueAt } from "./mapview.js";
import { units } from "./motion.js";

export class Starter {
  constructor(viewer) {
    this.viewer = viewer;
    this.points = [];
  }

  /** No motion: another map is shown. */
  clear() {
    Object.assign(this, { points: [], started: null, picking: null });
    this.viewer.panel.clear();
  }

  /** Start and parameters of the motion at index coordinates; of a point of the file where these are seen one by one. */
  startAt([a, b]) {
    const { axes } = this.viewer.file, coarse = this.viewer.live.picture ? null : this.viewer.map.perPixel.every((one) => one < 0.34);
    const snap = (i, axis) => (coarse ? Math.min(Math.max(Math.round(i), 0), axis.count - 1) : i);
    const indices = { [this.viewer.across]: snap(a, axes[this.viewer.across]), [this.viewer.up]: snap(b, axes[this.viewer.up]) };
    const start = { x: (this.viewer.file.machine.start || {}).x0 || 0, v: (this.viewer.file.machine.start || {}).v0 || 0, angle: (this.viewer.file.machine.start || {}).crank_angle || 0 };
    const parameters = { ...this.viewer.with }, names = { x0: "x", v0: "v", crank_angle: "angle" };
    axes.forEach((axis, i) => {
      const value = valueAt(axis, i in indices ? indices[i] : this.viewer.at[i]);
      if (axis.start) start[names[axis.path]] = value;
      else if (i in indices) parameters[axis.path] = value;
    });
    const text = Object.entries(parameters).map(([path, value]) => `${path}:${value}`).join(";");
    const found = { file: this.viewer.file.index, ...start, at: this.viewer.fixedAt().join(",") };
    const mark = { x: valueAt(axes[this.viewer.across], indices[this.viewer.across]), y: valueAt(axes[this.viewer.up], indices[this.viewer.up]) };
    return { request: text ? { ...found, with: text } : found, mark };
  }

  async pick(point) {
    if (this.viewer.file.no_motions) return fill(this.viewer.status, `No motions: ${this.viewer.file.no_motions}`);
    const { request, mark } = this.startAt(point);
    const token = (this.picking = {});
    try {
      const answer = await this.viewer.transport.ask("motion", request);
      if (token !== this.picking) return undefined;
      this.viewer.problem.hidden = true;
      this.request = request;
      this.started = this.viewer.transport.live ? mark : { x: answer.start[0], y: answer.start[1] };
      this.showMotion(answer, false);
    } catch (error) {
      this.viewer.fail(error);
    }
    return undefined;
  }

  showMotion(answer, quiet) {
    const { summary, start, arrays } = answer;
    const section = arrays.section || [];
    this.points = Array.from(section).slice(-64).map((i) => [arrays.x[i], arrays.v[i]]);
    const end = arrays.time[arrays.time.length - 1];
    const [length, speed] = units(this.viewer.file.machine);
    const text = [`From x₀ = ${quantity(start[0], length, 9)}, v₀ = ${quantity(start[1], speed, 9)}${start[2] ? `, φ₀ = ${quantity(start[2], "rad", 6)}` : ""}`];
    const parameters = Object.entries(answer.parameters || {}).filter(([path]) => path in this.viewer.with || this.viewer.file.axes.some((axis) => axis.path === path));
    if (parameters.length) text.push(`, ${parameters.map(([path, value]) => `${path} = ${number(value, 8)}`).join(", ")}`);
    if (!quiet && this.viewer.transport.live) {
      text.push(` to x = ${quantity(summary.x, length, 17)}, v = ${quantity(summary.v, speed, 17)} after ${number(end, 6)} s: ${summary.impacts} ${summary.impacts === 1 ? "impact" : "impacts"}, ${words(this.viewer.described.regimes[summary.regime])}, ${words(this.viewer.described.reasons[summary.reason])}; the numbers of “separatrix points”.`);
    } else if (!this.viewer.transport.live) text.push(": the stored motion nearest to the click.");
    this.viewer.panel.show(answer, this.viewer.file.machine, text.join(""), quiet);
    this.viewer.mark();
  }

  async download(what) {
    try {
      const answer = await this.viewer.transport.ask("download", { ...this.request, what });
      return answer.text;
    } catch (error) {
      this.viewer.fail(error);
      return null;
    }
  }

  /** The motion under the mouse: the newest point as soon as the last answer is drawn. */
  async followMouse(point) {
    this.next = point;
    if (this.following) return;
    this.following = true;
    while (this.next) {
      const { request, mark } = this.startAt(this.next);
      this.next = null;
      try {
        const answer = await this.viewer.transport.ask("motion", { ...request, periods: 40, samples: 48 });
        this.request = request;
        this.started = mark;
        this.showMotion(answer, true);
        await new Promise(requestAnimationFrame);
      } catch (error) {
        if (error.status !== 422) this.viewer.fail(error);
      }
    }
    this.following = false;
  }
}

/** A trajectory file as the answer to a request for a motion. */
export function asMotion(file, { arrays }) {
  const motion = { x: arrays.x, v: arrays.v, time: arrays.time, mode: arrays.mode, driver: arrays.drive || arrays.driver_x, driver_v: arrays.driver_v };
  for (const name of ["kind", "time", "x", "v_before", "v_after", "driver_x", "driver_v"]) motion[`event_${name}`] = arrays[`event_${name}`] || new Float64Array(0);
  const { attributes } = file;
  const bound = (name) => (attributes[name] === undefined ? null : attributes[name]);
  const summary = { drive_period: attributes.drive_period, barrier_upper: bound("barrier_upper"), barrier_lower: bound("barrier_lower"), two_bodies: Boolean(arrays.driver_x) };
  const section = [];
  for (let i = 0; i < motion.time.length; i++) if (Math.abs(motion.time[i] / summary.drive_period - Math.round(motion.time[i] / summary.drive_period)) < 1e-6) section.push(i);
  return { arrays: { ...motion, section: Int32Array.from(section) }, summary, start: [arrays.x[0], arrays.v[0], 0] };
}

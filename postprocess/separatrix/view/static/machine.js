// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The machine at an instant, drawn from its case: body, spring, foot or driving body, barriers.
import { PALETTE } from "./palette.js";
import { INK, SOFT, hatch, line } from "./plot.js";

const DRIVER = "#8a949c";

/** Draws a machine. `state`: x, driver, crank (angle of one with a motor, else null), hit (0 to 1, fading after an impact), side of it. `range` of positions. */
export function drawMachine(context, width, height, machine, summary, range, state) {
  const law = (machine.restoring || {}).law;
  if (law === "pendulum") return drawPendulum(context, width, height, summary, state);
  const size = Math.min(34, height * 0.3), left = size * (summary.two_bodies ? 2 : 3.2), right = width - 1.4 * size, ground = height - 22;
  const scale = (right - left) / (range[1] - range[0]);
  const pixel = (x) => left + (x - range[0]) * scale;
  context.strokeStyle = INK;
  context.lineWidth = 1;
  line(context, 8, ground + 0.5, width - 8, ground + 0.5);
  for (let x = 12; x < width - 8; x += 9) line(context, x, ground + 6, x + 6, ground);
  if (summary.two_bodies) return drawPair(context, { pixel, size, ground, machine, summary, state });
  const x = pixel(state.x);
  for (const [barrier, side] of [[summary.barrier_upper, 1], [summary.barrier_lower, -1]]) {
    if (barrier === null || !Number.isFinite(barrier)) continue;
    const wall = pixel(barrier) + (side * size) / 2;
    if (state.hit > 0 && state.side === side) {
      context.fillStyle = PALETTE.impact;
      context.globalAlpha = 0.75 * state.hit;
      context.fillRect(side > 0 ? wall : wall - 9, ground - 2.1 * size, 9, 2.1 * size);
      context.globalAlpha = 1;
    }
    hatch(context, wall, ground - 2.1 * size, 2.1 * size, side);
  }
  if (law !== "none") {
    const foot = pixel(state.driver) - 2.1 * size;
    const middle = ground - size / 2;
    context.fillStyle = DRIVER;
    context.fillRect(foot - 5, ground - size * 0.95, 6, size * 0.9);
    spring(context, foot, x - size / 2, middle);
    if (state.crank !== null && (machine.drive || {}).law !== "unbalance") drawCrank(context, foot - 5, middle, ground - 1.75 * size, size, state.crank);
  }
  box(context, x, ground, size, state);
  if (state.crank !== null && (machine.drive || {}).law === "unbalance") drawRotor(context, x, ground - size / 2, size * 0.36, state.crank);
  return undefined;
}

/** The crank above the foot that it moves, and what links them: at the angle 0 it points to the body. */
function drawCrank(context, foot, middle, y, size, angle) {
  const radius = size * 0.4, axis = Math.max(radius + 3, foot - size);
  const end = [axis + radius * Math.cos(angle), y - radius * Math.sin(angle)];
  context.strokeStyle = INK;
  context.lineWidth = 1;
  circle(context, axis, y, radius + 2);
  context.strokeStyle = SOFT;
  context.lineWidth = 2;
  line(context, ...end, foot, middle);
  drawArm(context, axis, y, end);
}

/** The rotor on the body, its heavy side at the angle. */
function drawRotor(context, x, y, radius, angle) {
  context.strokeStyle = INK;
  context.lineWidth = 1;
  circle(context, x, y, radius);
  drawArm(context, x, y, [x + radius * Math.cos(angle), y - radius * Math.sin(angle)]);
}

function drawArm(context, x, y, end) {
  context.strokeStyle = INK;
  context.lineWidth = 3;
  line(context, x, y, ...end);
  context.fillStyle = INK;
  context.beginPath();
  context.arc(...end, 3.5, 0, 2 * Math.PI);
  context.fill();
}

function circle(context, x, y, radius) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.stroke();
}

function box(context, x, ground, size, state) {
  context.fillStyle = state.hit > 0.5 ? PALETTE.impact : PALETTE.motion;
  context.fillRect(x - size / 2, ground - size, size, size);
  context.strokeStyle = INK;
  context.lineWidth = 1.2;
  context.strokeRect(x - size / 2, ground - size, size, size);
}

function spring(context, from, to, y) {
  const turns = 9, length = to - from, ends = Math.min(8, Math.abs(length) / 4);
  context.beginPath();
  context.moveTo(from, y);
  context.lineTo(from + ends, y);
  for (let i = 0; i < turns; i++) context.lineTo(from + ends + ((i + 0.5) / turns) * (length - 2 * ends), y + (i % 2 ? 7 : -7));
  context.lineTo(to - ends, y);
  context.lineTo(to, y);
  context.strokeStyle = SOFT;
  context.lineWidth = 1.4;
  context.stroke();
}

/** The driven body lies on the driving one; stops stand on the ground or on the driving body. */
function drawPair(context, { pixel, size, ground, machine, summary, state }) {
  const carried = String((machine.body || {}).law).includes("backlash");
  const top = ground - size * 0.55;
  const x1 = pixel(state.driver), x2 = pixel(state.x), long = size * 3.4;
  context.fillStyle = DRIVER;
  context.fillRect(x1 - long / 2, top, long, size * 0.5);
  context.strokeStyle = INK;
  context.strokeRect(x1 - long / 2, top, long, size * 0.5);
  for (const [barrier, side] of [[summary.barrier_upper, 1], [summary.barrier_lower, -1]]) {
    if (barrier === null || !Number.isFinite(barrier)) continue;
    const wall = pixel((carried ? state.driver : 0) + barrier) + (side * size) / 2;
    hatch(context, wall, top - size * 1.1, size * 1.1, side);
  }
  box(context, x2, top, size, state);
}

function drawPendulum(context, width, height, summary, state) {
  const pivot = [width / 2, height / 2], length = height * 0.4;
  const end = (angle) => [pivot[0] + length * Math.sin(angle), pivot[1] + length * Math.cos(angle)];
  context.strokeStyle = INK;
  for (const barrier of [summary.barrier_upper, summary.barrier_lower]) {
    if (barrier === null || !Number.isFinite(barrier)) continue;
    context.lineWidth = 3;
    const [x, y] = end(barrier);
    line(context, pivot[0] + (x - pivot[0]) * 0.75, pivot[1] + (y - pivot[1]) * 0.75, x, y);
  }
  context.lineWidth = 2;
  line(context, pivot[0] - 14, pivot[1], pivot[0] + 14, pivot[1]);
  line(context, ...pivot, ...end(state.x));
  context.beginPath();
  context.arc(...end(state.x), 9, 0, 2 * Math.PI);
  context.fillStyle = state.hit > 0.5 ? PALETTE.impact : PALETTE.motion;
  context.fill();
  context.stroke();
}

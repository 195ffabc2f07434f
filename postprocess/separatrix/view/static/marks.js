// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Marks in the map: attractors with all their points on the section, the start of a motion and its points there.
// Saddles are those of the branches that are open, at the value of their parameter that the picture is for, and those of boundaries.
import { valueAt } from "./mapview.js";
import { classColour, css } from "./palette.js";

export function marksOf({ file, across, up, at, starter, attractorPoints, links, boundaries }) {
  const marks = [], phase = phasePlane(file, across, up);
  if (phase && crankAngle(file, at) === 0) {
    for (const point of starter.points) marks.push({ kind: "section", x: point[phase[0]], y: point[phase[1]], colour: "#000000" });
    for (const one of [...links.saddles, ...boundaries.flatMap((one) => one.saddles)]) {
      const point = [one.x, one.v];
      marks.push({ kind: "saddle", x: point[phase[0]], y: point[phase[1]] });
    }
    for (const one of attractorPoints || []) {
      if (one.period === 0) continue;
      for (const point of one.points) marks.push({ kind: "attractor", x: point[phase[0]], y: point[phase[1]], colour: css(classColour(one.attractor, 1, file.colours)) });
    }
  }
  if (starter.started) marks.push({ kind: "start", ...starter.started });
  return marks;
}

/** Which of x and v is across and up, if the picture is the plane of both. */
function phasePlane({ axes }, across, up) {
  const names = [axes[across].path, axes[up].path].join();
  return { "x0,v0": [0, 1], "v0,x0": [1, 0] }[names] || null;
}

function crankAngle(file, at) {
  const axis = file.axes.findIndex((one) => one.path === "crank_angle");
  return axis >= 0 ? valueAt(file.axes[axis], at[axis]) : (file.machine.start || {}).crank_angle || 0;
}

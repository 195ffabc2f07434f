// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Diagrams over a parameter and the map show the same value of it.
import { number } from "./dom.js";
import { indexOf, valueAt } from "./mapview.js";

export class Links {
  constructor(viewer) {
    Object.assign(this, { viewer, diagrams: [] });
  }

  /** Takes a diagram in; returns its element. */
  add(diagram) {
    this.diagrams.push(diagram);
    return diagram.element;
  }

  /** The diagrams mark the value that the map is for, and branches give the map its saddles. */
  show() {
    if (!this.viewer.file) return;
    for (const diagram of this.diagrams) diagram.mark(this.valueOf(diagram.key));
    this.viewer.mark();
  }

  get saddles() { return this.diagrams.flatMap((diagram) => diagram.saddles()); }

  /** A value of a parameter was picked: its slice, or the machine with that value, computed now. Returns what is shown. */
  choose(key, value) {
    const { viewer } = this, { file } = viewer;
    if (!file) return "";
    const axis = axisOf(file, key);
    if (axis >= 0 && axis !== viewer.across && axis !== viewer.up) {
      const position = Math.round(indexOf(file.axes[axis], value));
      viewer.setSlice(axis, Math.min(Math.max(position, 0), file.axes[axis].count - 1));
      return `The map shows its slice at ${viewer.slicePlace(file.axes[axis], axis)}.`;
    }
    const path = pathOf(file, key);
    if (!path || !viewer.transport.live || axis >= 0) return "No map of this parameter is open.";
    viewer.with = value === file.parameters[path][0] ? {} : { [path]: value };
    viewer.show(true);
    return Object.keys(viewer.with).length ? `The map is computed now for ${path} = ${number(value)}.` : "The map is that of the file.";
  }

  /** The value of a parameter that the picture is for; null if it has none. */
  valueOf(key) {
    const { file, across, up, at } = this.viewer, axis = axisOf(file, key);
    if (axis >= 0) return axis === across || axis === up ? null : valueAt(file.axes[axis], at[axis]);
    const path = pathOf(file, key);
    return path ? this.viewer.with[path] ?? file.parameters[path][0] : null;
  }

  /** What parts the machine of the picture from that of a file of branches, but for the parameter of these. */
  differs({ file, path }) {
    const shown = this.viewer.file;
    if (!shown) return "";
    const changed = { ...this.viewer.with };
    shown.axes.forEach((axis, i) => { if (!axis.start) changed[axis.path] ??= valueAt(axis, this.viewer.at[i]); });
    return difference(shown.machine, file.machine, path, changed);
  }
}

function axisOf(file, key) { return file.axes.findIndex((one) => one.key === key); }

function pathOf(file, key) { return Object.keys(file.parameters || {}).find((one) => one.replaceAll(".", "_") === key); }

/** What parts two machines, as paths of parameters; empty if nothing but the parameter `path` does. */
function difference(one, other, path, changed) {
  const flat = [one, other].map((machine) => flatten(machine, "", {}));
  Object.assign(flat[0], changed);
  const parts = [...new Set(flat.flatMap(Object.keys))].filter((key) => key !== path && flat[0][key] !== flat[1][key]);
  return parts.slice(0, 3).join(", ");
}

function flatten(value, path, into) {
  for (const [key, item] of Object.entries(value)) {
    const full = path ? `${path}.${key}` : key;
    if (!path && !MACHINE.includes(key)) continue;
    if (item && typeof item === "object" && !Array.isArray(item)) flatten(item, full, into);
    else into[full] = Array.isArray(item) ? JSON.stringify(item) : item;
  }
  return into;
}

const MACHINE = ["body", "restoring", "friction", "contact", "drive", "effect"];

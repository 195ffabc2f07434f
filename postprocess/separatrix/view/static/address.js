// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The view in the address of the page, so that a reload shows it again.

const QUIET = 400;

/** The view that the address describes. */
export function restored() {
  const known = new URLSearchParams(location.hash.slice(1));
  return { file: Number(known.get("file")) || 0, variable: known.get("variable"), at: known.get("at"), view: known.get("view") };
}

export class Address {
  constructor(viewer) {
    this.viewer = viewer;
  }

  /** Writes the view down once it rests; notebooks and stored pages have no address of their own. */
  remember() {
    const { viewer } = this;
    if (!viewer.transport.live || viewer.transport.model || !viewer.map.view) return;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      const v = viewer.map.view, text = [v.a0, v.a1, v.b0, v.b1].join(",");
      const known = new URLSearchParams({ file: viewer.maps.indexOf(viewer.file), variable: viewer.variable.name, at: viewer.at.join(","), view: text });
      history.replaceState(null, "", `#${known}`);
    }, QUIET);
  }
}

// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Elements and texts.

/** An element with properties, listeners (onclick ...) and children. */
export function h(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(properties)) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key === "class") element.className = value;
    else if (value === true) element.setAttribute(key, "");
    else element.setAttribute(key, value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

/** Puts new children into an element. */
export function fill(element, ...children) {
  element.replaceChildren(...children.filter((child) => child !== null && child !== undefined));
}

/** A number with so many digits, with a real minus sign and powers of ten. */
export function number(value, digits = 6) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  let text = Number(value).toPrecision(digits);
  if (text.includes("e")) {
    const [mantissa, power] = text.split("e");
    text = `${String(Number(mantissa))}·10^${Number(power)}`;
  } else {
    text = String(Number(text));
    if (text.includes("e")) text = `${text.replace("e", "·10^").replace("+", "")}`;
  }
  return text.replaceAll("-", "−");
}

/** 'non_impact' as a reader expects it. */
export function words(name) {
  return String(name).replace("non_", "non-").replaceAll("_", " ");
}

/** A quantity with its unit. */
export function quantity(value, unit, digits = 6) {
  if (value === null || value === undefined || Number.isNaN(value)) return "none";
  return `${number(value, digits)}${unit ? `\u202f${unit}` : ""}`;
}

/** Lets the user save a text or a blob as a file. */
export function save(content, name, type = "text/plain") {
  const blob = content instanceof Blob ? content : new Blob([content], { type });
  const link = h("a", { href: URL.createObjectURL(blob), download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

/** A canvas scaled to the pixels of the screen: [context, width, height] in CSS pixels. */
export function prepare(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const box = canvas.getBoundingClientRect();
  const width = Math.max(1, Math.round(box.width)), height = Math.max(1, Math.round(box.height));
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return [context, width, height];
}

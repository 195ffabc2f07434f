// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Requests and answers (docs/viewer.md): one interface, three ways.

const KINDS = {
  f32: Float32Array, f64: Float64Array, i8: Int8Array, i16: Int16Array, i32: Int32Array,
  u8: Uint8Array, u16: Uint16Array, u32: Uint32Array, i64: BigInt64Array, u64: BigUint64Array,
};

/** Header and arrays of an answer. */
export function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const arrays = {}, shapes = {};
  for (const one of header.arrays) {
    const count = one.shape.reduce((product, n) => product * n, 1);
    arrays[one.name] = new KINDS[one.type](buffer, 4 + length + one.offset, count);
    shapes[one.name] = one.shape;
  }
  return { ...header, arrays, shapes };
}

/** Work that was ended for a newer view is no answer. */
function unlessStopped(answer) {
  if (answer.stopped) throw new RequestError("stopped", 409);
  return answer;
}

export class RequestError extends Error {
  constructor(message, status) {
    super(message);
    this.status = status;
  }
}

/** The viewer's own server. */
export class HttpTransport {
  constructor(token) {
    this.token = token;
    this.live = true;
    this.keeps = true;
  }

  async ask(name, parameters = {}, { signal, act = false } = {}) {
    const query = new URLSearchParams(parameters).toString();
    let answer;
    try {
      answer = await fetch(`api/${name}${query ? `?${query}` : ""}`, {
        method: act ? "POST" : "GET", signal, cache: "no-store", headers: { "X-Separatrix-Token": this.token },
      });
    } catch (error) {
      if (error.name === "AbortError") throw error;
      throw new RequestError("The viewer does not answer: it was stopped, or the connection is lost. "
        + "Start separatrix-view again and open the address that it prints.", 0);
    }
    if (!answer.ok) {
      let message = `error ${answer.status}`;
      try { message = (await answer.json()).error; } catch { /* not from the viewer */ }
      throw new RequestError(message, answer.status);
    }
    return unlessStopped(unpack(await answer.arrayBuffer()));
  }
}

/** Answers stored in the page. */
export class StoredTransport {
  constructor(stored) {
    this.stored = stored;
    this.live = false;
    this.keeps = false;
  }

  async ask(name, parameters = {}) {
    if (name === "stop") return { arrays: {} };
    const { page, view, ...selection } = parameters;
    let key = `${name}?${new URLSearchParams(selection)}`;
    if (name === "motion") {
      const nearest = this.nearestMotion(parameters);
      if (nearest === null) throw new RequestError("This page has no stored motions.", 404);
      key = `motion?${nearest}`;
    }
    const text = this.stored[key];
    if (text === undefined) throw new RequestError("This is not stored in the page.", 404);
    const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return inflate(unpack(await new Response(stream).arrayBuffer()));
  }

  nearestMotion({ file, x, v, at }) {
    let best = null, distance = Infinity;
    for (const [i, one] of (this.stored.starts || []).entries()) {
      if (String(one.file) !== String(file) || one.at !== at) continue;
      const d = ((one.x - x) / one.width) ** 2 + ((one.v - v) / one.height) ** 2;
      if (d < distance) [best, distance] = [i, d];
    }
    return best;
  }
}

/** A stored motion: its columns are differences of whole numbers of 16 bits. */
function inflate(answer) {
  if (!answer.packed) return answer;
  const { arrays, packed } = answer, time = new Float64Array(arrays.x.length);
  for (let i = 0; i < time.length; i++) time[i] = packed.first + i * packed.step;
  arrays.time = time;
  for (const name of ["x", "v", "driver", "crank"].filter((one) => one in arrays)) {
    const [low, step] = packed[name], values = new Float32Array(time.length), sum = new Int16Array(1);
    for (let i = 0; i < time.length; i++) {
      sum[0] += arrays[name][i];
      values[i] = low + (sum[0] + 32767) * step;
    }
    arrays[name] = values;
  }
  return answer;
}

/** A notebook's kernel. */
export class WidgetTransport {
  constructor(model) {
    this.model = model;
    this.live = true;
    this.keeps = true;
    this.count = 0;
    this.waiting = new Map();
    model.on("msg:custom", (message, buffers) => {
      const one = this.waiting.get(message.id);
      if (!one) return;
      this.waiting.delete(message.id);
      if (message.error) return one.reject(new RequestError(message.error, message.status));
      const view = buffers[0];
      const bytes = view instanceof ArrayBuffer ? new Uint8Array(view) : new Uint8Array(view.buffer, view.byteOffset, view.byteLength);
      const answer = unpack(bytes.slice().buffer);
      if (answer.stopped) one.reject(new RequestError("stopped", 409));
      else one.resolve(answer);
    });
  }

  ask(name, parameters = {}, { act = false } = {}) {
    const id = ++this.count;
    const texts = Object.fromEntries(Object.entries(parameters).map(([key, value]) => [key, String(value)]));
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { resolve, reject });
      this.model.send({ id, name, parameters: texts, act });
    });
  }
}

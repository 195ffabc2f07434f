// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The page of separatrix-view: takes the token from the address, so that it is in no history.
import { mount } from "./app.js";
import { HttpTransport } from "./transport.js";

const STORE = "separatrix-token";
const given = location.hash.slice(1);
if (/^[\w-]{20,}$/.test(given)) {
  sessionStorage.setItem(STORE, given);
  history.replaceState(null, "", location.pathname);
}
mount(document.getElementById("separatrix"), new HttpTransport(sessionStorage.getItem(STORE) || ""));

// The page's elements. What is written already is not written again: that would cost a layout.

/** @type {(id: string) => any} */
export const $ = (id) => document.getElementById(id);

// Takes the focus from what has it: a key would click that too.
export const blur = () => /** @type {any} */ (document.activeElement)?.blur();

export function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function put(id, text, kind = "") {
  const element = $(id);
  write(element, text);
  if (element.className !== kind) element.className = kind;
}

export const make = (tag, textContent = "", className = "") =>
  Object.assign(document.createElement(tag), { textContent, className });

// What this browser remembers; a browser that may not remembers nothing.
export function remembered(name) {
  try { return localStorage.getItem(name); } catch { return null; }
}

export function remember(name, value) {
  try { localStorage.setItem(name, value); } catch { /* not allowed */ }
}

const shown = new Map(); // by id

// What an element shows of a list: made anew where the list or the language has changed.
export function fill(id, all, made) {
  const now = document.documentElement.lang + JSON.stringify(all);
  if (now === shown.get(id)) return;
  shown.set(id, now);
  $(id).replaceChildren(...all.flatMap(made));
}

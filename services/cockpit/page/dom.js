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

// Makes a canvas as large as it is shown, and empties it. Its width and height [px].
export function emptied(canvas) {
  const ratio = devicePixelRatio || 1, g = canvas.getContext("2d"), w = canvas.clientWidth, h = canvas.clientHeight;
  const width = Math.round(w * ratio), height = Math.round(h * ratio);
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.clearRect(0, 0, w, h);
  return [w, h];
}

// Colours of the theme, by name.
export function colours() {
  const style = getComputedStyle(document.documentElement), names = ["paper", "panel", "ink", "dim", "line", "above", "below", "bug", "warn"];
  return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

const shown = new Map(); // by id

// What an element shows of a list: made anew where the list or the language has changed.
export function fill(id, all, made) {
  const now = document.documentElement.lang + JSON.stringify(all);
  if (now === shown.get(id)) return;
  shown.set(id, now);
  $(id).replaceChildren(...all.flatMap(made));
}

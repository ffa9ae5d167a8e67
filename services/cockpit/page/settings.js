// What this browser remembers for its pilot. Each setting has a few values, of which the first is as
// shipped; a button goes through them.

import { remember, remembered } from "./dom.js";

const VALUES = {
  theme: ["dark", "bright", "contrast"],
  crop: ["fill", "whole"],
  sound: ["on", "off"],
  speech: ["off", "on"],
  speed: ["50", "75", "100", "25"], // [%] of full speed at full stick
  map: ["shut", "open"],
  up: ["north", "heading"],
  units: ["metric", "imperial", "knots"],
  language: ["en", "no", "sv", "de", "es", "zh"],
};

/** @type {new (changed: (name: string) => void) => any} */
export const Settings = class {
  constructor(changed) {
    this.changed = changed;
    for (const name of Object.keys(VALUES)) {
      const stored = remembered(name);
      this[name] = VALUES[name].includes(stored) ? stored : VALUES[name][0];
    }
    if (remembered("language") === null) this.language = spoken();
    if (remembered("theme") === null && matchMedia("(prefers-contrast: more)").matches) this.theme = "contrast";
  }

  next(name) { this.set(name, VALUES[name][(VALUES[name].indexOf(this[name]) + 1) % VALUES[name].length]); }

  shipped(name) { return this[name] === VALUES[name][0]; }

  set(name, value) {
    this[name] = value;
    remember(name, value);
    this.changed(name);
  }
};

// The first language of the browser that the page has.
function spoken() {
  const codes = (navigator.languages ?? []).map((each) => each.slice(0, 2).replace(/^n[bn]$/, "no"));
  return codes.find((code) => VALUES.language.includes(code)) ?? "en";
}

// A depth and a heading that the drone goes to by itself: typed, or in steps. A deflected stick takes
// over at any moment.

import { $, blur } from "./dom.js";
import { stepped } from "./steering.js";
import { units } from "./units.js";

const STEP_M = 0.5, STEP_DEG = 10; // of a key

export class Goto {
  // view(): the drone; wish(what, fields); say(key): why not
  constructor(view, wish, say) {
    this.view = view;
    this.wish = wish;
    this.say = say;
    $("goto").addEventListener("submit", (e) => { e.preventDefault(); this.go(); });
    for (const button of $("goto").querySelectorAll("[data-step]"))
      button.addEventListener("click", () => this.turn(button.parentElement.querySelector("input"), Number(button.dataset.step)));
  }

  // The fields say what the drone holds now.
  fill() {
    const view = this.view(), depth = units.length(view.depth_wanted_m ?? view.depth_m);
    $("goto-depth").value = depth === undefined ? "" : depth.toFixed(1);
    const heading = view.heading_wanted_deg ?? view.heading_deg;
    $("goto-heading").value = heading === undefined ? "" : String(Math.round(heading) % 360);
    $("goto").querySelector(".unit").textContent = units.lengthUnit;
  }

  turn(input, by) {
    const value = (number(input) ?? 0) + by;
    input.value = input.id === "goto-heading" ? String(((value % 360) + 360) % 360) : Math.max(0, value).toFixed(1);
  }

  go() {
    const depth = number($("goto-depth")), heading_deg = number($("goto-heading"));
    if (depth === undefined && heading_deg === undefined) return this.say("goto.nothing");
    if (depth < 0 || Number.isNaN(depth) || !(Math.abs(heading_deg ?? 0) <= 360)) return this.say("goto.wrong");
    this.wish("goto", {
      ...(depth === undefined ? {} : { depth: units.metres(depth) }),
      ...(heading_deg === undefined ? {} : { heading_deg }),
    });
    blur();
  }

  deeper(way) {
    const view = this.view(), from = view.depth_wanted_m ?? view.depth_m;
    if (from !== undefined) this.wish("goto", { depth: Math.max(0, from + way * STEP_M) });
  }

  turned(way) {
    const view = this.view(), from = view.heading_wanted_deg ?? view.heading_deg;
    if (from !== undefined) this.wish("goto", { heading_deg: (from + way * STEP_DEG + 360) % 360 });
  }

  light(way) {
    const value = stepped(this.view().light, way);
    if (value !== undefined) this.wish("light", { value });
  }
}

// undefined: empty; NaN: no number. A comma is a point: that is how half of the pilots write it.
function number(input) {
  const text = input.value.trim().replace(",", ".");
  return text === "" ? undefined : /^-?\d+\.?\d*$/.test(text) ? Number(text) : NaN;
}

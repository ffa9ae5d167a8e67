// A depth and a heading that the drone goes to by itself: typed, or in steps. A deflected stick takes
// over at any moment.

import { $, blur } from "./dom.js";
import { stepped } from "./steering.js";
import { units } from "./units.js";

const STEP_M = 0.5, STEP_DEG = 10; // of a key

// view(): the drone; wish(what, fields); say(key): why not
/** @param {() => PageView} view */
export function gotoPanel(view, wish, say) {
  const depthWanted = () => view().depth_wanted_m ?? view().depth_m;
  const headingWanted = () => view().heading_wanted_deg ?? view().heading_deg;

  function turn(input, by) {
    const value = (number(input) ?? 0) + by;
    input.value = input.id === "goto-heading" ? String(((value % 360) + 360) % 360) : Math.max(0, value).toFixed(1);
  }

  function go() {
    const depth = number($("goto-depth")), heading_deg = number($("goto-heading"));
    if (depth === undefined && heading_deg === undefined) return say("goto.nothing");
    if (depth < 0 || Number.isNaN(depth) || !(Math.abs(heading_deg ?? 0) <= 360)) return say("goto.wrong");
    wish("goto", { // what is undefined is left out of a text
      depth: depth === undefined ? undefined : units.metres(depth), heading_deg,
    });
    blur();
  }

  $("goto").addEventListener("submit", (e) => { e.preventDefault(); go(); });
  for (const button of $("goto").querySelectorAll("[data-step]"))
    button.addEventListener("click", () => turn(button.parentElement.querySelector("input"), Number(button.dataset.step)));
  return {
    // The fields say what the drone holds now.
    fill() {
      const depth = units.length(depthWanted()), heading = headingWanted();
      $("goto-depth").value = depth === undefined ? "" : depth.toFixed(1);
      $("goto-heading").value = heading === undefined ? "" : String(Math.round(heading) % 360);
      $("goto").querySelector(".unit").textContent = units.lengthUnit;
    },
    deeper(way) {
      const from = depthWanted();
      if (from !== undefined) wish("goto", { depth: Math.max(0, from + way * STEP_M) });
    },
    turned(way) {
      const from = headingWanted();
      if (from !== undefined) wish("goto", { heading_deg: (from + way * STEP_DEG + 360) % 360 });
    },
    light(way) {
      const value = stepped(view().light, way);
      if (value !== undefined) wish("light", { value });
    },
  };
}

// undefined: empty; NaN: no number. A comma is a point: that is how half of the pilots write it.
function number(input) {
  const text = input.value.trim().replace(",", ".");
  return text === "" ? undefined : /^-?\d+\.?\d*$/.test(text) ? Number(text) : NaN;
}

// Keys that are down. Another window gets their release, so all count as released with the focus. The
// same holds for Ctrl, Alt and Meta: what is pressed with them is the browser's.

import { blur } from "./dom.js";
import { level } from "./steering.js";

const STEERS = ["steer", "tool"]; // while they are down

// press(action): once; hold(action, isDown): what is deliberate; moved(): a key that steers;
// idle(event): a key that does nothing
export function watchKeyboard(keys, press, hold, moved, idle) {
  const down = new Set(); // codes
  const on = (action) => Number(keys.codes(action).some((code) => down.has(code)));

  function release() {
    down.clear();
    for (const action of ["arm", "disarm"]) hold(action, false);
    moved();
  }

  addEventListener("keydown", (event) => {
    const row = keys.actions.get(event.code), stop = row?.action === "stop";
    if ((event.ctrlKey || event.altKey || event.metaKey) && !stop) return release();
    if (writes(event.target) && !stop) return;
    if (!row) return event.repeat || idle(event);
    // A button that has the focus would be clicked by Space or Enter as well.
    event.preventDefault();
    blur();
    if (event.repeat) return;
    down.add(event.code);
    if (STEERS.includes(row.kind)) moved();
    else if (row.kind === "hold") hold(row.action, true);
    else press(row.action);
  }, { capture: true });
  addEventListener("keyup", (event) => {
    const row = keys.actions.get(event.code);
    if (!down.delete(event.code) || !row) return;
    event.preventDefault();
    if (STEERS.includes(row.kind)) moved();
    if (row.kind === "hold") hold(row.action, false);
  }, { capture: true });
  addEventListener("blur", release);
  return {
    release,
    get moving() { return [...down].some((code) => keys.actions.get(code)?.kind === "steer"); },
    get gripper() { return on("gripper_open") - on("gripper_close"); },
    sticks(limit) {
      const g = level(limit, on("slow"), on("boost"));
      return {
        surge: g * (on("ahead") - on("back")), sway: g * (on("starboard") - on("port")),
        heave: g * (on("sink") - on("rise")), yaw: g * (on("turn_starboard") - on("turn_port")),
        tilt: on("tilt_up") - on("tilt_down"),
      };
    },
  };
}

// Does this element take what is typed?
function writes(element) {
  return element?.matches?.("input:not([type=checkbox]), textarea") ?? false;
}

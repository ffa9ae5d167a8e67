// Keys that are down. Another window gets their release, so all count as released with the focus. The
// same holds for Ctrl, Alt and Meta: what is pressed with them is the browser's.

import { blur } from "./dom.js";
import { level } from "./steering.js";

export class Keyboard {
  // press(action): once; hold(action, isDown): what is deliberate; moved(): a key that steers;
  // idle(event): a key that does nothing
  constructor(keys, press, hold, moved, idle) {
    this.keys = keys;
    this.press = press;
    this.hold = hold;
    this.moved = moved;
    this.idle = idle;
    this.down = new Set(); // codes
    addEventListener("keydown", (e) => this.pressed(e), { capture: true });
    addEventListener("keyup", (e) => this.let(e), { capture: true });
    addEventListener("blur", () => this.release());
  }

  pressed(event) {
    const row = this.keys.actions.get(event.code);
    const stop = row?.action === "stop";
    if ((event.ctrlKey || event.altKey || event.metaKey) && !stop) return this.release();
    if (writes(event.target) && !stop) return;
    if (!row) return event.repeat || this.idle(event);
    // A button that has the focus would be clicked by Space or Enter as well.
    event.preventDefault();
    blur();
    if (event.repeat) return;
    this.down.add(event.code);
    if (row.kind === "steer" || row.kind === "tool") this.moved();
    else if (row.kind === "hold") this.hold(row.action, true);
    else this.press(row.action);
  }

  let(event) {
    const row = this.keys.actions.get(event.code);
    if (!this.down.delete(event.code) || !row) return;
    event.preventDefault();
    if (row.kind === "steer" || row.kind === "tool") this.moved();
    if (row.kind === "hold") this.hold(row.action, false);
  }

  release() {
    this.down.clear();
    for (const action of ["arm", "disarm"]) this.hold(action, false);
    this.moved();
  }

  get moving() { return [...this.down].some((code) => this.keys.actions.get(code)?.kind === "steer"); }

  on(action) { return Number(this.keys.codes(action).some((code) => this.down.has(code))); }

  get gripper() { return this.on("gripper_open") - this.on("gripper_close"); }

  sticks(limit) {
    const on = (action) => this.on(action), g = level(limit, on("slow"), on("boost"));
    return {
      surge: g * (on("ahead") - on("back")), sway: g * (on("starboard") - on("port")),
      heave: g * (on("sink") - on("rise")), yaw: g * (on("turn_starboard") - on("turn_port")),
      tilt: on("tilt_up") - on("tilt_down"),
    };
  }
}

// Does this element take what is typed?
function writes(element) {
  return element?.matches?.("input:not([type=checkbox]), textarea") ?? false;
}

// The browser's gamepad. It is trusted once its sticks were centred. How long ago it last reported
// anything goes to the service with every position, which judges whether it is frozen.

import { remember, remembered } from "./dom.js";
import { level, shape } from "./steering.js";

const DEAD_BAND = 0.12, EXPO = 0.4;
const HELD = ["arm", "disarm"]; // what is deliberate
const PRESSED = ["stop", "light", "light_2", "laser", "film", "snapshot", "speed", "next_camera"];
const MOVED = 0.6; // of a stick's travel: it is this one that is meant
const STORE = "pads";
// Of a pad that the browser knows ("standard"): axes with their sign, and buttons.
const STANDARD = {
  ahead: [3, -1], starboard: [2, 1], rise: [1, -1], turn_starboard: [0, 1],
  stop: 1, light: 3, slow: 6, boost: 7, disarm: 8, arm: 9, tilt_up: 12, tilt_down: 13,
  light_2: 0, laser: 2, gripper_close: 4, gripper_open: 5,
};
export const PAD_ACTIONS = ["ahead", "starboard", "rise", "turn_starboard", "stop", "arm", "disarm", "light", "slow", "boost", "tilt_up", "tilt_down", "gripper_open", "gripper_close", "light_2", "laser", "speed", "film", "snapshot", "next_camera"];
const AXES = PAD_ACTIONS.slice(0, 4);

export class Pad {
  constructor(press, hold) {
    this.press = press;
    this.hold = hold;
    try { this.maps = JSON.parse(remembered(STORE)) ?? {}; } catch { this.maps = {}; }
    this.clear();
  }

  forget() {
    for (const what of HELD) if (this.pressed[what]) this.hold(what, false);
    this.clear();
  }

  clear() {
    this.id = null;
    this.trusted = false;
    this.values = "";
    this.reported = 0; // [ms]
    this.pressed = {};
    this.waits = null; // for the stick or button of an action
  }

  // What the pilot has chosen goes before: a button of his has no other action beside it.
  get map() {
    const own = this.maps[this.pad?.id] ?? {}, taken = Object.values(own);
    const standard = Object.entries(this.pad?.mapping === "standard" ? STANDARD : {});
    return { ...Object.fromEntries(standard.filter(([, to]) => !taken.includes(to))), ...own };
  }

  // Read it. Returns the raw pad, or null when there is none.
  look() {
    const pads = navigator.getGamepads ? [...navigator.getGamepads()] : [];
    this.any = pads.find((p) => p?.connected) ?? null; // also one that has no mapping yet
    const found = pads.filter((p) => p && p.connected && (p.mapping === "standard" || this.maps[p.id] || this.waits));
    const pad = found.find((p) => p.index === this.index && p.id === this.id) ?? found[0] ?? null;
    const same = pad && pad.id === this.id && pad.index === this.index;
    if (this.id !== null && !same) this.forget();
    this.pad = pad;
    if (!pad) return null;
    this.id = pad.id;
    this.index = pad.index;
    this.now = this.map;
    const values = `${pad.timestamp} ${pad.axes} ${pad.buttons.map((b) => b.value)}`;
    if (values !== this.values) { this.values = values; this.reported = performance.now(); }
    if (this.waits) return this.learn(pad);
    this.trusted ||= !this.moving;
    for (const what of PRESSED) this.edge(what, () => this.press(what));
    for (const what of HELD) this.edge(what, () => this.hold(what, true), () => this.hold(what, false));
    return pad;
  }

  edge(what, down, up = () => {}) {
    const now = Boolean(this.pad.buttons[this.now[what]]?.pressed);
    const before = this.pressed[what] ?? now; // held when it was plugged in: not pressed now
    this.pressed[what] = now;
    if (!now && before) up();
    if (now && !before && (this.trusted || what === "stop" || what === "disarm")) down();
  }

  // Until a stick is pushed or a button pressed: that is what the action has from now on.
  wait(action) { this.waits = action && { action, axes: null, buttons: null }; }

  learn(pad) {
    const { action } = this.waits;
    this.edge("stop", () => this.press("stop"));
    this.trusted = false; // and nothing else acts meanwhile
    this.waits.axes ??= [...pad.axes];
    this.waits.buttons ??= pad.buttons.map((b) => b.pressed);
    const pressed = pad.buttons.findIndex((b, k) => b.pressed && !this.waits.buttons[k]);
    const moved = pad.axes.findIndex((a, k) => Math.abs(a - this.waits.axes[k]) > MOVED);
    this.waits.buttons = pad.buttons.map((b) => b.pressed);
    if (AXES.includes(action) ? moved >= 0 : pressed >= 0 && (action === "stop" || pressed !== this.now.stop))
      this.set(action, AXES.includes(action) ? [moved, Math.sign(pad.axes[moved] - this.waits.axes[moved])] : pressed);
    return pad;
  }

  set(action, to) {
    const map = { ...this.map };
    for (const [other, button] of Object.entries(map)) if (button === to) map[other] = -1; // it has none now
    this.keep({ ...map, [action]: to });
  }

  reset() { this.keep(undefined); }

  keep(map) {
    if (this.pad) this.maps[this.pad.id] = map;
    this.pressed = {};
    this.waits = null;
    remember(STORE, JSON.stringify(this.maps));
  }

  // -1 … 1 of an axis, shaped.
  travel(action) {
    const [axis, sign] = this.now[action] ?? [-1, 1];
    return sign * shape(this.pad.axes[axis] ?? 0, DEAD_BAND, EXPO);
  }

  get moving() { return AXES.some((action) => this.travel(action) !== 0); }

  get active() { return this.pad !== null && this.trusted && this.moving; }

  get age() { return performance.now() - this.reported; }

  pulled(what) { return this.pad.buttons[this.now[what]]?.value ?? 0; }

  get gripper() {
    if (!this.pad || !this.trusted || this.waits) return 0;
    return this.pulled("gripper_open") - this.pulled("gripper_close");
  }

  sticks(limit) {
    const pulled = (what) => this.pulled(what), g = level(limit, pulled("slow"), pulled("boost"));
    const of = (action) => g * this.travel(action);
    const tilt = pulled("tilt_up") - pulled("tilt_down");
    return { surge: of("ahead"), sway: of("starboard"), heave: -of("rise"), yaw: of("turn_starboard"), tilt };
  }
}

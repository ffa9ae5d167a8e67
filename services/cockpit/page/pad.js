// The browser's gamepad. It is trusted once its sticks were centred. How long ago it last reported
// anything goes to the service with every position, which judges whether it is frozen.

import { shape } from "/shape.js";

const DEAD_BAND = 0.12, EXPO = 0.4;
const B = { stop: 1, light: 3, slow: 6, boost: 7, disarm: 8, arm: 9, up: 12, down: 13 };

const HELD = ["arm", "disarm"]; // what is deliberate

export class Pad {
  constructor(press, hold) {
    this.press = press;
    this.hold = hold;
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
  }

  // Read it. Returns the raw pad, or null when there is none.
  look() {
    const pads = navigator.getGamepads ? [...navigator.getGamepads()] : [];
    const found = pads.filter((p) => p && p.connected && p.mapping === "standard");
    const pad = found.find((p) => p.index === this.index && p.id === this.id) ?? found[0] ?? null;
    const same = pad && pad.id === this.id && pad.index === this.index;
    if (this.id !== null && !same) this.forget();
    this.pad = pad;
    if (!pad) return null;
    this.id = pad.id;
    this.index = pad.index;
    const values = `${pad.timestamp} ${pad.axes} ${pad.buttons.map((b) => b.value)}`;
    if (values !== this.values) { this.values = values; this.reported = performance.now(); }
    this.trusted ||= !this.moving;
    for (const what of ["stop", "light"]) this.edge(what, () => this.press(what));
    for (const what of HELD) this.edge(what, () => this.hold(what, true), () => this.hold(what, false));
    return pad;
  }

  edge(what, down, up = () => {}) {
    const now = Boolean(this.pad.buttons[B[what]]?.pressed);
    const before = this.pressed[what] ?? now; // held when it was plugged in: not pressed now
    this.pressed[what] = now;
    if (!now && before) up();
    if (now && !before && (this.trusted || what === "stop" || what === "disarm")) down();
  }

  get moving() { return this.pad.axes.slice(0, 4).some((a) => shape(a, DEAD_BAND, EXPO) !== 0); }

  get active() { return this.pad !== null && this.trusted && this.moving; }

  get age() { return performance.now() - this.reported; }

  sticks(gain) {
    const pulled = (k) => this.pad.buttons[k]?.value ?? 0;
    const g = Math.min(1, gain + pulled(B.boost) * (1 - gain) - pulled(B.slow) * gain * 0.6);
    const [leftX, leftY, rightX, rightY] = this.pad.axes.map((a) => g * shape(a, DEAD_BAND, EXPO));
    const tilt = pulled(B.up) - pulled(B.down);
    return { surge: -rightY, sway: rightX, heave: leftY, yaw: leftX, tilt };
  }
}

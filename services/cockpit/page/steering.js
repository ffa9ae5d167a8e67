// Which device steers: the one that was moved last.

import { shape } from "./shape.js";

const CENTRED = { surge: 0, sway: 0, heave: 0, yaw: 0, tilt: 0 };
const DEAD_BAND = 0.06, EXPO = 0.4;

export class Steering {
  constructor(left, right, keyboard, pad, tools) {
    this.left = left;
    this.right = right;
    this.keyboard = keyboard;
    this.pad = pad;
    this.tools = tools;
    this.device = "touch";
  }

  // What the service is told: sticks with their device, or null when the device has gone.
  read(limit) {
    const sticks = this.sticks(limit);
    const gripper = this.tools.gripper + this.keyboard.gripper + this.pad.gripper;
    return sticks && { ...sticks, gripper: Math.max(-1, Math.min(1, gripper)) };
  }

  sticks(limit) {
    this.pad.look();
    if (this.left.down || this.right.down) this.device = "touch";
    else if (this.keyboard.moving) this.device = "keyboard";
    else if (this.pad.active) this.device = "pad";
    if (this.device === "pad" && !this.pad.pad) return null;
    if (this.device === "pad" && (!this.pad.trusted || this.pad.waits)) return { ...CENTRED, device: this.name };
    if (this.device === "pad")
      return { ...this.pad.sticks(limit), device: this.name, device_ms: this.pad.age };
    if (this.device === "keyboard") return { ...this.keyboard.sticks(limit), device: "keyboard" };
    const of = (travel) => limit * shape(travel, DEAD_BAND, EXPO);
    return {
      surge: of(-this.right.y), sway: of(this.right.x), heave: of(this.left.y),
      yaw: of(this.left.x), tilt: 0, device: "touch",
    };
  }

  get moving() { return this.left.down || this.right.down || this.keyboard.moving || this.pad.active; }

  get name() { return `pad ${this.pad.id}`.slice(0, 100); }

  // It was pressed: of two that steer nothing it is the one that the pilot has in his hands.
  used(device) {
    if (this.device === "touch" && !this.left.down && !this.right.down) this.device = device;
  }

  release() {
    this.left.release();
    this.right.release();
    this.keyboard.release();
    this.tools.release();
  }
}

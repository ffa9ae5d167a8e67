// From fingers, keys and pads to sticks: a stick for a thumb, its shape, and which device steers.

const CENTRED = { surge: 0, sway: 0, heave: 0, yaw: 0, tilt: 0 };
const DEAD_BAND = 0.06, EXPO = 0.4;
const STEPS = [0, 0.25, 0.5, 0.75, 1]; // of a dimmer

// Share of full speed at full stick: the pilot's limit, less while slow is held, all while boost is; both
// 0 … 1, and continuous, so that a trigger causes no jump.
export function level(limit, slow, boost) {
  return Math.min(1, limit + boost * (1 - limit) - slow * limit * 0.6);
}

// Odd, monotonic, 0 inside the dead-band, continuous at its edge, ±1 at full travel; NaN is 0.
export function shape(travel, deadBand, expo) {
  const beyond = (Math.min(Math.abs(travel), 1) - deadBand) / (1 - deadBand);
  if (!(beyond > 0)) return 0;
  return Math.sign(travel) * beyond * (1 - expo * (1 - beyond * beyond));
}

// The next step up or down; undefined: there is none.
export function stepped(now, way) {
  return way > 0 ? STEPS.find((each) => each > (now ?? 0) + 0.01) : STEPS.findLast((each) => each < (now ?? 0) - 0.01);
}

// One stick for one thumb. It is centred where it is drawn, and returns when it is let go.

export class TouchStick {
  // moved(): it was moved
  constructor(element, moved) {
    this.moved = moved;
    this.x = 0; // [-] + right
    this.y = 0; // [-] + down
    this.pointer = null;
    this.knob = element.querySelector("i");
    this.element = element;
    element.addEventListener("pointerdown", (e) => {
      if (this.pointer !== null || e.pointerType === "mouse") return;
      e.preventDefault();
      this.pointer = e.pointerId;
      element.setPointerCapture(e.pointerId);
      element.classList.add("down");
      this.move(e);
    });
    element.addEventListener("pointermove", (e) => e.pointerId === this.pointer && this.move(e));
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"])
      element.addEventListener(name, (e) => e.pointerId === this.pointer && this.release());
  }

  move(event) {
    const box = this.element.getBoundingClientRect();
    const reach = box.width * 0.42;
    let x = (event.clientX - box.left - box.width / 2) / reach;
    let y = (event.clientY - box.top - box.height / 2) / reach;
    const length = Math.hypot(x, y);
    if (length > 1) { x /= length; y /= length; }
    this.show(x, y);
  }

  release() {
    this.pointer = null;
    this.element.classList.remove("down");
    this.show(0, 0);
  }

  show(x, y) {
    this.x = x;
    this.y = y;
    this.moved();
    const reach = this.element.clientWidth * 0.33;
    this.knob.style.transform = `translate(calc(-50% + ${x * reach}px), calc(-50% + ${y * reach}px))`;
  }

  get down() { return this.pointer !== null; }
}

// Which device steers: the one that was moved last.

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

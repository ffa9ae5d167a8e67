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
// moved(): it was moved
export function touchStick(element, moved) {
  const knob = element.querySelector("i"), stick = {
    x: 0, // [-] + right
    y: 0, // [-] + down
    get down() { return pointer !== null; },
    release() {
      pointer = null;
      element.classList.remove("down");
      show(0, 0);
    },
  };
  let pointer = null;

  function move(event) {
    const box = element.getBoundingClientRect(), reach = box.width * 0.42;
    const x = (event.clientX - box.left - box.width / 2) / reach, y = (event.clientY - box.top - box.height / 2) / reach;
    const beyond = Math.max(1, Math.hypot(x, y));
    show(x / beyond, y / beyond);
  }

  function show(x, y) {
    [stick.x, stick.y] = [x, y];
    moved();
    const reach = element.clientWidth * 0.33;
    knob.style.transform = `translate(calc(-50% + ${x * reach}px), calc(-50% + ${y * reach}px))`;
  }

  element.addEventListener("pointerdown", (e) => {
    if (pointer !== null || e.pointerType === "mouse") return;
    e.preventDefault();
    pointer = e.pointerId;
    element.setPointerCapture(e.pointerId);
    element.classList.add("down");
    move(e);
  });
  element.addEventListener("pointermove", (e) => e.pointerId === pointer && move(e));
  for (const name of ["pointerup", "pointercancel", "lostpointercapture"])
    element.addEventListener(name, (e) => e.pointerId === pointer && stick.release());
  return stick;
}

// Which device steers: the one that was moved last.
export function steeringBy(left, right, keyboard, pad, tools) {
  let device = "touch";
  const touched = () => left.down || right.down;
  const padName = () => `pad ${pad.id}`.slice(0, 100);

  function sticks(limit) {
    pad.look();
    if (touched()) device = "touch";
    else if (keyboard.moving) device = "keyboard";
    else if (pad.active) device = "pad";
    if (device === "pad" && !pad.pad) return null;
    if (device === "pad" && (!pad.trusted || pad.waits)) return { ...CENTRED, device: padName() };
    if (device === "pad") return { ...pad.sticks(limit), device: padName(), device_ms: pad.age };
    if (device === "keyboard") return { ...keyboard.sticks(limit), device };
    const of = (travel) => limit * shape(travel, DEAD_BAND, EXPO);
    return { surge: of(-right.y), sway: of(right.x), heave: of(left.y), yaw: of(left.x), tilt: 0, device };
  }

  return {
    get device() { return device; },
    get moving() { return touched() || keyboard.moving || pad.active; },
    // What the service is told: sticks with their device, or null when the device has gone.
    read(limit) {
      const read = sticks(limit), gripper = tools.gripper + keyboard.gripper + pad.gripper;
      return read && { ...read, gripper: Math.max(-1, Math.min(1, gripper)) };
    },
    // It was pressed: of two that steer nothing it is the one that the pilot has in his hands.
    used(pressed) {
      if (device === "touch" && !touched()) device = pressed;
    },
    release() {
      for (const each of [left, right, keyboard, tools]) each.release();
    },
  };
}

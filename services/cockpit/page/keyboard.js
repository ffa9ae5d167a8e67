// Keys that are down. Another window gets their release, so all count as released with the focus.

const MOVES = new Set(["KeyW", "KeyS", "KeyA", "KeyD", "ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight", "KeyR", "KeyF"]);
const PRESSES = { Space: "stop", Backspace: "disarm", KeyL: "light" };

export class Keyboard {
  // press(what): a key that asks for something; hold(isDown): Enter; moved(): a key that steers
  constructor(press, hold, moved) {
    this.keys = new Set();
    addEventListener("keydown", (e) => {
      if (e.ctrlKey && e.code.startsWith("Key") && !MOVES.has(e.code)) return; // the browser's own
      const known = MOVES.has(e.code) || e.code in PRESSES || e.code === "Enter";
      // A button that has the focus would be clicked by Space or Enter as well.
      if (known) { e.preventDefault(); document.activeElement?.blur(); }
      this.keys.add(e.code);
      if (e.repeat) return;
      if (MOVES.has(e.code)) moved();
      if (e.code in PRESSES) press(PRESSES[e.code]);
      if (e.code === "Enter") hold(true);
    }, { capture: true });
    addEventListener("keyup", (e) => {
      if (e.code in PRESSES || e.code === "Enter") e.preventDefault();
      this.keys.delete(e.code);
      if (MOVES.has(e.code)) moved();
      if (e.code === "Enter") hold(false);
    }, { capture: true });
    addEventListener("blur", () => { this.keys.clear(); hold(false); });
  }

  get moving() { return [...this.keys].some((key) => MOVES.has(key)); }

  sticks(gain) {
    const on = (key) => Number(this.keys.has(key));
    const either = (a) => Number(this.keys.has(`${a}Left`) || this.keys.has(`${a}Right`));
    const g = Math.max(0.1, Math.min(1, gain * (1 + either("Shift") - 0.6 * either("Control"))));
    return {
      surge: g * (on("KeyW") - on("KeyS")), sway: g * (on("KeyD") - on("KeyA")),
      heave: g * (on("ArrowDown") - on("ArrowUp")), yaw: g * (on("ArrowRight") - on("ArrowLeft")),
      tilt: on("KeyR") - on("KeyF"),
    };
  }
}

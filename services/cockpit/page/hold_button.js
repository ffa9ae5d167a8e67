// A button that must be held for a second: arming is deliberate.

const HOLD_MS = 1000;

export class HoldButton {
  // begin(): it was pressed; done(): it was held long enough
  constructor(element, begin, done) {
    Object.assign(this, { element, begin, done });
    this.since = null;
    element.addEventListener("pointerdown", (e) => {
      e.preventDefault();
      element.setPointerCapture(e.pointerId);
      this.press();
    });
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"])
      element.addEventListener(name, () => this.release());
    element.addEventListener("contextmenu", (e) => e.preventDefault());
  }

  press() {
    if (this.since !== null || this.element.disabled || this.element.hidden) return;
    this.since = performance.now();
    this.begin();
    requestAnimationFrame(() => this.grow());
  }

  release() {
    this.since = null;
    this.element.style.setProperty("--held", 0);
  }

  grow() {
    if (this.since === null) return;
    const share = (performance.now() - this.since) / HOLD_MS;
    this.element.style.setProperty("--held", Math.min(share, 1));
    if (share < 1) requestAnimationFrame(() => this.grow());
    else { this.release(); this.done(); }
  }
}

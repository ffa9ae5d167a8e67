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
    element.addEventListener("pointerup", () => this.end());
    for (const name of ["pointercancel", "lostpointercapture"])
      element.addEventListener(name, () => this.release());
    element.addEventListener("contextmenu", (e) => e.preventDefault());
  }

  press() {
    if (this.since !== null || this.element.disabled || this.element.hidden) return;
    this.since = performance.now();
    this.begin();
    this.timer = setInterval(() => this.grow(), 40);
  }

  // Let go of: on a busy computer this may be noticed before the last step of growing.
  end() {
    if (this.since !== null) this.grow();
    this.release();
  }

  release() {
    this.since = null;
    clearInterval(this.timer);
    this.element.style.setProperty("--held", 0);
  }

  grow() {
    const share = (performance.now() - this.since) / HOLD_MS;
    this.element.style.setProperty("--held", Math.min(share, 1));
    if (share < 1) return;
    this.release();
    this.done();
  }
}

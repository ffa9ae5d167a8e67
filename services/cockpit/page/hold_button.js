// A button that must be held for a second: what it does is deliberate. It does what stood there when
// the hold began; where that changes meanwhile, the hold is void, and nothing is done.

const HOLD_MS = 1000;

export class HoldButton {
  // meaning(): what it asks for now; begin(): it was pressed; done(what): it was held long enough;
  // spoilt(): its meaning has changed under the finger
  constructor(element, meaning, begin, done, spoilt) {
    this.element = element;
    this.meaning = meaning;
    this.begin = begin;
    this.done = done;
    this.spoilt = spoilt;
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

  get inert() { return this.element.disabled || this.element.hidden; }

  press() {
    if (this.since !== null || this.inert) return;
    this.what = this.meaning();
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
    if (this.inert || this.meaning() !== this.what) {
      this.release();
      return this.spoilt();
    }
    const share = (performance.now() - this.since) / HOLD_MS;
    this.element.style.setProperty("--held", Math.min(share, 1));
    if (share < 1) return;
    this.release();
    this.done(this.what);
  }
}

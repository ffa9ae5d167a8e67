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

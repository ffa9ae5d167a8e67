// A button that must be held for a second: what it does is deliberate. It does what stood there when
// the hold began; where that changes meanwhile, the hold is void, and nothing is done.

const HOLD_MS = 1000;

// meaning(): what it asks for now; begin(): it was pressed; done(what): it was held long enough;
// spoilt(): its meaning has changed under the finger
export function holdButton(element, meaning, begin, done, spoilt) {
  let since = null, what, timer;
  const inert = () => element.disabled || element.hidden;

  function press() {
    if (since !== null || inert()) return;
    what = meaning();
    since = performance.now();
    begin();
    timer = setInterval(grow, 40);
  }

  function release() {
    since = null;
    clearInterval(timer);
    element.style.setProperty("--held", 0);
  }

  function grow() {
    if (since === null) return;
    const share = (performance.now() - since) / HOLD_MS, void_ = inert() || meaning() !== what;
    element.style.setProperty("--held", Math.min(share, 1));
    if (share < 1 && !void_) return;
    release();
    if (void_) spoilt();
    else done(what);
  }

  element.addEventListener("pointerdown", (e) => {
    e.preventDefault();
    element.setPointerCapture(e.pointerId);
    press();
  });
  // Let go of: on a busy computer this may be noticed before the last step of growing.
  element.addEventListener("pointerup", () => { grow(); release(); });
  for (const name of ["pointercancel", "lostpointercapture"]) element.addEventListener(name, release);
  element.addEventListener("contextmenu", (e) => e.preventDefault());
  return { press, release, grow };
}

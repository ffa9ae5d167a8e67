// Delay there and back over the last minute, as a line; gaps where it is not known.

const SPAN_MS = 60000, EVERY_MS = 500;

export class Trace {
  constructor(canvas) {
    this.canvas = canvas;
    this.points = [];
    this.last = 0;
  }

  add(ms, now) {
    if (now - this.last < EVERY_MS) return;
    this.last = now;
    this.points.push([now, ms]);
    while (this.points[0][0] < now - SPAN_MS) this.points.shift();
    this.draw(now);
  }

  draw(now) {
    const { canvas } = this, g = canvas.getContext("2d"), ratio = devicePixelRatio || 1;
    const w = (canvas.width = canvas.clientWidth * ratio), h = (canvas.height = canvas.clientHeight * ratio);
    const most = Math.max(20, ...this.points.map(([, ms]) => ms ?? 0));
    g.strokeStyle = getComputedStyle(canvas).color;
    g.lineWidth = 1.5 * ratio;
    g.beginPath();
    let drawn = false;
    for (const [at, ms] of this.points) {
      if (ms === undefined) { drawn = false; continue; }
      const x = w * (1 - (now - at) / SPAN_MS), y = h - (h - 2) * (ms / most);
      if (drawn) g.lineTo(x, y); else g.moveTo(x, y);
      drawn = true;
    }
    g.stroke();
  }
}

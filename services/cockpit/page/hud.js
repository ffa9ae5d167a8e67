// The head-up display around the digits of heading and depth: horizon and tapes with their
// reference. Horizon and heading tape fit the picture: what lies 10° to starboard is there on both.

import { colours, emptied } from "./dom.js";
import { units } from "./units.js";

const RAD = Math.PI / 180;
const LADDER = [-60, -45, -30, -20, -10, 10, 20, 30, 45, 60]; // [deg]
const EDGE = 80; // [deg] what lies further from the axis is not in any picture

// Of a camera that is tilted, and turned to starboard, in a rolled and pitched drone: elevation of
// its axis, and roll of its picture [rad].
export function lookout(roll, pitch, tilt, yaw = 0) {
  const side = Math.sin(roll) * Math.cos(pitch), below = Math.cos(roll) * Math.cos(pitch);
  const nose = -Math.sin(pitch); // where down is, in the drone's axes
  const ahead = nose * Math.cos(yaw) + side * Math.sin(yaw), across = side * Math.cos(yaw) - nose * Math.sin(yaw);
  return {
    elevation: Math.asin(Math.max(-1, Math.min(1, below * Math.sin(tilt) - ahead * Math.cos(tilt)))),
    roll: Math.atan2(across, below * Math.cos(tilt) + ahead * Math.sin(tilt)),
  };
}

export class Hud {
  constructor(canvas) {
    this.canvas = canvas;
    this.g = canvas.getContext("2d");
    this.picture = false; // the camera's is behind: no sky, and an outline around everything
    this.colours();
  }

  colours() { this.c = colours(); }

  // axis: of the camera on the screen; boxes: of the digits of heading and depth, DOMRects
  /** @param {PageView} view */
  draw(view, old, axis, boxes) {
    const { g } = this, [width, height] = emptied(this.canvas);
    if (!width || !height) return;
    this.u = parseFloat(getComputedStyle(document.documentElement).fontSize); // [px] of text
    this.ink = old ? this.c.dim : this.c.ink; // and never paler: it must still be read
    g.lineWidth = this.line = Math.max(2, this.u / 8);
    g.lineJoin = "round";
    g.setLineDash(old ? [this.u / 2, this.u / 3] : []);
    this.horizon(view, width, height, axis, boxes.heading.bottom, boxes.buttons.top);
    g.setLineDash([]);
    if (boxes.heading.width) this.heading(view, width, axis, boxes.heading);
    if (boxes.depth.top > boxes.heading.bottom) this.depth(view, boxes.depth, height, boxes.heading.bottom);
  }

  font(size, weight = 500) { this.g.font = `${weight} ${Math.max(12, size * this.u)}px system-ui, "DejaVu Sans", sans-serif`; }

  // Every text has an outline of the paper's colour, so that it is read on any picture.
  text(words, x, y, colour = this.ink, align = "center") {
    const { g } = this;
    g.textAlign = align;
    g.textBaseline = "middle";
    g.strokeStyle = this.c.paper;
    g.lineWidth = this.u / 3;
    g.strokeText(words, x, y);
    g.lineWidth = this.line;
    g.fillStyle = colour;
    g.fillText(words, x, y);
  }

  path(points, colour, close = false) {
    const { g } = this;
    g.beginPath();
    points.forEach(([x, y], k) => (k ? g.lineTo(x, y) : g.moveTo(x, y)));
    if (close) g.closePath();
    if (this.picture) {
      g.strokeStyle = this.c.paper;
      g.lineWidth = 2.5 * this.line;
      g.stroke();
      g.lineWidth = this.line;
    }
    if (close) { g.fillStyle = colour; g.fill(); }
    else { g.strokeStyle = colour; g.stroke(); }
  }

  /** @param {PageView} view */
  horizon(view, width, height, axis, top, bottom) {
    const { g, u, c } = this;
    if (view.roll_deg === undefined || view.pitch_deg === undefined) return;
    // Without a picture: the drone's own
    const [tilt, yaw] = this.picture ? (view.looks_deg ?? [view.tilt_deg ?? 0, 0]) : [0, 0];
    const { elevation, roll } = lookout(view.roll_deg * RAD, view.pitch_deg * RAD, tilt * RAD, yaw * RAD);
    const up = (degrees) => axis.perRadian * Math.tan(elevation - degrees * RAD); // [px] below the axis
    const seen = (degrees) => Math.abs(elevation / RAD - degrees) < EDGE;
    const far = 2 * (width + height);
    g.save();
    g.translate(axis.x, axis.y);
    g.rotate(-roll);
    const level = seen(0) ? up(0) : Math.sign(elevation) * far;
    if (!this.picture) {
      g.fillStyle = c.above;
      g.fillRect(-far, -far, 2 * far, far + level);
      g.fillStyle = c.below;
      g.fillRect(-far, level, 2 * far, far);
    }
    const reach = Math.min(width * 0.3, 22 * u);
    if (seen(0)) this.path([[-reach, level], [reach, level]], this.ink);
    this.font(0.8);
    for (const degrees of LADDER) {
      const y = up(degrees);
      if (!seen(degrees) || axis.y + y < top + 2 * u || axis.y + y > bottom - u) continue; // heading and buttons are there
      this.path([[-2.2 * u, y], [2.2 * u, y]], this.ink);
      this.text(String(Math.abs(degrees)), 3.4 * u, y);
    }
    g.restore();
    const { x, y } = axis; // where the camera looks
    this.path([[x - 3 * u, y], [x - u, y], [x, y + 0.8 * u], [x + u, y], [x + 3 * u, y]], this.ink);
  }

  /** @param {PageView} view */
  heading(view, width, axis, box) {
    const { g, u, c } = this;
    const y = (box.top + box.bottom) / 2, tall = box.height / 2, half = Math.min(width * 0.36, 26 * u), x = axis.x;
    if (Math.abs((box.left + box.right) / 2 - x) > 2) return; // on a narrow screen the depth is beside it
    g.fillStyle = c.panel;
    g.fillRect(x - half, y - tall, 2 * half, 2 * tall);
    const now = view.heading_deg;
    if (now === undefined) return;
    const at = (degrees) => (Math.abs(degrees) < EDGE ? axis.perRadian * Math.tan(degrees * RAD) : Math.sign(degrees) * half);
    this.font(0.85);
    for (let tick = Math.ceil((now - EDGE) / 5) * 5; tick < now + EDGE; tick += 5) {
      const off = at(tick - now);
      if (Math.abs(off) > half) continue;
      const long = tick % 15 === 0;
      this.path([[x + off, y + tall], [x + off, y + (long ? 0.4 : 0.7) * tall]], this.ink);
      if (long && Math.abs(off) > box.width / 2 + 1.4 * u && half - Math.abs(off) > u)
        this.text(String(((tick % 360) + 360) % 360), x + off, y - 0.25 * tall);
    }
    if (view.heading_wanted_deg !== undefined) {
      const off = ((view.heading_wanted_deg - now + 540) % 360) - 180;
      const to = x + Math.max(-half, Math.min(half, at(off)));
      this.path([[to, y + tall], [to - 0.7 * u, y + tall + 1.1 * u], [to + 0.7 * u, y + tall + 1.1 * u]], c.bug, true);
    }
  }

  /** @param {PageView} view */
  depth(view, box, height, top) {
    const { g, u, c } = this;
    const x = box.left, right = box.right, y = (box.top + box.bottom) / 2;
    const half = Math.min(height * 0.27, 18 * u, y - top - 1.6 * u), span = units.length(5);
    const per = half / span, clear = box.height / 2 + 0.7 * u;
    const now = units.length(view.depth_m), wanted = units.length(view.depth_wanted_m);
    const tape = half > 2.5 * clear; // else there is no room to read one
    this.font(0.85);
    if (wanted !== undefined) this.text(`→ ${units.number(wanted, 2)}`, (x + right) / 2, y - (tape ? half : clear) - 0.8 * u, c.bug);
    if (!tape) return;
    g.fillStyle = c.panel;
    g.fillRect(x, y - half, right - x, 2 * half);
    if (now === undefined) return;
    const step = span > 10 ? 5 : 1; // of what is numbered
    for (let k = Math.max(0, Math.ceil((2 * (now - span)) / step)); (k * step) / 2 <= now + span; k++) {
      const value = (k * step) / 2, at = y + (value - now) * per, whole = k % 2 === 0;
      if (Math.abs(at - y) > half) continue;
      this.path([[x, at], [x + (whole ? 0.8 : 0.4) * u, at]], this.ink);
      if (whole && Math.abs(at - y) > clear && half - Math.abs(at - y) > 0.6 * u) this.text(units.number(value), (x + right) / 2 + 0.4 * u, at);
    }
    if (wanted === undefined) return;
    const at = y + Math.max(-half, Math.min(half, (wanted - now) * per));
    this.path([[x, at], [x - 1.1 * u, at - 0.7 * u], [x - 1.1 * u, at + 0.7 * u]], c.bug, true);
  }
}

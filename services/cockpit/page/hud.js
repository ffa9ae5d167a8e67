// The head-up display: horizon, heading and depth tapes with their reference, thrusters.

const RAD = Math.PI / 180;
const LADDER = [-30, -20, -10, 10, 20, 30]; // [deg]
const PITCH_SPAN = 40; // [deg] over half the height

export class Hud {
  constructor(canvas) {
    this.canvas = canvas;
    this.g = canvas.getContext("2d");
    this.picture = false; // the camera's is behind: no sky, and an outline around everything
    this.colours();
  }

  colours() {
    const style = getComputedStyle(document.documentElement);
    const of = (name) => style.getPropertyValue(`--${name}`).trim();
    this.c = Object.fromEntries(["paper", "panel", "ink", "dim", "line", "above", "below", "bug", "warn", "bad"].map((n) => [n, of(n)]));
  }

  draw(view, old) {
    const { canvas, g } = this;
    const ratio = devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width || !height) return;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const size = parseFloat(getComputedStyle(document.documentElement).fontSize); // [px] of text
    this.u = Math.min(size, Math.max(height / 22, size * 0.7));
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, width, height);
    g.lineWidth = this.line = Math.max(2, this.u / 8);
    g.lineJoin = "round";
    g.globalAlpha = old ? 0.45 : 1;
    this.horizon(view, width, height);
    this.heading(view, width);
    this.depth(view, width, height);
    this.thrusters(view, width, height);
    this.attitude(view, width, height);
    g.globalAlpha = 1;
  }

  // For what matters less; on a picture it must be bright all the same.
  get faint() { return this.picture ? this.c.ink : this.c.dim; }

  font(size, weight = 500) { this.g.font = `${weight} ${size * this.u}px system-ui, "DejaVu Sans", sans-serif`; }

  text(words, x, y, colour = this.c.ink, align = "center") {
    const { g } = this;
    g.textAlign = align;
    g.textBaseline = "middle";
    if (this.picture) {
      g.strokeStyle = this.c.paper;
      g.lineWidth = this.u / 3;
      g.strokeText(words, x, y);
      g.lineWidth = this.line;
    }
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

  horizon(view, width, height) {
    const { g, u, c } = this;
    if (view.roll_deg === undefined || view.pitch_deg === undefined) {
      this.font(1);
      return this.text("attitude not known", width / 2, height / 2, c.warn);
    }
    const perDegree = height / 2 / PITCH_SPAN, far = width + height;
    g.save();
    g.translate(width / 2, height / 2);
    g.rotate(-view.roll_deg * RAD);
    g.translate(0, view.pitch_deg * perDegree);
    if (!this.picture) {
      g.fillStyle = c.above;
      g.fillRect(-far, -far, 2 * far, far);
      g.fillStyle = c.below;
      g.fillRect(-far, 0, 2 * far, far);
    }
    const reach = Math.min(width * 0.3, 22 * u);
    this.path([[-reach, 0], [reach, 0]], c.ink);
    this.font(0.8);
    for (const degrees of LADDER) {
      const y = -degrees * perDegree;
      if (y + view.pitch_deg * perDegree < 4.5 * u - height / 2) continue; // the heading is there
      this.path([[-2.2 * u, y], [2.2 * u, y]], this.faint);
      this.text(String(Math.abs(degrees)), 3.4 * u, y, this.faint);
    }
    g.restore();
    // The vehicle.
    const x = width / 2, y = height / 2;
    this.path([[x - 3 * u, y], [x - u, y], [x, y + 0.8 * u], [x + u, y], [x + 3 * u, y]], c.bug);
  }

  box(words, x, y, colour = this.c.ink) {
    const { g, u, c } = this;
    this.font(1.35, 700);
    const w = g.measureText(words).width + u, h = 2 * u;
    g.fillStyle = c.paper;
    g.fillRect(x - w / 2, y - h / 2, w, h);
    g.strokeStyle = c.ink;
    g.strokeRect(x - w / 2, y - h / 2, w, h);
    this.text(words, x, y, colour);
  }

  heading(view, width) {
    const { g, u, c } = this;
    const y = 1.35 * u, half = Math.min(width * 0.36, 26 * u), x = width / 2, perDegree = half / 45;
    g.fillStyle = c.panel;
    g.fillRect(x - half, y - 1.1 * u, 2 * half, 2.2 * u);
    const now = view.heading_deg;
    if (now !== undefined) {
      this.font(0.85);
      for (let tick = Math.ceil((now - 45) / 5) * 5; tick <= now + 45; tick += 5) {
        const at = x + (tick - now) * perDegree;
        const long = tick % 15 === 0;
        this.path([[at, y + 1.1 * u], [at, y + (long ? 0.5 : 0.8) * u]], c.ink);
        if (long && Math.abs(at - x) > 2.8 * u && half - Math.abs(at - x) > u)
          this.text(String(((tick % 360) + 360) % 360), at, y - 0.2 * u, c.dim);
      }
      if (view.heading_wanted_deg !== undefined) {
        const off = ((view.heading_wanted_deg - now + 540) % 360) - 180;
        const at = x + Math.max(-half, Math.min(half, off * perDegree));
        this.path([[at, y + 1.1 * u], [at - 0.7 * u, y + 2.2 * u], [at + 0.7 * u, y + 2.2 * u]], c.bug, true);
      }
    }
    this.box(now === undefined ? "–" : `${now.toFixed(0).padStart(3, "0")}°`, x, y, now === undefined ? c.warn : c.ink);
  }

  depth(view, width, height) {
    const { g, u, c } = this;
    const x = width - 3.3 * u, y = height * 0.46, half = Math.min(height * 0.3, 18 * u), span = 5; // [m]
    const perMetre = half / span;
    g.fillStyle = c.panel;
    g.fillRect(x - 1.8 * u, y - half, 4.4 * u, 2 * half);
    const now = view.depth_m;
    if (now !== undefined) {
      this.font(0.85);
      for (let half_m = Math.ceil((now - span) * 2); half_m <= (now + span) * 2; half_m++) {
        const m = half_m / 2, at = y + (m - now) * perMetre, whole = half_m % 2 === 0;
        if (m < 0) continue;
        this.path([[x - 1.8 * u, at], [x - (whole ? 1 : 1.4) * u, at]], c.ink);
        if (whole && Math.abs(at - y) > 1.5 * u && half - Math.abs(at - y) > 0.6 * u) this.text(String(m), x + 0.6 * u, at, c.dim);
      }
      if (view.depth_wanted_m !== undefined) {
        const at = y + Math.max(-half, Math.min(half, (view.depth_wanted_m - now) * perMetre));
        this.path([[x - 1.8 * u, at], [x - 2.9 * u, at - 0.7 * u], [x - 2.9 * u, at + 0.7 * u]], c.bug, true);
      }
    }
    this.box(now === undefined ? "–" : now.toFixed(2), x, y, now === undefined ? c.warn : c.ink);
    this.font(0.85);
    this.text("depth m", x + 0.4 * u, y - half - 0.8 * u, this.faint);
    if (view.depth_wanted_m !== undefined) this.text(`→ ${view.depth_wanted_m.toFixed(2)}`, x + 0.4 * u, y + half + 0.8 * u, c.bug);
  }

  // Beside the heading there is room for the attitude; else it is below.
  besideHeading(width) { return width > 64 * this.u; }

  thrusters(view, width, height) {
    const { g, u, c } = this;
    const shares = view.thrust ?? [], w = 0.75 * u, gap = 0.3 * u, half = Math.min(5 * u, height * 0.2);
    const x0 = 1.2 * u, middle = height / 2 + u;
    const y = this.besideHeading(width) ? Math.max(middle, 7.5 * u + half) : Math.min(middle, height - 6 * u - half);
    this.font(0.85);
    this.text("thrust", x0, y - half - 0.9 * u, this.faint, "left");
    if (!shares.length) this.text("–", x0, y, c.warn, "left");
    shares.forEach((share, k) => {
      const x = x0 + k * (w + gap), full = Math.abs(share) >= 0.99;
      g.fillStyle = c.panel;
      g.fillRect(x, y - half, w, 2 * half);
      g.fillStyle = full ? c.bad : c.ink;
      g.fillRect(x, y, w, -share * half);
      this.path([[x, y], [x + w, y]], c.line);
    });
  }

  attitude(view, width, height) {
    const { u, c } = this;
    this.font(0.9);
    const of = (value) => (value === undefined ? "–" : `${value > 0 ? "+" : ""}${value.toFixed(0)}°`);
    const lines = [["roll", of(view.roll_deg)], ["pitch", of(view.pitch_deg)], ["camera", of(view.tilt_deg)]];
    if (view.heading_wanted_deg !== undefined && height > 28 * u) lines.push(["to", `${view.heading_wanted_deg.toFixed(0)}°`]);
    const top = this.besideHeading(width);
    lines.forEach(([name, value], k) => {
      const at = top ? (2.2 + 1.3 * k) * u : height - (1.2 + 1.25 * (lines.length - k)) * u;
      this.text(`${name} ${value}`, 1.2 * u, at, name === "to" ? c.bug : this.faint, "left");
    });
  }
}

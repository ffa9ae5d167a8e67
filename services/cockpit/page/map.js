// The map: where the drone is and how surely, where it has been, its home, where it goes. A tap names
// a place; a held button sends the drone there. North and east are those of the drone's state.

import { $, colours, emptied, write } from "./dom.js";
import { holdButton } from "./hold_button.js";
import { units } from "./units.js";
import { words } from "./words.js";

const RAD = Math.PI / 180;
const TAP_PX = 10, SHOWN_M = 30; // [m] from side to side, at first
const CLOSEST = 400, FURTHEST = 0.02; // [px/m]
const BEGINS = 2, RECKONED = 1; // how a point of the track follows the one before

export const way = ([n, e], [to, aside]) => {
  const north = to - n, east = aside - e;
  return { m: Math.hypot(north, east), deg: (Math.atan2(east, north) / RAD + 360) % 360 };
};

export class SeaMap {
  // may(): this page flies the drone; wish(what, fields); say(key): why not
  constructor(connection, settings, may, wish, say) {
    this.connection = connection;
    this.settings = settings;
    this.may = may;
    this.wish = wish;
    this.say = say;
    this.canvas = $("map").querySelector("canvas");
    this.g = this.canvas.getContext("2d");
    this.scale = 0; // [px/m]
    this.centre = null; // [m] north, east; null: the drone
    this.wanted = null; // a place that was tapped
    /** @type {[number, number] | null} */
    this.tapped = null; // [px] by a finger that may yet be a drag
    this.fingers = new Map(); // by pointer
    const listen = (name, act) => this.canvas.addEventListener(name, (e) => { e.preventDefault(); act(e); this.draw(); });
    listen("pointerdown", (e) => this.touch(e));
    listen("pointermove", (e) => this.move(e));
    for (const name of ["pointerup", "pointercancel"]) listen(name, (e) => this.lift(e));
    listen("wheel", (e) => this.zoom(Math.exp(-e.deltaY / 300), [e.offsetX, e.offsetY]));
    const click = (id, act) => $(id).addEventListener("click", () => { act(); this.draw(); });
    click("map-open", () => settings.next("map"));
    click("map-shut", () => settings.next("map"));
    click("map-up", () => settings.next("up"));
    click("map-centre", () => (this.centre = this.wanted = null));
    click("map-home", () => this.choose(this.view.home));
    holdButton($("map-go"), () => String(this.wanted), () => {}, () => this.go(), () => say("void"));
  }

  /** @returns {PageView} */
  get view() { return this.connection.picture?.view ?? {}; }

  /** @returns {[number, number] | undefined} */
  get here() {
    const { place } = this.view;
    return place ? [place[0], place[1]] : undefined;
  }

  // What the drone needs for going to a place.
  get measured() { return Boolean(this.view.place?.[3]); }

  choose(place) {
    this.wanted = null;
    if (!this.measured) return this.say("map.unknown");
    this.wanted = place;
  }

  go() {
    const [north, east] = this.wanted;
    this.wish("goto", { north, east });
    this.wanted = null;
  }

  // Fingers and mouse.

  touch(e) {
    this.canvas.setPointerCapture(e.pointerId);
    this.fingers.set(e.pointerId, [e.offsetX, e.offsetY]);
    if (this.fingers.size === 1) this.tapped = [e.offsetX, e.offsetY];
    else this.tapped = null;
  }

  move(e) {
    const before = this.fingers.get(e.pointerId);
    /** @type {[number, number]} */
    const now = [e.offsetX, e.offsetY];
    if (!before) return;
    if (this.tapped && Math.hypot(now[0] - this.tapped[0], now[1] - this.tapped[1]) < TAP_PX) return;
    this.tapped = null;
    const other = [...this.fingers].find(([id]) => id !== e.pointerId)?.[1];
    if (other) {
      const apart = (a) => Math.hypot(a[0] - other[0], a[1] - other[1]);
      this.zoom(apart(now) / Math.max(1, apart(before)), other);
    } else {
      const from = this.at(before), to = this.at(now), [n, e0] = this.middle;
      this.centre = [n + from[0] - to[0], e0 + from[1] - to[1]];
    }
    this.fingers.set(e.pointerId, now);
  }

  lift(e) {
    this.fingers.delete(e.pointerId);
    if (this.tapped && e.type === "pointerup") this.choose(this.at(this.tapped));
    this.tapped = null;
  }

  // What is under `fixed` [px] stays there.
  zoom(by, fixed) {
    const before = fixed && this.at(fixed);
    this.scale = Math.max(FURTHEST, Math.min(CLOSEST, this.scale * by));
    if (!before || (!this.centre && this.here)) return; // the drone stays in the middle
    const after = this.at(fixed), [n, e] = this.middle;
    this.centre = [n + before[0] - after[0], e + before[1] - after[1]];
  }

  // Metres and pixels.

  get middle() { return this.centre ?? this.here ?? [0, 0]; }

  // [deg] From north: by the compass where there is one, as the drone's place is.
  get heading() { return this.view.compass_deg ?? this.view.heading_deg; }

  get turn() { return this.settings.up === "heading" ? (this.heading ?? 0) * RAD : 0; }

  /** @returns {[number, number]} */
  px([n, e]) {
    const [cn, ce] = this.middle, c = Math.cos(this.turn), s = Math.sin(this.turn);
    const up = c * (n - cn) + s * (e - ce), right = c * (e - ce) - s * (n - cn);
    return [this.canvas.clientWidth / 2 + right * this.scale, this.canvas.clientHeight / 2 - up * this.scale];
  }

  /** @returns {[number, number]} */
  at([x, y]) {
    const right = (x - this.canvas.clientWidth / 2) / this.scale, up = (this.canvas.clientHeight / 2 - y) / this.scale;
    const [cn, ce] = this.middle, c = Math.cos(this.turn), s = Math.sin(this.turn);
    return [cn + c * up - s * right, ce + s * up + c * right];
  }

  // Drawing.

  draw() {
    const open = this.settings.map === "open";
    $("map").hidden = !open;
    document.body.classList.toggle("mapped", open);
    if (!open || !this.canvas.clientWidth) return;
    const { canvas, g } = this, [w, h] = emptied(canvas);
    this.scale ||= Math.min(w, h) / SHOWN_M;
    this.tell();
    const style = getComputedStyle(canvas), c = colours();
    this.u = parseFloat(style.fontSize);
    [g.lineJoin, g.font, g.textAlign, g.textBaseline] = ["round", `${0.9 * this.u}px ${style.fontFamily}`, "center", "middle"];
    this.track(c);
    this.marks(c);
    this.compass(c, w, h);
    this.bar(c, $("map-home").parentElement.offsetTop);
  }

  // In words: where home is, where it goes, and why it cannot.
  tell() {
    const { view } = this, { here, wanted } = this, goal = wanted ?? view.goal;
    const said = ({ m, deg }) => ({ m: units.depth(m, m < 9.95 ? 1 : 0), deg: units.number(Math.round(deg) % 360) });
    const spread = here && `± ${units.depth(view.place[2], 1)}`;
    const rows = [
      !here ? words.t("map.unknown") : this.measured ? spread : words.t("map.reckoned", { m: spread }),
      here && view.home ? words.t("map.home_is", said(way(here, view.home))) : "",
      here && goal ? words.t(wanted ? "map.go_to" : "map.goes", said(way(here, goal))) : "",
    ];
    write($("map-said"), rows.filter(Boolean).join(" · "));
    $("map-said").className = this.measured ? "" : "warning";
    // Where it is not offered its place stays empty: nothing else comes to lie under the finger.
    $("map-go").classList.toggle("away", !wanted);
    $("map-go").disabled = !wanted || !this.may() || !this.measured;
    $("map-home").disabled = !view.home;
    $("map-centre").disabled = !this.centre && !wanted;
  }

  line(points, colour, dash = []) {
    const { g } = this;
    g.setLineDash(dash);
    [g.strokeStyle, g.lineWidth] = [colour, 2];
    g.beginPath();
    points.forEach(([x, y], k) => (k ? g.lineTo(x, y) : g.moveTo(x, y)));
    g.stroke();
    g.setLineDash([]);
  }

  track(c) {
    const flat = this.connection.track ?? [];
    let piece = [], reckoned = false;
    const end = () => { if (piece.length > 1) this.line(piece, c.dim, reckoned ? [4, 4] : []); };
    for (let k = 0; k + 2 < flat.length; k += 3) {
      const how = flat[k + 2], at = this.px([flat[k] / 10, flat[k + 1] / 10]);
      if (how === BEGINS) { end(); [piece, reckoned] = [[at], false]; continue; }
      if ((how === RECKONED) !== reckoned) { end(); [piece, reckoned] = [piece.slice(-1), how === RECKONED]; }
      piece.push(at);
    }
    if (piece.length && this.here) piece.push(this.px(this.here));
    end();
  }

  shape(points, [x, y], turn, fill, edge) {
    const { g, u } = this;
    g.save();
    g.translate(x, y);
    g.rotate(turn);
    g.beginPath();
    points.forEach(([a, b]) => g.lineTo(a * u, b * u));
    g.closePath();
    [g.fillStyle, g.strokeStyle, g.lineWidth] = [fill, edge, 2];
    g.stroke();
    g.fill();
    g.restore();
  }

  marks(c) {
    const { g, u, view, here } = this;
    if (view.home) this.shape([[-0.6, 0.6], [-0.6, -0.1], [0, -0.7], [0.6, -0.1], [0.6, 0.6]], this.px(view.home), 0, c.ink, c.paper);
    const ahead = (view.waypoints ?? []).map((each) => this.px(each));
    if (here && ahead.length) this.line([this.px(here), ...ahead], c.bug);
    for (const [x, y] of ahead) this.shape([[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]], [x, y], 0, c.bug, c.paper);
    const goal = this.wanted ?? view.goal;
    if (goal) {
      const [x, y] = this.px(goal);
      if (here) this.line([this.px(here), [x, y]], c.bug, this.wanted ? [3, 5] : []);
      for (const k of [-1, 1]) this.line([[x - 0.7 * u, y - 0.7 * u * k], [x + 0.7 * u, y + 0.7 * u * k]], c.bug);
    }
    if (!here) return;
    const at = this.px(here), colour = this.measured ? c.ink : c.warn;
    g.beginPath(); // two standard deviations
    g.arc(...at, Math.max(2, 2 * view.place[2] * this.scale), 0, 7);
    g.setLineDash(this.measured ? [] : [4, 4]);
    [g.strokeStyle, g.lineWidth] = [colour, 1.5];
    g.stroke();
    g.setLineDash([]);
    if (this.heading !== undefined) this.shape([[0, -1.1], [0.7, 0.9], [0, 0.5], [-0.7, 0.9]], at, this.heading * RAD - this.turn, colour, c.paper);
  }

  // North, and where the water goes.
  compass(c, w, h) {
    const { g, u, view } = this, beside = w > 2 * h; // the button, or below it
    const [x, y] = [beside ? w - 64 - u : w - 1.6 * u, beside ? 1.7 * u : 56 + 1.7 * u];
    const arrow = [[0, -1], [0.35, -0.2], [0.1, -0.2], [0.1, 1], [-0.1, 1], [-0.1, -0.2], [-0.35, -0.2]];
    this.shape(arrow, [x, y], -this.turn, c.ink, c.paper);
    g.fillStyle = c.ink;
    g.fillText("N", x - 1.2 * u, y);
    if (!view.current) return;
    const [n, e] = view.current, speed = Math.hypot(n, e);
    if (speed > 0.01) this.shape(arrow, [x - 5 * u, y], Math.atan2(e, n) - this.turn, c.bug, c.paper);
    g.fillText(units.speed(speed), x - 5 * u, y + 1.7 * u);
  }

  bar(c, bottom) {
    const { g, u } = this, one = units.metres(1) * this.scale; // [px]
    const most = 6 * u / one, ten = 10 ** Math.floor(Math.log10(most));
    const length = [5, 2, 1].map((k) => k * ten).find((each) => each <= most), y = bottom - 0.3 * u;
    this.line([[u, y - 0.4 * u], [u, y], [u + length * one, y], [u + length * one, y - 0.4 * u]], c.ink);
    [g.textAlign, g.fillStyle] = ["left", c.ink];
    g.fillText(`${units.number(length, Math.max(0, -Math.floor(Math.log10(length))))} ${units.lengthUnit}`, 1.3 * u, y - 0.8 * u);
  }
}

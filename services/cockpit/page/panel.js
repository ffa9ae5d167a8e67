// The drone in figures and words, and what its buttons offer.

import { $, fill, make, put, write } from "./dom.js";
import { acts } from "./messages.js";
import { UNKNOWN, units } from "./units.js";
import { words } from "./words.js";

const plain = (name) => (name ? words.t(name).replaceAll("_", " ") : UNKNOWN);
const degrees = (value) => `${value > 0 ? "+" : ""}${units.number(value)}°`;

// [ms] Age of depth and attitude on this screen; undefined: not known.
/** @param {Personal} you @param {PageView} view */
function age(you, view, arrived) {
  if (view.age_ms === undefined) return undefined;
  return view.age_ms + (you.delay_ms ?? 0) / 2 + performance.now() - arrived;
}

// Whether depth and attitude are old.
/** @param {import("./connection.js").Connection} connection @param {Personal} you @param {PageView} view */
export function stale(connection, you, view) {
  const old = age(you, view, connection.arrived);
  return old === undefined || old > connection.ages.state[0] || Boolean(connection.words);
}

/** @param {PageView} view */
function battery(view) {
  if (view.battery_v === undefined) return UNKNOWN;
  const volts = `${units.number(view.battery_v, 1)} V`;
  if (view.charge !== undefined) return `${volts}, ${units.share(view.charge)}`;
  return view.used_wh === undefined ? volts : `${volts}, ${units.number(view.used_wh, 1)} Wh`;
}

// Figures that are fine are in the drawer; here they stand while they are not.
/** @param {import("./connection.js").Connection} connection @param {Personal} you @param {PageView} view */
export function status(connection, you, view, steeredBy, video) {
  const last = view.silent_s === undefined ? "" : `${words.t("last_known")} `;
  put("armed", view.activity ? words.t(view.armed ? "ARMED" : "DISARMED") : UNKNOWN, view.armed && !last ? "on" : "");
  write($("drone"), view.drone ?? "");
  document.title = view.drone ? `${view.drone} · Lindy cockpit` : "Lindy cockpit";
  write($("activity"), `${plain(view.doing)} · ${plain(view.flight_mode)}`);
  const who = words.t(you.who ?? "");
  $("who").className = you.has_sticks && you.in_control ? "mine" : "";
  write($("who"), last + (you.watcher ? `${words.t("watching")} · ${who}` : who + (you.has_sticks ? ` · ${words.t(steeredBy)}` : "")));
  // Of the outputs those that are not at rest: lasers that are on must be seen.
  const on = Object.entries(view.outputs ?? {}).filter(([name, value]) => value && name !== "light");
  const lit = view.light ? [["light", units.share(view.light)]] : [];
  const numbers = [["battery", battery(view)], ...lit, ...on.map(([name, value]) => [name.replaceAll("_", " "), units.share(value)])];
  write($("numbers"), numbers.map(([label, text]) => `${words.t(label)} ${text}`).join(" · "));
  const old = age(you, view, connection.arrived);
  put("age", `${words.t("state")} ${units.age(old)}`, old > connection.ages.state[0] ? "old" : "");
  put("link", `${words.t("link")} ${units.ms(view.rtt_ms)}`);
  if (view.link_up === false) put("link", words.t("link_down"), "old");
  picture(video);
}

// The age of the picture, and what is wrong with it.
function picture({ age, least, words: wrong, silence, name, kbit }) {
  const known = age !== undefined && silence < Infinity;
  const what = name ? `${words.camera(name)} ${units.number(kbit)} kbit/s` : words.t("picture"); // where there are several
  put("picture-age", `${what} ${known ? least + units.age(age) : UNKNOWN}`, known && wrong ? "old" : "");
  put("no-picture", wrong, wrong && known ? "old" : "");
}

/** @param {PageView} view */
export function digits(view, stale) {
  const kind = stale ? "digits old" : "digits";
  put("heading", view.heading_deg === undefined ? UNKNOWN : units.bearing(view.heading_deg, 3), kind);
  put("depth", units.depth(view.depth_m) ?? UNKNOWN, kind);
}

const list = (id, all) => {
  const known = all.filter(([, value]) => value !== undefined);
  $(id).hidden = !known.length;
  fill(id, known, ([key, value]) => [make("dt", words.t(key)), make("dd", value)]);
};

// Figures that help to fly, and those that a pilot looks at now and then: those that are known.
/** @param {Personal} you @param {PageView} view */
export function figures(you, view, limit) {
  const climb = view.depth_rate === undefined ? undefined : -view.depth_rate;
  const wanted = view.altitude_wanted_m === undefined ? "" : ` → ${units.number(units.length(view.altitude_wanted_m), 1)}`;
  const whole = (value, form) => (value === undefined ? undefined : form(value));
  list("aids", [
    ["dive", whole(view.dive_s, (s) => units.time(s))],
    ["climb", whole(climb, (v) => `${v > 0.005 ? "↑" : v < -0.005 ? "↓" : ""} ${units.speed(Math.abs(v))}`)],
    ["altitude", whole(view.altitude_m, (m) => `${units.number(units.length(m), 1)}${wanted} ${units.lengthUnit}`)],
    ["left", whole(view.left_min, (min) => `${units.number(min)} min`)],
    ["speed", limit < 100 ? `${units.number(limit)} %` : undefined],
    ["turns", view.turns || undefined],
  ]);
  if ($("drawer").hidden) return;
  list("figures", [
    ["link", units.ms(view.rtt_ms)],
    ["loss", whole(view.lost_s, (s) => units.age(1000 * s))],
    ["stick", whole(view.stick_ms, (ms) => units.ms(ms))],
    ["page", whole(you.delay_ms, (ms) => units.ms(ms))],
    ["picture", $("picture-age").textContent.replace(words.t("picture"), "")],
    ["compass", whole(view.compass_deg, (deg) => units.bearing(deg))],
    ["pitch", whole(view.pitch_deg, degrees)],
    ["roll", whole(view.roll_deg, degrees)],
    ["camera", whole(view.tilt_deg, (deg) => degrees((view.looks_deg ?? [deg])[0]))],
    ["inside", whole(view.inside_c, (c) => units.temperature(c))],
    ["water", whole(view.water_c, (c) => units.temperature(c))],
  ]);
}

// One line for what matters most, and beside it what the page answers; the rest in the drawer.
export function tell(all, own, log) {
  const first = all[0]?.tone === "past" ? undefined : all[0], shown = first?.loud || !own ? first : undefined;
  put("now", first?.text ?? "", first?.tone);
  $("now").hidden = !shown;
  put("own", own, "warning");
  $("own").hidden = !own;
  const rest = all.filter((each) => each !== shown && each.tone !== "plain"), others = rest.filter(({ tone }) => tone !== "past");
  put("drawer-open", others.length ? String(others.length) : "⋯", others.length ? "warning" : "");
  $("drawer-open").setAttribute("aria-label", `${words.t("drawer")} ${others.length || ""}`);
  if ($("drawer").hidden) return;
  fill("standing", rest, ({ text, tone }) => make("li", text, tone));
  const line = ([, at, times, text, event]) =>
    make("li", `${at === null ? "–" : units.time(at)}  ${times > 1 ? `${times} × ` : ""}${words.said(text, event)}`);
  fill("log", log.filter((each) => each[5]).reverse(), line);
  fill("system", log.filter((each) => !each[5]).reverse(), line);
}

// Where it is not offered its place stays empty: nothing else comes to lie under the finger.
function deliberate(id, text, offered, taken) {
  put(id, text, offered ? "hold" : "hold away");
  $(id).disabled = Boolean(taken) || !offered;
}

// Returns what the button that arms asks for now.
/** @param {Personal} you @param {PageView} view */
export function buttons(you, view, watching) {
  const mine = Boolean(you.has_sticks && you.in_control), acting = view.armed && acts(view);
  const resumes = acting && view.returns !== "centre"; // then centred sticks are enough
  // Arming and disarming have places of their own: what is under a finger never becomes the other.
  deliberate("arm", words.t(acting ? "hold_resume" : "hold_arm"), view.activity && (resumes || !view.armed), you.taken);
  deliberate("disarm", words.t("hold_disarm"), view.armed, you.taken);
  $("take").hidden = mine;
  $("take").disabled = Boolean(you.taken || !view.activity);
  $("force").hidden = !(view.pilot && !you.in_control && !you.taken);
  for (const id of ["offer", "give_back"]) $(id).hidden = !mine;
  for (const id of ["flight_mode", "lamp", "go", "home", "unwind"]) $(id).disabled = !mine;
  for (const id of ["film", "snapshot"]) $(id).disabled = watching;
  const mode = $("flight_mode");
  if (view.flight_mode && document.activeElement !== mode && mode.value !== view.flight_mode) mode.value = view.flight_mode;
  // A film runs once the recorder says so.
  const clock = view.filming_s === undefined ? "" : units.time(view.filming_s);
  write($("film"), clock ? `● ${clock}` : words.t("film"));
  $("film").setAttribute("aria-label", clock ? `${words.t("filming")} ${clock}` : words.t("film"));
  $("film").setAttribute("aria-pressed", String(Boolean(clock)));
  write($("snapshot"), view.snapshots ? `${words.t("snapshot")} ✓${view.snapshots}` : words.t("snapshot"));
  return acting ? "resume" : "arm";
}

// Everything in words: what the drone does, who has the sticks, what is wrong.

import { LEAK } from "./alarms.js";
import { UNKNOWN, units } from "./units.js";
import { words } from "./words.js";

const $ = (id) => document.getElementById(id);

export function put(id, text, kind = "") {
  const element = $(id);
  if (element.textContent !== text) element.textContent = text;
  if (element.className !== kind) element.className = kind;
}

export function alarm(id, text, kind = "") {
  put(id, text ?? "", kind);
  $(id).hidden = !text;
}

const plain = (name) => (name ? words.t(name).replaceAll("_", " ") : UNKNOWN);
const ms = (value) => (value === undefined ? UNKNOWN : `${units.number(value, value < 9.95 ? 1 : 0)} ms`);
export const seconds = (value) => (value < 0.995 ? `${units.number(1000 * value)} ms` : `${units.number(value, 1)} s`);

// The first camera has a name of ours, the others those of the vehicle file.
export const cameraName = (name) => (name === "front" ? words.t("front") : name.replaceAll("_", " "));

// [ms] Age of depth and attitude on this screen; undefined: not known.
export function age(you, view, arrived) {
  if (view.age_ms === undefined) return undefined;
  return view.age_ms + (you.delay_ms ?? 0) / 2 + performance.now() - arrived;
}

// Whether depth and attitude are old.
export function stale(connection, you, view) {
  const old = age(you, view, connection.arrived);
  return old === undefined || old > connection.ages.state[0] || Boolean(connection.words);
}

// Returns name and sentence of the alarms that stand.
export function show(connection, you, view, steeredBy) {
  const silent = view.silent_s === undefined ? "" : `${words.t("last_known")} `;
  put("armed", view.activity ? `${silent}${words.t(view.armed ? "ARMED" : "DISARMED")}` : UNKNOWN, view.armed && !silent ? "on" : "");
  put("drone", view.drone ?? "");
  document.title = view.drone ? `${view.drone} · Lindy cockpit` : "Lindy cockpit";
  put("activity", `${plain(view.doing)} · ${plain(view.flight_mode)}`);
  const who = words.t(you.who ?? "");
  put("who", silent + (you.watcher ? `${words.t("watching")} · ${who}` : who + (you.has_sticks ? ` · ${words.t(steeredBy)}` : "")));
  put("numbers", (view.numbers ?? []).map(([label, text]) => `${words.t(label)} ${units.said(text)}`).join(" · ") || UNKNOWN);
  const loss = view.lost_s ? ` ${words.t("loss")} ${seconds(view.lost_s)}` : "";
  put("link", view.link_up === false ? words.t("link_down") : `${words.t("link")} ${ms(view.rtt_ms)}${loss}`, view.link_up === false ? "old" : "");
  const old = age(you, view, connection.arrived);
  const grey = old > connection.ages.state[0];
  put("age", `${words.t("state")} ${old === undefined ? UNKNOWN : seconds(old / 1000)}`, grey ? "old" : "");
  const why = words.same(you.lost ?? ""); // of a lost pilot the drone knows less than the page's service
  const tells = why && view.failsafe === "pilot_lost" && !view.resumable;
  const apart = `${words.t(connection.words)}${connection.watching ? "" : `: ${words.t("pilot_lost")}`}`;
  const cut = silent && view.armed ? words.t("silent.armed", { s: units.number(view.silent_s) }) : "";
  const own = connection.words ? apart : cut || (tells || !view.armed ? "" : why);
  const lost = [words.t(connection.stopSaid()), own].filter(Boolean).join(" · ");
  alarm("lost", lost);
  const mine = you.watcher || (you.has_sticks && you.in_control);
  const acting = failsafe(view.acting ?? [], tells ? why : "", mine || !(view.resumable || view.returns === "centre"));
  const said = [...(you.wants_rest ? [[words.t("wants_rest"), "warning"]] : []), ...(view.said ?? [])];
  const of = (tone) => said.filter((each) => each[1] === tone).map((each) => words.same(each[0])).join(" · ");
  alarm("note", of("warning"));
  lines(view.lines ?? []);
  const cause = connection.words || (cut ? "silent" : why);
  return [
    [`lost ${connection.stopSaid() ?? ""} ${cause}`, lost],
    [view.failsafe, acting],
    ...grave(said),
  ].filter(([, sentence]) => sentence);
}

export function digits(view, stale) {
  const kind = stale ? "digits old" : "digits";
  put("heading", view.heading_deg === undefined ? UNKNOWN : `${units.number(Math.round(view.heading_deg) % 360).padStart(3, "0")}°`, kind);
  const depth = units.length(view.depth_m);
  put("depth", depth === undefined ? UNKNOWN : `${units.number(depth, 2)} ${units.lengthUnit}`, kind);
}

// What the drone does by itself, in four short lines. Returns what is lost, for who does not look.
function failsafe(acting, known, mine) {
  $("failsafe").hidden = !acting.length;
  document.body.classList.toggle("acting", acting.length > 0);
  if (!acting.length) return "";
  const [[lost], [why, since], [does, more], [must]] = acting;
  const because = (known || words.t(why)).split(/[:：] ?/).at(-1);
  const sentences = [
    words.t(lost),
    since.s ? words.t("for", { what: because, s: units.number(since.s) }) : because,
    more.s ? words.t("then", { what: words.t(does), s: units.number(more.s) }) : words.t(does),
    words.t(mine ? must : "do.take"),
  ].map((each) => each && `${each[0].toUpperCase()}${each.slice(1)}.`);
  const rows = $("failsafe").children;
  if (rows.length !== 4) $("failsafe").replaceChildren(...sentences.map(() => document.createElement("p")));
  sentences.forEach((each, k) => rows[k].textContent !== each && (rows[k].textContent = each));
  return `${sentences[0]} ${sentences[3]}`;
}

// What is grave though nothing acts: a bad link, or water inside while the pilot flies on.
function grave(said) {
  const all = said.filter((each) => each[1] === "alarm").map((each) => each[0]);
  const text = all.map((each) => words.same(each)).join(" · "), note = $("note").textContent;
  if (text) alarm("note", note ? `${text} · ${note}` : text, "grave");
  return all.map((each) => [each.startsWith("LINK ") ? "link" : LEAK, words.same(each)]);
}

// The age of the picture, and what is wrong with it.
export function showPicture(video) {
  const { age, least, words: wrong, silence, name } = video;
  const known = age !== undefined && silence < Infinity;
  const what = name ? `${cameraName(name)} ${units.number(video.kbit)} kbit/s` : words.t("picture"); // where there are several
  put("picture-age", `${what} ${known ? least + seconds(age / 1000) : UNKNOWN}`, known && wrong ? "old" : "");
  put("no-picture", wrong, wrong && known ? "old" : "");
}

const rows = new Map(); // what a list shows, by its id

function fill(id, all, made) {
  const now = words.language + JSON.stringify(all);
  if (now === rows.get(id)) return;
  rows.set(id, now);
  $(id).replaceChildren(...all.flatMap(made));
}

const element = (tag, textContent, className) => Object.assign(document.createElement(tag), { textContent, className });

export function lines(all, id = "lines") {
  fill(id, all, ([level, at, times, text, event]) =>
    element("li", `${at === null ? "–" : units.time(at)}  ${times > 1 ? `${times} × ` : ""}${words.said(text, event)}`, level));
}

// Where it is not offered its place stays empty: nothing else comes to lie under the finger.
function deliberate(id, text, offered, taken) {
  put(id, text, offered ? "hold" : "hold away");
  $(id).disabled = Boolean(taken) || !offered;
}

export function buttons(you, view) {
  const may = Boolean(you.has_sticks), mine = Boolean(may && you.in_control);
  const acts = Boolean(view.armed && view.failsafe && view.failsafe !== "none");
  const resumes = acts && view.returns !== "centre"; // then centred sticks are enough
  // Arming and disarming have places of their own: what is under a finger never becomes the other.
  deliberate("arm", words.t(acts ? "hold_resume" : "hold_arm"), view.activity && (resumes || !view.armed), you.taken);
  deliberate("disarm", words.t("hold_disarm"), view.armed, you.taken);
  $("take").hidden = mine;
  $("take").disabled = Boolean(you.taken || !view.activity);
  $("force").hidden = !(view.pilot && !you.in_control && !you.taken);
  for (const id of ["offer", "give_back"]) $(id).hidden = !mine;
  for (const id of ["flight_mode", "lamp", "go", "home", "unwind", "darker", "brighter"]) $(id).disabled = !mine;
  const mode = $("flight_mode");
  if (view.flight_mode && document.activeElement !== mode && mode.value !== view.flight_mode) mode.value = view.flight_mode;
  put("brightness", view.light === undefined ? UNKNOWN : `${units.number(100 * view.light)} %`);
  return acts ? "resume" : "arm";
}

function height(now, wanted) {
  const text = (m, k) => units.number(units.length(m), k);
  return `${text(now, 1)}${wanted === undefined ? "" : ` → ${text(wanted, 1)}`} ${units.lengthUnit}`;
}

// Figures that help to fly: those that are known.
export function aids(view, limit, delay) {
  const degrees = (value) => (value === undefined ? undefined : `${value > 0 ? "+" : ""}${units.number(value)}°`);
  const climb = view.depth_rate === undefined ? undefined : -view.depth_rate;
  const all = [
    ["dive", view.dive_s === undefined ? undefined : units.time(view.dive_s)],
    ["climb", climb === undefined ? undefined : `${climb > 0.005 ? "↑" : climb < -0.005 ? "↓" : ""} ${units.speed(Math.abs(climb))}`],
    ["altitude", view.altitude_m === undefined ? undefined : height(view.altitude_m, view.altitude_wanted_m)],
    ["left", view.left_min === undefined ? undefined : `${units.number(view.left_min)} min`],
    ["stick", view.stick_ms === undefined ? undefined : ms(view.stick_ms)],
    ["inside", view.inside_c === undefined ? undefined : units.temperature(view.inside_c)],
    ["water", view.water_c === undefined ? undefined : units.temperature(view.water_c)],
    ["speed", limit < 100 ? `${units.number(limit)} %` : undefined],
    ["turns", view.turns || undefined],
    ["page", delay === undefined ? undefined : ms(delay), "wide"],
    ["compass", view.compass_deg === undefined ? undefined : `${units.number(Math.round(view.compass_deg) % 360)}°`, "wide"],
    ["pitch", degrees(view.pitch_deg), "wide"],
    ["roll", degrees(view.roll_deg), "wide"],
    ["camera", degrees(view.tilt_deg === undefined ? undefined : (view.looks_deg ?? [view.tilt_deg])[0]), "wide"],
  ].filter((each) => each[1] !== undefined);
  $("aids").hidden = !all.length;
  fill("aids", all, ([key, value, kind = ""]) => [element("dt", words.t(key), kind), element("dd", value, kind)]);
}

// What a pilot is told, the most important first, each by a code: it is the same message whatever its
// numbers do. Red is danger, amber is now, plain is what comes next, grey is past.

import { LEAK } from "./alarms.js";
import { units } from "./units.js";
import { words } from "./words.js";

const BACK = ["link_lost", "pilot_lost", "state_lost"]; // failsafes that are over once they can be resumed
const BUSY = "notice:service_late"; // is nothing to fly by
const WET = "notice:leak";

/** @typedef {{ code: string, tone: "alarm" | "warning" | "plain" | "past", text: string, loud: boolean }} Message */

// Each with a capital letter and a full stop.
const sentences = (parts) =>
  parts.filter(Boolean).map((each) => `${each[0].toUpperCase()}${each.slice(1).replace(/[.。]$/, "")}.`).join(" ");

/** @param {PageView} view */
export const acts = (view) => Boolean(view.failsafe && view.failsafe !== "none");

// Of an event its name without its kind: a condition is one, whether it is noticed or acts.
export const codeOf = (name) => name.replace(/^(notice|failsafe):/, "");

/**
 * @param {PageView} view
 * @param {Personal} you
 * @param {{ stop?: string, cut?: string, flew?: boolean, stopped?: boolean, hint?: string, recent?: { code: string, text: string } }} page
 *   keys of what the page itself knows: of a STOP that is not answered, of a cut connection, and whether it flew
 *   by it; sentences
 *   of what comes next, and of what has just been said
 * @returns {Message[]}
 */
export function messages(view, you, page) {
  /** @type {Message[]} */
  const all = [];
  const notices = view.notices ?? [], silent = view.silent_s !== undefined;
  const add = (code, tone, ...parts) => all.push({ code, tone, text: sentences(parts), loud: tone === "alarm" });
  if (page.stop) add(page.stop, "alarm", words.t(page.stop));
  if (notices.some(({ code }) => code === WET)) add(LEAK, "alarm", words.t(WET), words.t(`${WET}.do`));
  if (page.cut === "connecting") add("cut", "plain", words.t(page.cut));
  else if (page.cut) add("cut", "alarm", words.t(page.cut), page.flew ? words.t("pilot_lost") : "");
  if (silent && view.armed) add("silent", "alarm", words.t("link.gone"), gone(view));
  else if (acts(view)) all.push(failsafe(view, you));
  else if (you.lost && view.armed) add("pilot_lost", "alarm", words.t(you.lost));
  if (!silent) for (const notice of view.alarms ?? []) add("link", "alarm", `${words.t("LINK")} ${words.notice(notice)}`);
  if (you.wants_rest) add("wants_rest", "warning", words.t("wants_rest"));
  if (page.stopped) add("stopped", "warning", words.t(view.activity === "stopping" ? "stopping.rest" : "stopped"));
  const { recent } = page, about = notices.flatMap((each) => each.about ?? []); // a notice says it as well
  if (recent && ![...about, ...all.map(({ code }) => code)].includes(recent.code)) add(recent.code, "warning", recent.text);
  for (const notice of notices) {
    const code = codeOf(notice.code);
    if (all.some((each) => each.code === code)) continue;
    if (notice.code === BUSY) add(code, "past", words.t("busy"));
    else add(code, code === "calibrating" ? "plain" : "warning", words.notice(notice));
  }
  if (page.hint) add("hint", "plain", page.hint);
  return all;
}

// What a drone does that hears nobody either.
/** @param {PageView} view */
function gone(view) {
  if (acts(view)) {
    const what = words.t(`does.${view.doing}`);
    return view.next_s ? words.t("then", { what, s: units.number(view.next_s) }) : what;
  }
  return view.next_s ? words.t("gone.rises", { s: units.number(view.next_s) }) : words.t("does.rising");
}

// What is lost, what the drone does, and what the pilot must.
/** @param {PageView} view @param {Personal} you @returns {Message} */
function failsafe(view, you) {
  const name = view.failsafe, over = view.resumable && BACK.includes(name);
  const mine = you.watcher || (you.has_sticks && you.in_control);
  const depth = units.depth(view.depth_wanted_m ?? view.depth_m); // the wanted one stands still
  const does = over && depth && view.doing === "holding" ? words.t("holds_at", { depth }) : words.t(`does.${view.doing}`);
  const more = view.next_s === undefined ? does : words.t("then", { what: does, s: units.number(view.next_s) });
  const must = view.returns === "centre" ? "do.centre" : over ? "do.resume" : `failsafe:${name}.do`;
  const lost = name === "pilot_lost" && you.lost ? words.t(you.lost) : words.t(`failsafe:${name}.short`);
  const takes = !mine && (over || view.returns === "centre" || name === "pilot_lost");
  const text = sentences([over ? words.t(`back.${name}`) : lost, more, words.t(takes ? "do.take" : must)]);
  return { code: name, tone: over ? "warning" : "alarm", text, loud: true };
}

// STOP holds the drone until a stick moves it, or something else does.
export class Stopped {
  holds = false;

  /** @param {PageView} view @param {boolean} asked a STOP was just confirmed */
  look(view, asked) {
    const { activity } = view, moved = activity === "piloted" && (view.sticks ?? []).some(Boolean);
    if (asked || activity === "stopping") this.holds = true;
    if (!view.armed || moved || activity === "goto" || activity === "follow") this.holds = false;
    return this.holds && !acts(view);
  }
}

// Everything in words: what the drone does, who has the sticks, what is wrong.

const $ = (id) => document.getElementById(id);
const OLD_MS = 500; // [ms] of depth and attitude
const UNKNOWN = "–";

function put(id, words, kind = "") {
  const element = $(id);
  if (element.textContent !== words) element.textContent = words;
  if (element.className !== kind) element.className = kind;
}

function alarm(id, words) {
  put(id, words ?? "");
  $(id).hidden = !words;
}

const plain = (name) => (name || UNKNOWN).replaceAll("_", " ");
const ms = (value) => (value === undefined ? UNKNOWN : `${value < 9.95 ? value.toFixed(1) : value.toFixed(0)} ms`);
const seconds = (value) => (value < 0.995 ? `${(1000 * value).toFixed(0)} ms` : `${value.toFixed(1)} s`);

export function who(you, view) {
  const other = view.pilot && !you.in_control ? view.pilot : "";
  if (you.has_sticks && you.in_control) return "you have the sticks";
  if (you.has_sticks) return other ? `${other} has control` : "asking for control";
  if (you.taken) return "another page has the sticks";
  return other ? `${other} has the sticks` : "nobody has the sticks";
}

// [ms] Age of depth and attitude on this screen; undefined: not known.
export function age(you, view, arrived) {
  if (view.state_ms === undefined) return undefined;
  return view.state_ms + (you.delay_ms ?? 0) / 2 + performance.now() - arrived;
}

export function show(connection, you, view, steeredBy) {
  const silent = view.silent_s === undefined ? "" : "last known: ";
  put("armed", view.mode ? `${silent}${view.armed ? "ARMED" : "DISARMED"}` : UNKNOWN, view.armed && !silent ? "on" : "");
  put("drone", view.drone || UNKNOWN);
  document.title = view.drone ? `${view.drone} · Lindy cockpit` : "Lindy cockpit";
  put("mode", `${plain(view.mode)} · ${plain(view.hold)}`);
  put("who", you.watcher ? `watching · ${who(you, view)}` : who(you, view) + (you.has_sticks ? ` · ${steeredBy}` : ""));
  put("battery", view.volts === undefined ? `battery ${UNKNOWN}`
    : `battery ${view.volts.toFixed(1)} V${view.left === undefined ? "" : ` ${(100 * view.left).toFixed(0)} %`}`);
  put("light", `light ${view.light === undefined ? UNKNOWN : `${(100 * view.light).toFixed(0)} %`}`);
  const loss = view.loss === undefined ? "" : ` loss ${(100 * view.loss).toFixed(0)} %`;
  put("link", view.link_up === false ? "link DOWN" : `link ${ms(view.rtt_ms)}${loss} · page ${ms(you.delay_ms)}`);
  const old = age(you, view, connection.arrived);
  put("age", old === undefined ? `state ${UNKNOWN}` : `state ${seconds(old / 1000)}`, old > OLD_MS ? "old" : "");
  alarm("lost", connection.words ? `${connection.words}${connection.watching ? "" : ": pilot lost"}` : you.lost && `pilot lost: ${you.lost}`);
  alarm("failsafe", failsafe(view));
  alarm("note", notes(you, view));
  lines(view.lines ?? []);
  return old === undefined || old > OLD_MS || Boolean(connection.words);
}

// The age of the picture, and what is wrong with it.
export function showPicture(video) {
  const { age, words, silence } = video;
  const known = age !== undefined && silence < Infinity;
  put("picture-age", `picture ${known ? seconds(age / 1000) : UNKNOWN}`, known && words ? "old" : "");
  put("no-picture", words, words && known ? "old" : "");
}

function failsafe(view) {
  const acts = view.failsafe && view.failsafe !== "none";
  if (!acts && view.next_s === undefined) return "";
  const next = view.next_s === undefined ? "" : ` · next in ${Math.max(0, view.next_s).toFixed(0)} s`;
  return `${view.words || plain(view.failsafe)}${next}`;
}

function notes(you, view) {
  const silent = view.silent_s === undefined ? "" : `no status from the drone for ${view.silent_s.toFixed(1)} s`;
  const rest = you.wants_rest ? "centre the sticks: until then they move nothing" : "";
  return [rest, silent, view.alarm && `link: ${view.alarm}`, view.note].filter(Boolean).join(" · ");
}

let shown = "";
function lines(all) {
  const now = JSON.stringify(all);
  if (now === shown) return;
  shown = now;
  $("lines").replaceChildren(...all.map(([level, text]) => {
    const line = document.createElement("li");
    line.className = level;
    line.textContent = text;
    return line;
  }));
}

export function buttons(you, view) {
  const may = Boolean(you.has_sticks);
  const resumes = view.armed && view.failsafe && view.failsafe !== "none";
  put("arm", resumes ? "Hold to resume" : view.armed ? "Hold to disarm" : "Hold to arm", "hold");
  $("arm").disabled = Boolean(you.taken);
  $("disarm").hidden = !resumes; // then the button above resumes
  $("disarm").disabled = $("arm").disabled;
  $("take").hidden = may && Boolean(you.in_control);
  $("take").disabled = Boolean(you.taken);
  $("force").hidden = !(view.pilot && !you.in_control && !you.taken);
  for (const id of ["offer", "give_back"]) $(id).hidden = !(may && you.in_control);
  for (const id of ["hold", "lamp"]) $(id).disabled = !(may && you.in_control);
  const hold = $("hold");
  if (view.hold && document.activeElement !== hold && hold.value !== view.hold) hold.value = view.hold;
  return resumes || !view.armed ? "arm" : "disarm";
}

// Everything in words: what the drone does, who has the sticks, what is wrong.

const $ = (id) => document.getElementById(id);
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

// [ms] Age of depth and attitude on this screen; undefined: not known.
export function age(you, view, arrived) {
  if (view.age_ms === undefined) return undefined;
  return view.age_ms + (you.delay_ms ?? 0) / 2 + performance.now() - arrived;
}

export function show(connection, you, view, steeredBy) {
  const silent = view.silent_s === undefined ? "" : "last known: ";
  put("armed", view.activity ? `${silent}${view.armed ? "ARMED" : "DISARMED"}` : UNKNOWN, view.armed && !silent ? "on" : "");
  put("drone", view.drone || UNKNOWN);
  document.title = view.drone ? `${view.drone} · Lindy cockpit` : "Lindy cockpit";
  put("activity", `${plain(view.doing)} · ${plain(view.flight_mode)}`);
  const who = you.who ?? "";
  put("who", you.watcher ? `watching · ${who}` : who + (you.has_sticks ? ` · ${steeredBy}` : ""));
  put("numbers", (view.numbers ?? []).map((pair) => pair.join(" ")).join(" · ") || UNKNOWN);
  const loss = view.loss === undefined ? "" : ` loss ${(100 * view.loss).toFixed(0)} %`;
  put("link", view.link_up === false ? "link DOWN" : `link ${ms(view.rtt_ms)}${loss} · page ${ms(you.delay_ms)}`);
  const old = age(you, view, connection.arrived);
  const grey = old > connection.ages.state[0];
  put("age", old === undefined ? `state ${UNKNOWN}` : `state ${seconds(old / 1000)}`, grey ? "old" : "");
  alarm("lost", connection.words ? `${connection.words}${connection.watching ? "" : ": pilot lost"}` : you.lost);
  const rest = you.wants_rest ? [["centre the sticks: until then they move nothing", "warning"]] : [];
  const said = [...rest, ...(view.said ?? [])];
  const of = (tone) => said.filter((each) => each[1] === tone).map((each) => each[0]).join(" · ");
  alarm("failsafe", of("alarm"));
  alarm("note", of("warning"));
  lines(view.lines ?? []);
  return old === undefined || grey || Boolean(connection.words);
}

// The age of the picture, and what is wrong with it.
export function showPicture(video) {
  const { age, words, silence } = video;
  const known = age !== undefined && silence < Infinity;
  put("picture-age", `picture ${known ? seconds(age / 1000) : UNKNOWN}`, known && words ? "old" : "");
  put("no-picture", words, words && known ? "old" : "");
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

// Where it is not offered its place stays empty: nothing else comes to lie under the finger.
function deliberate(id, words, offered, taken) {
  put(id, words, offered ? "hold" : "hold away");
  $(id).disabled = Boolean(taken) || !offered;
}

export function buttons(you, view) {
  const may = Boolean(you.has_sticks);
  const resumes = Boolean(view.armed && view.failsafe && view.failsafe !== "none");
  // Arming and disarming have places of their own: what is under a finger never becomes the other.
  deliberate("arm", resumes ? "Hold to resume" : "Hold to arm", resumes || !view.armed, you.taken);
  deliberate("disarm", "Hold to disarm", view.armed, you.taken);
  $("take").hidden = may && Boolean(you.in_control);
  $("take").disabled = Boolean(you.taken);
  $("force").hidden = !(view.pilot && !you.in_control && !you.taken);
  for (const id of ["offer", "give_back"]) $(id).hidden = !(may && you.in_control);
  for (const id of ["flight_mode", "lamp"]) $(id).disabled = !(may && you.in_control);
  const mode = $("flight_mode");
  if (view.flight_mode && document.activeElement !== mode && mode.value !== view.flight_mode) mode.value = view.flight_mode;
  return resumes ? "resume" : "arm";
}

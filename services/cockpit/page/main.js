// The pilot's page: devices → connection → service, and pictures of the drone → screen.

import { Alarms } from "./alarms.js";
import { cameraTiles } from "./cameras.js";
import { Connection } from "./connection.js";
import { $ } from "./dom.js";
import { gotoPanel } from "./goto.js";
import { holdButton } from "./hold_button.js";
import { Hud } from "./hud.js";
import { watchKeyboard } from "./keyboard.js";
import { SeaMap } from "./map.js";
import { codeOf, messages, Stopped } from "./messages.js";
import { Pad } from "./pad.js";
import { buttons, digits, figures, stale, status, tell } from "./panel.js";
import { placePicture } from "./picture.js";
import { Settings } from "./settings.js";
import { card, keyName, loadKeys, padName, padSheet, sheets } from "./sheets.js";
import { steeringBy, touchStick } from "./steering.js";
import { toolPanel } from "./tools.js";
import { units } from "./units.js";
import { Video } from "./video.js";
import { LANGUAGES, words } from "./words.js";

const STICKS_MS = 20; // between two messages
const MOVED_MS = 8; // between two of a stick that moves; the service takes 250 messages a second
const SAME_MS = 200; // the same picture is drawn again after this
const WORDS_MS = 100; // words are drawn so often
const TOGETHER_MS = 60; // what is new waits so long at most for a picture
const SAID_MS = 6000; // what the page or the service has just said is now; then it is past
const STANDS = /^(lost|notice|failsafe):/; // events that are said for as long as they last
const CLICKED_MS = 100; // after a touch: what it has clicked has heard of it
const FOV_DEG = 80; // where the service does not say how wide the picture is

const connection = new Connection();
const hud = new Hud($("hud"));
export const video = new Video($("picture"), connection);
const cameras = cameraTiles(video, connection, (name) => connection.wish("camera", { camera: name }));
const settings = new Settings(apply);
const alarms = new Alarms(settings, words);
const stopped = new Stopped();
let arming = "arm"; // what the hold button asks for now

/** @returns {Personal} */
const you = () => connection.picture?.you ?? {};
/** @returns {PageView} */
const view = () => connection.picture?.view ?? {};
const mine = () => Boolean(you().has_sticks && you().in_control);
const wish = (what, fields = {}) => (what === "stop" ? connection.halt() : connection.wish(what, fields));
let halted = false; // a STOP was confirmed
connection.stopHeard = () => { halted = true; };
$("stop").addEventListener("pointerdown", (e) => { e.preventDefault(); wish("stop"); });
const goto = gotoPanel(view, wish, (key) => say(words.t(key)));

// Holding begins to steer, so that positions have arrived when it ends.
function takeFirst() {
  if (!you().has_sticks && !you().taken) wish("take");
}
const deliberate = (id, meaning, begin = takeFirst) =>
  holdButton($(id), meaning, begin, (what) => wish(what), () => say(words.t("void")));
const held = {
  arm: deliberate("arm", () => arming),
  disarm: deliberate("disarm", () => "disarm"),
  force: deliberate("force", () => "force", () => {}),
};
const hold = (what, down) => (down ? held[what].press() : held[what].release());
const OWN = { // what the page does itself
  map: () => settings.next("map"), speed: () => settings.next("speed"), mute: () => settings.next("sound"),
  next_camera: () => cameras.next(), brighter: () => goto.light(1), darker: () => goto.light(-1),
  deeper: () => goto.deeper(1), shallower: () => goto.deeper(-1),
  heading_port: () => goto.turned(-1), heading_starboard: () => goto.turned(1),
};
const press = (what) => (what in OWN ? OWN[what]() : wish(what));
const by = (device, act) => (...what) => { steering.used(device); act(...what); };
const keys = await loadKeys();
const pad = new Pad(by("pad", press), by("pad", hold));
const drawPad = padSheet(pad), showCard = card(pad);
const keyboard = watchKeyboard(keys, by("keyboard", press), by("keyboard", hold), steer, (e) => {
  if (e.key.length === 1 && e.key !== "?") say(words.t("key.none", { key: keyName(e.code) }));
});
const thumbs = ["left", "right"].map((id) => touchStick($(id), steer));
const tools = toolPanel(wish, steer);
const steering = steeringBy(thumbs[0], thumbs[1], keyboard, pad, tools);
const map = new SeaMap(connection, settings, mine, wish, (key) => say(words.t(key)));
const menu = sheets((name) => {
  if (name === "menu") goto.fill();
  if (name === "keys") keys.draw();
  draw();
});

for (const id of ["tools-open", "map-open"]) $(id).addEventListener("click", () => menu.show(""));
for (const id of ["take", "offer", "give_back", "home", "unwind", "film", "snapshot"]) $(id).addEventListener("click", () => wish(id));
$("lamp").addEventListener("click", () => wish("light"));
$("flight_mode").addEventListener("change", (e) => { wish("mode", { flight_mode: e.target.value }); e.target.blur(); });
$("gain").addEventListener("click", () => settings.next("speed"));

// Sticks, 50 times a second while the page can be seen, and at once when one has moved.
let sent = "", sentAt = 0, movedAt = 0;
let gone = false; // the device that steered is gone
function steer() {
  if (document.hidden || connection.watching) return;
  const sticks = steering.read(Number(settings.speed) / 100), at = positions(sticks);
  if (keyboard.moving || pad.active) document.body.classList.remove("touch");
  if (at !== sent && steering.moving) idle();
  if (!you().has_sticks) { sent = at; return; }
  const now = performance.now(), moved = at !== sent;
  if (now - (moved ? movedAt : sentAt) < (moved ? MOVED_MS : STICKS_MS - 1)) return;
  if (sticks && !connection.steer(sticks)) return;
  if (!sticks && !gone) connection.absent("unplugged");
  gone = !sticks;
  [sent, sentAt] = [at, now];
  if (moved) movedAt = now;
}
const positions = (sticks) => sticks && [sticks.surge, sticks.sway, sticks.heave, sticks.yaw, sticks.tilt, sticks.gripper].join();
setInterval(steer, STICKS_MS / 2); // a pad tells nobody that it has moved

// Why sticks move nothing.
function idle() {
  if (!view().activity) return;
  if (!view().armed) say(words.t("idle.disarmed", { key: armKey() }), () => !view().armed);
  else if (!mine()) say(words.t("idle.sticks"), () => !mine());
}
// What arms, on the device that the pilot seems to have.
function armKey() {
  const button = pad.pad ? pad.map.arm : -1;
  if (button >= 0) return pad.pad.mapping === "standard" && button === 9 ? "start" : `${words.t("button")} ${button}`;
  if (document.body.classList.contains("touch") || matchMedia("(pointer: coarse)").matches) return words.t("card.button");
  return keyName(keys.codes("arm")[0]);
}
// What comes next.
function hint() {
  if (connection.watching || !view().activity || connection.words) return "";
  if (you().taken) return words.t("another page has the sticks");
  if (!view().armed) return view().activity === "ready" ? words.t("hint.arm", { key: armKey() }) : "";
  return mine() ? "" : words.t("hint.take");
}

// The first touch shows the sticks. It moves none, and nothing moves away under it.
addEventListener("pointerup", (e) => {
  if (e.pointerType === "touch") setTimeout(() => document.body.classList.add("touch"), CLICKED_MS);
}, { capture: true });

let leaves = false; // what is hidden because it is left or loaded anew is said to be closed
function hide(why) {
  if (connection.watching || leaves) return;
  leaves = why === "closed";
  steering.release();
  for (const what of Object.values(held)) what.release();
  connection.absent(why);
}
document.addEventListener("visibilitychange", () => (document.hidden ? hide("hidden") : stayAwake()));
addEventListener("pagehide", () => hide("closed"));
addEventListener("pageshow", () => (leaves = false));
addEventListener("contextmenu", (e) => e.preventDefault());

// Where the browser has it: the screen does not lock while this page is open.
function stayAwake() {
  navigator.wakeLock?.request("screen").catch(() => {});
}
stayAwake();

// Choices for this screen.
const CHOICES = ["theme", "crop", "sound", "speech", "units"];
async function apply(changed) {
  document.documentElement.className = settings.theme;
  hud.colours();
  if (changed === "language" || words.language !== settings.language) await words.use(settings.language);
  units.use(settings.units, settings.language);
  $("map-up").textContent = `↑ ${words.t(`up.${settings.up}`)}`;
  for (const id of CHOICES) $(id).textContent = `${words.t(id)}: ${words.t(`${id}.${settings[id]}`)}`;
  $("gain").textContent = `${words.t("speed")} ${settings.speed} %`;
  $("silence").title = words.t("silence");
  drawnAt = 0;
  wake();
  if (menu.open) menu.show(menu.open);
}
for (const id of CHOICES) $(id).addEventListener("click", () => settings.next(id));
$("language").append(...Object.entries(LANGUAGES).map(([code, called]) => new Option(called, code)));
$("language").value = settings.language;
$("language").addEventListener("change", (e) => settings.set("language", e.target.value));
$("silence").addEventListener("click", () => settings.set("sound", "off"));
$("fullscreen").addEventListener("click", () => {
  const asked = document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen?.();
  asked?.catch(() => say(words.t("fullscreen.refused")));
});

document.body.classList.toggle("watcher", connection.watching);

// Drawn when there is something new, and now and then to say that there is not. The state waits for
// a picture that comes soon.
let drawn = null, drawnAt = 0, asked = false, later = 0;
function wake() {
  if (!asked) requestAnimationFrame(frame);
  asked = true;
}
function wakeIn(ms) {
  clearTimeout(later);
  later = setTimeout(wake, ms);
}
Video.decoded = wake;
connection.heard = () => wakeIn(Math.max(0, TOGETHER_MS - cameras.large.silence));
function frame() {
  asked = false;
  wakeIn(SAME_MS);
  const seen = cameras.draw();
  if (seen !== hud.picture) drawnAt = 0; // with or without a sky of its own
  hud.picture = seen;
  const now = performance.now();
  if (connection.picture === drawn && now - drawnAt < SAME_MS) return;
  drawn = connection.picture;
  if (now - wordsAt >= WORDS_MS || !drawnAt) draw();
  else drawMotion();
  drawnAt = now;
}

// A sentence of the page itself, for as long as it takes to read it.
let own = "", ownAt = 0, ownHolds = () => true;
function say(sentence, holds = () => true) {
  [own, ownAt, ownHolds] = [sentence, performance.now(), holds];
}

// What the service has just said to the pilot, after what this page found when it was opened.
let newest = null, recent = null, recentAt = 0;
function listen(now) {
  const line = connection.log?.findLast((each) => each[5] && !STANDS.test(each[4])), said = line ? line.join() : "";
  if (newest !== null && said && said !== newest) [recent, recentAt] = [{ code: codeOf(line[4]), text: words.said(line[3], line[4]) }, now];
  if (connection.log) newest = said;
  return recent && now - recentAt < SAID_MS ? recent : undefined;
}

let flew = false, seenPad = ""; // this page had the sticks when it was drawn last; which pad
function notice() {
  // Whoever takes the sticks here is told what the pilot before may have left.
  if (you().has_sticks && !flew && !settings.shipped("speed")) say(words.t("speed.yours", { s: settings.speed }));
  flew = Boolean(you().has_sticks);
  const id = pad.any?.id ?? "";
  if (id && id !== seenPad) say(words.t(pad.pad ? "pad.seen" : "pad.unknown", { pad: padName(pad.any) }));
  seenPad = id;
}

// All words, and where they stand; then what moves.
let wordsAt = 0, boxes = {};
function draw() {
  const now = (wordsAt = performance.now()), seen = view();
  cameras.show(seen.cameras, seen.large);
  status(connection, you(), seen, steering.device, cameras.large);
  map.draw();
  arming = buttons(you(), seen, connection.watching);
  figures(you(), seen, Number(settings.speed));
  showCard(seen, connection.watching);
  tools.show(seen.tools ?? [], mine());
  notice();
  if (now - ownAt > SAID_MS || !ownHolds()) own = "";
  const all = messages(seen, you(), {
    stop: connection.stopSaid(), cut: connection.words, flew: connection.flew,
    stopped: stopped.look(seen, halted), hint: hint(), recent: listen(now),
  });
  halted = false;
  tell(all, own, connection.log ?? []);
  const loud = all.filter((each) => each.loud);
  alarms.look(loud.map(({ code, text }) => [code, text]), now);
  $("silence").hidden = !loud.length || settings.sound === "off";
  if (menu.open === "pad") drawPad();
  boxes = Object.fromEntries(["heading", "depth", "buttons"].map((id) => [id, $(id).getBoundingClientRect()]));
  drawMotion();
}

function drawMotion() {
  const seen = view(), old = stale(connection, you(), seen);
  digits(seen, old);
  const axis = placePicture(cameras.large.canvas, {
    stripe: cameras.large.stripe ?? 0, fov: seen.fov_deg ?? FOV_DEG, whole: settings.crop === "whole",
    free: [boxes.heading.bottom, boxes.buttons.top],
  });
  hud.draw(seen, old, axis, boxes);
}
addEventListener("resize", draw);
await words.use(settings.language);
await apply("language");
wake();

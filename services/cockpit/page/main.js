// The pilot's page: devices → connection → service, and pictures of the drone → screen.

import { Alarms } from "./alarms.js";
import { Cameras } from "./cameras.js";
import { Connection } from "./connection.js";
import { Film } from "./film.js";
import { Goto } from "./goto.js";
import { HoldButton } from "./hold_button.js";
import { Hud } from "./hud.js";
import { Keyboard } from "./keyboard.js";
import { Keys } from "./keys.js";
import { KeysPanel } from "./keys_panel.js";
import { SeaMap } from "./map.js";
import { Menu } from "./menu.js";
import { Pad } from "./pad.js";
import { PadPanel } from "./pad_panel.js";
import { aids, alarm, buttons, digits, lines, show, showPicture, stale } from "./panel.js";
import { Picture } from "./picture.js";
import { Settings } from "./settings.js";
import { Steering } from "./steering.js";
import { Tools } from "./tools.js";
import { TouchStick } from "./touch_stick.js";
import { Trace } from "./trace.js";
import { units } from "./units.js";
import { Video } from "./video.js";
import { LANGUAGES, words } from "./words.js";

const STICKS_MS = 20; // between two messages
const MOVED_MS = 8; // between two of a stick that moves; the service takes 250 messages a second
const SAME_MS = 200; // the same picture is drawn again after this
const WORDS_MS = 100; // words are drawn so often
const TOGETHER_MS = 60; // what is new waits so long at most for a picture
const SAID_MS = 5000; // a sentence of the page
const CLICKED_MS = 100; // after a touch: what it has clicked has heard of it
const FOV_DEG = 80; // where the service does not say how wide the picture is
const $ = (id) => document.getElementById(id);

const connection = new Connection();
const hud = new Hud($("hud"));
const trace = new Trace($("trace"));
export const video = new Video($("picture"), connection);
const cameras = new Cameras(video, connection, (name) => connection.wish("camera", { camera: name }));
const picture = new Picture($("picture"));
const settings = new Settings(apply);
const alarms = new Alarms(settings, words);
let arming = "arm"; // what the hold button asks for now
let flew = false; // this page had the sticks when it was drawn last
let gone = false; // the device that steered is gone

const you = () => connection.picture?.you ?? {};
const view = () => connection.picture?.view ?? {};
const wish = (what, fields) => (what === "stop" ? connection.halt() : connection.wish(what, fields));
connection.stopHeard = () => say(words.t("stop.sent"));
$("stop").addEventListener("pointerdown", (e) => { e.preventDefault(); wish("stop"); });
const goto = new Goto(view, wish, (key) => say(words.t(key)));

// Holding begins to steer, so that positions have arrived when it ends.
function takeFirst() {
  if (!you().has_sticks && !you().taken) wish("take");
}
const deliberate = (id, meaning, begin = takeFirst) =>
  new HoldButton($(id), meaning, begin, (what) => wish(what), () => say(words.t("void")));
const held = {
  arm: deliberate("arm", () => arming),
  disarm: deliberate("disarm", () => "disarm"),
  force: deliberate("force", () => "force", () => {}),
};
const hold = (what, down) => (down ? held[what].press() : held[what].release());
const click = (id) => $(id).hidden || $(id).click();
const OWN = { // what the page does itself
  map: () => settings.next("map"), speed: () => settings.next("speed"), mute: () => settings.next("sound"), film: () => click("film"), snapshot: () => click("snapshot"),
  next_camera: () => cameras.next(), brighter: () => goto.light(1), darker: () => goto.light(-1),
  deeper: () => goto.deeper(1), shallower: () => goto.deeper(-1),
  heading_port: () => goto.turned(-1), heading_starboard: () => goto.turned(1),
};
const press = (what) => (what in OWN ? OWN[what]() : wish(what));
const by = (device, act) => (...what) => { steering.used(device); act(...what); };
const keys = await Keys.load();
const keysPanel = new KeysPanel(keys, say); // hears a key before what steers does
const pad = new Pad(by("pad", press), by("pad", hold));
const padPanel = new PadPanel(pad);
const film = new Film(wish);
const keyboard = new Keyboard(keys, by("keyboard", press), by("keyboard", hold), steer);
const thumbs = ["left", "right"].map((id) => new TouchStick($(id), steer));
const tools = new Tools(wish, steer);
const steering = new Steering(...thumbs, keyboard, pad, tools);
const mine = () => Boolean(you().has_sticks && you().in_control);
const map = new SeaMap(connection, settings, mine, wish, (key) => say(words.t(key)));
const menu = new Menu((name) => {
  if (name === "menu") goto.fill();
  if (name === "keys") keysPanel.draw();
  draw();
});

// On a small phone what is pressed less often stands in the menu.
const phone = matchMedia("(min-aspect-ratio: 1/1) and (max-height: 560px), (max-width: 480px) and (max-height: 700px)");
const gather = () => (phone.matches ? $("menu").querySelector("header").after($("extras")) : $("film").before($("extras")));
phone.addEventListener("change", gather);
gather();
$("tools-open").addEventListener("click", () => menu.show(""));
$("map-open").addEventListener("click", () => menu.show(""));
for (const id of ["take", "offer", "give_back", "home", "unwind"]) $(id).addEventListener("click", () => wish(id));
$("lamp").addEventListener("click", () => wish("light"));
$("flight_mode").addEventListener("change", (e) => { wish("mode", { flight_mode: e.target.value }); e.target.blur(); });
$("gain").addEventListener("click", () => settings.next("speed"));

// Sticks, 50 times a second while the page can be seen, and at once when one has moved.
let sent = "", sentAt = 0, movedAt = 0;
function steer() {
  if (document.hidden || connection.watching) return;
  const sticks = steering.read(Number(settings.speed) / 100);
  if (keyboard.moving || pad.active) document.body.classList.remove("touch");
  if (!you().has_sticks) return;
  const now = performance.now(), moved = positions(sticks) !== sent;
  if (now - (moved ? movedAt : sentAt) < (moved ? MOVED_MS : STICKS_MS - 1)) return;
  if (sticks && !connection.steer(sticks)) return;
  if (!sticks && !gone) connection.absent("unplugged");
  gone = !sticks;
  [sent, sentAt] = [positions(sticks), now];
  if (moved) movedAt = now;
}
const positions = (sticks) => sticks && [sticks.surge, sticks.sway, sticks.heave, sticks.yaw, sticks.tilt, sticks.gripper].join();
setInterval(steer, STICKS_MS / 2); // a pad tells nobody that it has moved

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

// Choices for this screen; without one the theme is as the system wants it.
const light = matchMedia("(prefers-color-scheme: light)"), contrast = matchMedia("(prefers-contrast: more)");
const wanted = () => (contrast.matches ? "contrast" : light.matches ? "bright" : "dark");
const theme = () => (settings.chosen ? settings.theme : wanted());
async function apply(changed) {
  document.documentElement.className = theme();
  hud.colours();
  if (changed === "language" || words.language !== settings.language) await words.use(settings.language);
  units.use(settings.units, settings.language);
  name();
  drawnAt = 0;
  wake();
  if (menu.open) menu.opened(menu.open);
}
// What stands on buttons that say a choice.
function name() {
  const named = { theme: theme(), crop: settings.crop, sound: settings.sound, speech: settings.speech, units: settings.units };
  $("map-up").textContent = `↑ ${words.t(`up.${settings.up}`)}`;
  for (const [id, value] of Object.entries(named)) $(id).textContent = `${words.t(id)}: ${words.t(`${id}.${value}`)}`;
  $("gain").textContent = `${words.t("speed")} ${settings.speed} %`;
  $("gain").classList.toggle("limited", settings.speed !== "100");
}
for (const id of ["theme", "crop", "sound", "speech", "units"]) $(id).addEventListener("click", () => {
  if (id === "theme" && !settings.chosen) settings.theme = wanted();
  settings.next(id);
});
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
let own = "", ownAt = 0;
function say(sentence) {
  [own, ownAt] = [sentence, performance.now()];
}
function told(now) {
  if (now - ownAt > SAID_MS) own = "";
  alarm("own", own);
}

// All words, and where they stand; then what moves.
let wordsAt = 0, boxes = {}, heard = "";
function draw() {
  const now = (wordsAt = performance.now()), seen = view();
  const found = show(connection, you(), seen, steering.device);
  cameras.show(seen.cameras, seen.large);
  picture.use(cameras.large.canvas);
  showPicture(cameras.large);
  film.show(seen, !connection.watching);
  map.draw();
  told(now);
  arming = buttons(you(), seen);
  aids(seen, Number(settings.speed), you().delay_ms);
  const newest = connection.log.at(-1)?.join();
  if (menu.open && newest && newest !== heard) say(words.said(connection.log.at(-1)[3], connection.log.at(-1)[4])); // lies under it
  heard = newest;
  tools.show(seen.tools ?? [], Boolean(you().has_sticks && you().in_control));
  // Whoever takes the sticks here is told what the pilot before may have left.
  if (you().has_sticks && !flew && !settings.shipped("speed")) say(words.t("speed.yours", { s: settings.speed }));
  flew = Boolean(you().has_sticks);
  alarms.look(found, now);
  $("silence").hidden = !found.length || settings.sound === "off";
  if (menu.open === "menu") lines(connection.log.toReversed(), "log");
  if (menu.open === "pad") padPanel.draw();
  trace.add(seen.rtt_ms, now);
  boxes = Object.fromEntries(["heading", "depth", "aids", "buttons", "left", "map"].map((id) => [id, $(id).getBoundingClientRect()]));
  drawMotion();
}

function drawMotion() {
  const seen = view(), old = stale(connection, you(), seen);
  digits(seen, old);
  const axis = picture.place({
    stripe: cameras.large.stripe ?? 0, fov: seen.fov_deg ?? FOV_DEG, whole: settings.crop === "whole",
    free: [boxes.heading.bottom, boxes.buttons.top],
  });
  hud.draw(seen, old, axis, boxes);
}
addEventListener("resize", draw);
await words.use(settings.language);
await apply("language");
for (const query of [light, contrast]) query.addEventListener("change", () => apply("theme"));
wake();

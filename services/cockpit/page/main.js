// The pilot's page: devices → connection → service, and pictures of the drone → screen.

import { Connection } from "/connection.js";
import { Drones } from "/drones.js";
import { HoldButton } from "/hold_button.js";
import { Hud } from "/hud.js";
import { Keyboard } from "/keyboard.js";
import { Keys } from "/keys.js";
import { Pad } from "/pad.js";
import { buttons, show, showPicture } from "/panel.js";
import { GAINS } from "/shape.js";
import { Steering } from "/steering.js";
import { TouchStick } from "/touch_stick.js";
import { Trace } from "/trace.js";
import { Video } from "/video.js";

const STICKS_MS = 20; // between two messages
const MOVED_MS = 8; // between two of a stick that moves; the service takes 250 messages a second
const SAME_MS = 200; // the same picture is drawn again after this
const SAID_MS = 5000; // a sentence of the page
const THEMES = ["dark", "bright", "contrast"];
const $ = (id) => document.getElementById(id);

const connection = new Connection();
const hud = new Hud($("hud"));
const trace = new Trace($("trace"));
const drones = new Drones(connection);
export const video = new Video($("picture"), connection);
let arming = "arm"; // what the hold button asks for now
let gain = "Normal";
let gone = false; // the device that steered is gone

const PRESSED = { speed: faster }; // keys of the page itself

const you = () => connection.picture?.you ?? {};
const wish = (what, hold) => connection.wish(what, hold);

// Holding begins to steer, so that positions have arrived when it ends.
function takeFirst() {
  if (!you().has_sticks && !you().taken) wish("take");
}
const VOID = "what was held has changed its meaning: nothing was done. Let go, and hold again";
const deliberate = (id, meaning, begin = takeFirst) =>
  new HoldButton($(id), meaning, begin, wish, () => say(VOID));
const held = {
  arm: deliberate("arm", () => arming),
  disarm: deliberate("disarm", () => "disarm"),
  force: deliberate("force", () => "force", () => {}),
};
const hold = (what, down) => (down ? held[what].press() : held[what].release());
const press = (what) => (what in PRESSED ? PRESSED[what]() : wish(what));
const pad = new Pad(press, hold);
const keyboard = new Keyboard(await Keys.load(), press, hold, steer);
const thumbs = ["left", "right"].map((id) => new TouchStick($(id), steer));
const steering = new Steering(...thumbs, keyboard, pad);

$("stop").addEventListener("pointerdown", (e) => { e.preventDefault(); wish("stop"); });
for (const id of ["take", "offer", "give_back"]) $(id).addEventListener("click", () => wish(id));
$("lamp").addEventListener("click", () => wish("light"));
$("flight_mode").addEventListener("change", (e) => { wish("mode", e.target.value); e.target.blur(); });
$("gain").addEventListener("click", () => PRESSED.speed());
function faster() {
  const names = Object.keys(GAINS);
  gain = names[(names.indexOf(gain) + 1) % names.length];
  $("gain").textContent = `Speed: ${gain.toLowerCase()}`;
}

// Sticks, 50 times a second while the page can be seen, and at once when one has moved.
let sent = "", sentAt = 0, movedAt = 0;
function steer() {
  if (document.hidden || connection.watching) return;
  const sticks = steering.read(GAINS[gain]);
  if (!you().has_sticks) return;
  const now = performance.now(), moved = positions(sticks) !== sent;
  if (now - (moved ? movedAt : sentAt) < (moved ? MOVED_MS : STICKS_MS - 1)) return;
  if (sticks && !connection.steer(sticks)) return;
  if (!sticks && !gone) connection.absent("unplugged");
  gone = !sticks;
  [sent, sentAt] = [positions(sticks), now];
  if (moved) movedAt = now;
}
const positions = (sticks) => sticks && [sticks.surge, sticks.sway, sticks.heave, sticks.yaw, sticks.tilt].join();
setInterval(steer, STICKS_MS / 2); // a pad tells nobody that it has moved

function hide() {
  if (connection.watching) return;
  steering.release();
  for (const what of Object.values(held)) what.release();
  connection.absent("hidden");
}
document.addEventListener("visibilitychange", () => (document.hidden ? hide() : stayAwake()));
addEventListener("pagehide", hide);
addEventListener("contextmenu", (e) => e.preventDefault());

// Where the browser has it: the screen does not lock while this page is open.
function stayAwake() {
  navigator.wakeLock?.request("screen").catch(() => {});
}
stayAwake();

// A choice for this screen; without one as the system wants it.
function theme(name) {
  document.documentElement.className = name;
  $("theme").textContent = `Screen: ${name}`;
  hud.colours();
}
const preferred = matchMedia("(prefers-color-scheme: light)");
const contrast = matchMedia("(prefers-contrast: more)");
const wanted = () => (contrast.matches ? "contrast" : preferred.matches ? "bright" : "dark");
let stored = null;
try { stored = localStorage.getItem("theme"); } catch { /* not allowed: not remembered */ }
theme(THEMES.includes(stored) ? stored : wanted());
preferred.addEventListener("change", () => stored || theme(wanted()));
$("theme").addEventListener("click", () => {
  stored = THEMES[(THEMES.indexOf(document.documentElement.className) + 1) % THEMES.length];
  theme(stored);
  try { localStorage.setItem("theme", stored); } catch { /* as above */ }
});

document.body.classList.toggle("watcher", connection.watching);

// Drawn when there is something new, and now and then to say that there is not.
let drawn = null, drawnAt = 0;
function frame() {
  requestAnimationFrame(frame);
  const now = performance.now();
  const seen = video.draw();
  if (seen !== hud.picture) drawnAt = 0; // with or without a sky of its own
  hud.picture = seen;
  if (connection.picture === drawn && now - drawnAt < SAME_MS) return;
  drawn = connection.picture;
  drawnAt = now;
  draw();
}

// A sentence of the page itself, for as long as it takes to read it.
let own = "", ownAt = 0;
function say(words) {
  [own, ownAt] = [words, performance.now()];
}
function told() {
  if (performance.now() - ownAt > SAID_MS) own = "";
  $("own").textContent = own;
  $("own").hidden = !own;
}

function draw() {
  const picture = connection.picture ?? { you: {}, view: {} };
  const steeredBy = steering.device === "pad" ? "pad" : steering.device;
  const old = show(connection, picture.you, picture.view, steeredBy);
  showPicture(video);
  drones.show(picture.view);
  told();
  arming = buttons(picture.you, picture.view);
  hud.draw(picture.view, old);
  trace.add(picture.view.rtt_ms, performance.now());
}
frame();

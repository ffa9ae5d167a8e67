// Laws of the pilot's page that need no browser: run by test_page_laws.py, with the folder of the
// page's files as they are served.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { test } from "node:test";
import { pathToFileURL } from "node:url";

const page = process.env.LINDY_PAGE;
let now = 0;
globalThis.fetch = async (name) => ({ json: async () => JSON.parse(await readFile(`${page}/${name}`, "utf8")) });
globalThis.document = { documentElement: {}, querySelectorAll: () => [] };
globalThis.addEventListener = () => {};
performance.now = () => now;
const load = (name) => import(pathToFileURL(`${page}/${name}.js`).href);
const { words, LANGUAGES } = await load("words");
const { units } = await load("units");
const { messages, Stopped, codeOf } = await load("messages");
const { Alarms } = await load("alarms");
const { holdButton } = await load("hold_button");
const { Connection } = await load("connection");

const ME = { has_sticks: true, in_control: true };
const FLIES = { activity: "piloted", doing: "piloted", armed: true, depth_m: 1.25 };
const LOST = { ...FLIES, doing: "holding", failsafe: "pilot_lost", next_s: 57 };
const first = (view, you = ME, page = {}) => messages(view, you, page)[0];
const ACTING = ["leak", "battery_critical", "state_lost", "imu_lost", "link_lost", "pilot_lost"];
const DOES = ["stopping", "holding", "rising", "staying at the surface", "not obeyed"];

async function inEveryLanguage(check) {
  for (const language of Object.keys(LANGUAGES)) {
    await words.use(language);
    units.use("metric", language);
    check(language);
  }
  await words.use("en");
  units.use("metric", "en");
}

test("what the drone does by itself is whole sentences in every language", async () => {
  await inEveryLanguage((language) => {
    for (const failsafe of ACTING) for (const doing of DOES) for (const resumable of [true, false]) for (const returns of ["centre", "resume", "wait"]) {
      const { text, loud } = first({ ...LOST, failsafe, doing, resumable, returns });
      assert.match(text, /^[^{}]+\. [^{}]+\. [^{}]+\.$/u, `${language} ${failsafe} ${doing}`);
      assert.ok(!/does\.|failsafe:|notice:|back\.\w/.test(text), `${language}: ${text}`);
      assert.ok(loud);
    }
  });
});

test("red is danger, amber is what asks for the pilot, and what is over is not red", () => {
  assert.equal(first(LOST).tone, "alarm");
  const back = first({ ...LOST, resumable: true });
  assert.equal(back.tone, "warning");
  assert.equal(back.text, "Pilot back. The drone holds at 1.25 m; it rises in 57 s. Centre the sticks, then hold resume.");
  assert.match(first({ ...LOST, resumable: true }, { has_sticks: false }).text, /Take the sticks/);
  // What may be overruled while it lasts is not over.
  assert.equal(first({ ...LOST, failsafe: "leak", doing: "rising", resumable: true }).tone, "alarm");
});

test("the gravest is first, and each is there once", () => {
  const notices = [{ code: "notice:leak" }, { code: "notice:battery_low", numbers: { left: 0.2 } }], alarms = [{ code: "link.never" }];
  const recent = { code: "battery_low", text: "the battery is low" };
  const all = messages({ ...LOST, notices, alarms }, ME, { stop: "stop.unheard", recent });
  assert.deepEqual(all.map(({ code }) => code), ["stop.unheard", "leak", "pilot_lost", "link", "battery_low"]);
  assert.deepEqual(messages({ ...FLIES, silent_s: 9, notices, alarms }, ME, {}).map(({ code }) => code), ["leak", "silent", "battery_low"]);
});

test("what a notice is about is not said a second time", () => {
  const notices = [{ code: "not_ready", about: ["upside_down:sensor/imu"] }], recent = { code: "upside_down:sensor/imu", text: "the IMU reads" };
  assert.deepEqual(messages({ ...FLIES, armed: false, notices }, ME, { recent }).map(({ code }) => code), ["not_ready"]);
});

test("a notice is a sentence with its numbers and what it is about", () => {
  assert.equal(words.notice({ code: "link.rtt", numbers: { from: 40, to: 900 } }), "round trip has risen from 40 to 900 ms");
  assert.equal(words.notice({ code: "notice:near_floor", numbers: { m: 0.5 } }), "the bottom is close (0.5 m)");
  const [noisy, silent] = ["noisy:sensor/imu", "recorder"].map((name) => words.notice({ code: "notice:sensor", about: [name] }));
  assert.equal(noisy, "a sensor is in trouble (a sensor is very noisy: it has less weight (sensor/imu))");
  assert.equal(silent, "a sensor is in trouble (recorder)");
});

test("a cut connection is red for who flies and for who watches, and a page that begins is calm", () => {
  const cut = "nothing arrives from the cockpit";
  assert.equal(first({}, {}, { cut, flew: true }).text, "Nothing arrives from the cockpit. Pilot lost.");
  assert.equal(first({}, {}, { cut }).text, "Nothing arrives from the cockpit."); // of this page nobody is lost
  assert.deepEqual([first({}, {}, { cut: "connecting" }).tone, first({}, {}, { cut: "connecting" }).loud], ["plain", false]);
});

test("a page that was held up itself hears what waits before it says that nothing arrives", () => {
  const timers = [], sockets = [];
  class Socket {
    static OPEN = 1;
    constructor() { sockets.push(this); }
    send() {}
  }
  const real = { setInterval, setTimeout, querySelector: document.querySelector };
  Object.assign(globalThis, { WebSocket: Socket, location: new URL("http://127.0.0.1:8767/"), setInterval: (act) => timers.push(act), setTimeout: (act) => timers.push(act) });
  document.querySelector = () => ({ getAttribute: () => "1" });
  try {
    const connection = new Connection(), heard = (armed) => sockets[0].onmessage({ data: JSON.stringify({ n: 1, t: now, ages: {}, you: ME, view: { armed } }) });
    heard(true);
    assert.ok(connection.flew);
    now += 2000;
    timers.shift()(); // the clock's call comes first …
    heard(false); // … then what had arrived meanwhile
    timers.shift()();
    assert.deepEqual([connection.words, connection.flew], ["", false]);
    now += 2000;
    connection.look();
    assert.equal(connection.words, "nothing arrives from the cockpit");
  } finally {
    Object.assign(globalThis, { setInterval: real.setInterval, setTimeout: real.setTimeout });
    document.querySelector = real.querySelector;
  }
});

test("a busy computer is one grey word", () => {
  const notices = [{ code: "notice:service_late", about: ["ardusub"] }];
  const [busy, ...others] = messages({ ...FLIES, notices }, ME, {});
  assert.deepEqual([busy.tone, busy.text, others.length], ["past", "Computer busy.", 0]);
});

test("a drone that is not heard is said to rise, and when", () => {
  assert.equal(first({ ...FLIES, silent_s: 27, next_s: 34.4 }).text, "Link gone. The drone holds; it rises in 34 s.");
  assert.equal(first({ ...FLIES, silent_s: 99, next_s: 0 }).text, "Link gone. It rises slowly.");
  assert.match(first({ ...LOST, silent_s: 27, next_s: 31 }).text, /it rises in 31 s\.$/);
  assert.equal(first({ ...FLIES, silent_s: 27, armed: false }), undefined);
});

test("a message keeps its code whatever its numbers do", () => {
  const codes = new Set([57, 56, 12].map((next_s) => first({ ...LOST, next_s }).code));
  assert.equal(codes.size, 1);
  assert.equal(codeOf("failsafe:leak"), codeOf("notice:leak"));
});

test("STOP is said for as long as it holds the drone", () => {
  const stopped = new Stopped(), rest = { ...FLIES, sticks: [0, 0, 0, 0] };
  assert.ok(!stopped.look(rest, false));
  assert.ok(stopped.look(rest, true)); // at rest already: the drone says nothing of it
  for (let k = 0; k < 1000; k++) assert.ok(stopped.look(rest, false));
  assert.ok(!stopped.look({ ...rest, sticks: [0, 0.2, 0, 0] }, false));
  assert.ok(stopped.look({ ...rest, activity: "stopping", sticks: [0, 0.2, 0, 0] }, false));
  assert.ok(stopped.look(rest, false));
  assert.ok(!stopped.look({ ...rest, failsafe: "pilot_lost" }, false)); // has a sentence of its own
  assert.ok(stopped.look(rest, false)); // and that has not moved it
  for (const ends of [{ activity: "goto" }, { activity: "follow" }, { armed: false }]) {
    stopped.look({ ...rest, activity: "stopping" }, false);
    assert.ok(!stopped.look({ ...rest, ...ends }, false), JSON.stringify(ends));
  }
});

function heard(settings) {
  const alarms = new Alarms(settings, words), found = { beeps: 0, said: [] };
  alarms.sound = () => found.beeps++;
  alarms.speak = (sentence) => found.said.push(sentence);
  return [alarms, found];
}

test("an alarm is heard at once and every ten seconds, and spoken once", () => {
  const [alarms, found] = heard({ sound: "on", speech: "on" });
  for (let ms = 0; ms <= 25000; ms += 500) alarms.look([["link", `for ${ms} ms`]], ms);
  assert.deepEqual(found, { beeps: 3, said: ["for 0 ms"] });
  alarms.look([], 26000);
  alarms.look([["link", "again"]], 26500);
  assert.deepEqual(found, { beeps: 4, said: ["for 0 ms", "again"] });
});

test("water inside is heard whatever is silenced", () => {
  const [alarms, found] = heard({ sound: "off", speech: "off" });
  alarms.look([["link", "x"]], 0);
  assert.equal(found.beeps, 0);
  alarms.look([["link", "x"], ["leak", "y"]], 100);
  alarms.look([["link", "x"], ["leak", "y"]], 11000);
  assert.equal(found.beeps, 2);
});

test("numbers are the pilot's: units, decimals, and unknown is no number", () => {
  assert.deepEqual([units.depth(1.25), units.depth(undefined), units.ms(undefined)], ["1.25 m", undefined, "–"]);
  assert.deepEqual([units.age(34.2), units.age(1250), units.time(3725)], ["34 ms", "1.3 s", "1:02:05"]);
  units.use("imperial", "de");
  assert.equal(units.depth(0.3048), "1,00 ft");
  assert.ok(Math.abs(units.metres(units.length(12.3)) - 12.3) < 1e-12);
  assert.equal(units.temperature(20), "68 °F");
  units.use("knots", "en");
  assert.equal(units.speed(1852 / 3600), "1.00 kn");
  assert.equal(units.number(-0.2), "0"); // no minus before nothing
  assert.deepEqual([units.bearing(359.6), units.bearing(7, 3), units.share(0.25)], ["0°", "007°", "25 %"]);
  units.use("metric", "en");
});

test("words have their numbers, and what is not known is shown as it is", async () => {
  await inEveryLanguage(() => {
    assert.ok(words.t("gone.rises", { s: 34 }).includes("34"));
    assert.equal(words.t("ann has the sticks"), "ann has the sticks");
  });
  await words.use("de");
  assert.equal(words.said("the battery is low (20 %)", "notice:battery_low"), "die Batterie ist schwach (20 %)");
  assert.equal(words.said("mine", ""), "mine");
  await words.use("en");
});

function button() {
  const hears = {}, done = [], element = {
    disabled: false, hidden: false, setPointerCapture() {}, style: { setProperty() {} },
    addEventListener: (name, act) => (hears[name] = act),
  };
  const state = { means: "arm" };
  const hold = holdButton(element, () => state.means, () => {}, (what) => done.push(what), () => done.push("void"));
  const after = (ms) => { now += ms; hold.grow(); };
  return { hold, hears, done, state, element, after };
}

test("a button does what it said when it was pressed, after a second and not before", () => {
  const { hold, done, after } = button();
  hold.press();
  after(900);
  assert.deepEqual(done, []);
  after(100);
  assert.deepEqual(done, ["arm"]);
  after(2000);
  assert.deepEqual(done, ["arm"]);
  hold.press();
  after(900);
  hold.release();
  after(500);
  assert.deepEqual(done, ["arm"]);
});

test("a hold is void once its meaning has changed or it is not offered", () => {
  for (const change of [(b) => (b.state.means = "resume"), (b) => (b.element.disabled = true), (b) => (b.element.hidden = true)]) {
    const b = button();
    b.hold.press();
    b.after(500);
    change(b);
    b.after(600);
    assert.deepEqual(b.done, ["void"]);
    b.after(2000);
    assert.deepEqual(b.done, ["void"]);
  }
});

// The WebSocket to the service. Nothing is queued: old sticks are not sent, old pictures not drawn.

const RETRY_MS = 700;
const DEAD_MS = 3000; // without a picture: the connection is opened anew
const CONFIRM_EVERY = 5; // pictures
const ON_THE_WAY = 300; // [B] about one message
const OLD_PAGE = 4001; // close codes of the service
const TOO_MANY = 4002;
const STOP_MS = 10000; // so long a STOP is sent: later it may be meant for another pilot
const SLOW_MS = 400; // of an answer that a person must know to be missing
const LATER_MS = 5000; // until another attempt where there is no room
const HEARS_MS = 50; // a page that was held up itself first hears what has arrived meanwhile

export class Connection {
  constructor() {
    /** @type {PageText | null} */
    this.picture = null; // the newest
    this.arrived = 0; // [ms] when, by this page's clock
    this.track = []; // of the map: north and east [dm] and how it goes on, for each point
    this.log = null; // warnings and errors of the dive; null: not heard yet
    this.ages = { state: [Infinity, Infinity], picture: [1000, 3000] }; // until said
    this.words = "connecting"; // what is wrong; empty: nothing
    this.flew = false; // an armed drone, when it was heard last
    this.old = false; // this page is of another version than the service
    this.clock = new ServiceClock();
    this.watching = location.pathname.endsWith("/watch");
    this.version = document.querySelector("meta[name=version]").getAttribute("content");
    this.opened = 0;
    this.stop = null; // that was not confirmed: when it was pressed, and how many were heard then
    this.waits = null; // [ms] since when the drone has not answered one
    this.missed = -Infinity; // [ms] when one was given up
    this.heard = () => {}; // something new has arrived
    this.stopHeard = () => {}; // the service has confirmed a STOP
    this.open();
    setInterval(() => setTimeout(() => this.look(), HEARS_MS), 500);
  }

  open() {
    this.opened = performance.now();
    const socket = new WebSocket(this.address(this.watching ? "ws/watch" : "ws/pilot"));
    this.socket = socket;
    this.clock.forget(); // of a service that may have begun anew
    this.picture = null;
    this.confirmed = 0; // number of the picture that the service knows to have arrived
    if (this.stop) this.stop.heard = 0;
    socket.onopen = () => this.stop && this.wish("stop");
    socket.onmessage = (event) => this.hear(event.data);
    socket.onclose = (event) => {
      if (this.socket !== socket) return;
      this.picture = null;
      this.old = event.code === OLD_PAGE;
      const full = event.code === TOO_MANY;
      this.words = this.old || full ? event.reason : "no connection to the cockpit";
      if (!this.old) setTimeout(() => this.open(), full ? LATER_MS : RETRY_MS);
    };
  }

  address(path, more = {}) {
    const url = new URL(path, location.href); // the page may be below a path of somebody else's server
    url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    const query = new URLSearchParams({ version: this.version, token: location.hash.slice(1), ...more });
    [url.search, url.hash] = [String(query), ""];
    return url.href;
  }

  hear(text) {
    this.picture = JSON.parse(text);
    this.arrived = performance.now();
    this.ages = this.picture.ages;
    this.clock.learn(this.picture.t, this.arrived, this.picture.you.delay_ms);
    this.words = "";
    this.log = this.picture.log ?? this.log;
    this.track = this.picture.track ?? this.track;
    const { stops = 0, stop_waits, has_sticks, in_control } = this.picture.you;
    this.flew = Boolean(has_sticks && in_control && this.picture.view.armed);
    if (this.stop && stops > this.stop.heard) {
      this.stop = null;
      this.stopHeard();
    }
    this.waits = stop_waits ? (this.waits ?? this.arrived) : null;
    if (this.picture.n - this.confirmed >= CONFIRM_EVERY) this.send("seen", {});
    this.heard();
  }

  // STOP is sent until the service has confirmed it, also to one that was started again meanwhile.
  halt() {
    if (!this.watching) this.stop = { at: performance.now(), heard: this.picture?.you.stops ?? 0 };
    this.wish("stop");
  }

  // What a person must read of it; empty: nothing.
  stopSaid() {
    const now = performance.now();
    if (this.stop) return now - this.stop.at > SLOW_MS ? "stop.unheard" : "";
    if (now - this.missed < LATER_MS) return "stop.missed";
    return this.waits !== null && now - this.waits > SLOW_MS ? "stop.unanswered" : "";
  }

  // Also while nothing arrives, a person must read that.
  look() {
    if (this.stop && performance.now() - this.stop.at > STOP_MS) [this.stop, this.missed] = [null, performance.now()];
    if (this.stop) this.wish("stop");
    const silent = performance.now() - Math.max(this.arrived, this.opened);
    if (silent > 1000 && !this.words) this.words = "nothing arrives from the cockpit";
    if (silent > DEAD_MS && this.socket.readyState < WebSocket.CLOSING) {
      this.socket.onclose = null;
      this.socket.close();
      this.open();
    }
  }

  // Sticks are left out while older ones have not left yet: one message may be on its way from the
  // page to the browser's network. Returns whether they were sent.
  steer(fields) {
    if (this.socket.bufferedAmount > ON_THE_WAY) return false;
    this.send("sticks", fields);
    return true;
  }

  // Returns whether it was sent.
  /** @param {PageWish["what"]} what @param {Partial<PageWish>} fields */
  wish(what, fields = {}) {
    return this.send("wish", { what, ...fields });
  }

  absent(why) {
    this.send("absent", { why });
  }

  /** @param {PageSaid["kind"]} kind */
  send(kind, fields) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    const seen = this.picture ? this.picture.n : 0;
    const held_ms = this.picture ? performance.now() - this.arrived : 0;
    this.confirmed = seen;
    this.socket.send(JSON.stringify({ kind, seen, held_ms, ...fields }));
    return true;
  }
}

// The service's clock, as far as it can be known from here: texts say when they were sent, and the
// fastest of the last seconds took half of the shortest way there and back.

const SPAN_MS = 3000;

export class ServiceClock {
  constructor() { this.forget(); }

  forget() { this.heard = []; }

  // sent: [ms] by the service's clock; arrived: [ms] by this page's; delay: [ms] there and back, or undefined
  learn(sent, arrived, delay) {
    this.heard.push({ arrived, apart: arrived - sent, delay: delay ?? Infinity });
    while (this.heard[0].arrived < arrived - SPAN_MS) this.heard.shift();
    const least = (of) => this.heard.reduce((a, b) => Math.min(a, of(b)), Infinity);
    const delays = least((h) => h.delay);
    this.apart = least((h) => h.apart) - (delays < Infinity ? delays / 2 : 0);
  }

  // [ms] How old something is that happened at this moment of the service's clock; undefined: not known.
  age(moment) {
    if (!this.heard.length) return undefined;
    return Math.max(0, performance.now() - this.apart - moment);
  }
}

// The drone's picture, over a WebSocket of its own: access units → WebCodecs → canvas. The newest
// wins. Its age is counted from the light on, and a picture that is old does not look live.

import { units } from "./units.js";
import { words } from "./words.js";

const VERSION = 1, KEYFRAME = 1, EXACT = 2, STRIPE = 4, HEADER = 16; // of a message, see services/cockpit/video.py
const STRIPE_ROWS = 18; // [px] at the top of a picture that has its time in it, for machines
const RETRY_MS = 700, RATE_MS = 2000;

export class Video {
  static decoded = () => {}; // a picture can be drawn

  // name: of the camera; empty: the first one
  constructor(canvas, connection, name = "") {
    this.canvas = canvas;
    this.connection = connection;
    this.name = name;
    this.g = canvas.getContext("2d");
    this.light = null; // [ms] of the shown picture, by the service's clock …
    this.exact = false; // … and not earlier
    this.shownAt = 0; // [ms] when it was decoded, by this page's
    this.frame = null; // decoded, not yet drawn
    this.unable = cannot(); // key of the sentence why this browser shows no picture; empty: it can
    this.stripe = 0; // [px] rows at the top that are for machines
    this.underWay = []; // units that the decoder has
    this.failures = 0;
    this.bytes = 0; // that have arrived …
    this.since = performance.now(); // … since then
    this.rate = 0; // [kbit/s]
    document.addEventListener("visibilitychange", () => (document.hidden ? this.close() : this.open()));
    if (!document.hidden) this.open();
  }

  open() {
    if (this.unable || this.socket) return;
    const socket = new WebSocket(this.connection.address("ws/video", this.name ? { camera: this.name } : {}));
    socket.binaryType = "arraybuffer";
    socket.onmessage = (event) => this.take(socket, event.data);
    socket.onclose = () => {
      if (this.socket !== socket) return;
      this.close();
      if (!this.connection.old) setTimeout(() => document.hidden || this.open(), RETRY_MS);
    };
    this.socket = socket;
  }

  // Nobody looks, or nothing comes: begin anew, with a keyframe.
  close() {
    const socket = this.socket;
    this.socket = null;
    socket?.close();
    this.stop();
  }

  stop() {
    if (this.decoder && this.decoder.state !== "closed") this.decoder.close();
    this.decoder = null;
    this.underWay = [];
  }

  take(socket, message) {
    this.bytes += message.byteLength;
    const head = new DataView(message);
    if (head.getUint8(0) !== VERSION) return;
    const unit = {
      flags: head.getUint8(1), number: head.getUint32(4, true),
      light: head.getFloat64(8, true), data: new Uint8Array(message, HEADER), socket,
    };
    const keyframe = unit.flags & KEYFRAME;
    if (keyframe) this.configure(codecOf(unit.data));
    if (!this.decoder) return confirm(unit); // before the first keyframe, or after an error
    this.underWay.push(unit);
    const type = keyframe ? "key" : "delta";
    try {
      this.decoder.decode(new EncodedVideoChunk({ type, timestamp: unit.number, data: unit.data }));
    } catch (error) {
      this.fail(error);
    }
  }

  // Parameters that change are in the stream; only another profile or level needs another decoder.
  configure(codec) {
    if (!codec || (this.decoder && codec === this.codec)) return;
    this.stop();
    this.codec = codec;
    const decoder = new VideoDecoder({
      output: (frame) => (decoder === this.decoder ? this.decoded(frame) : frame.close()),
      error: (error) => decoder === this.decoder && this.fail(error),
    });
    this.decoder = decoder;
    decoder.configure({ codec, optimizeForLatency: true });
  }

  decoded(frame) {
    const at = this.underWay.findIndex((unit) => unit.number === frame.timestamp);
    if (at < 0) return frame.close();
    const unit = this.underWay[at];
    this.underWay.splice(0, at + 1);
    confirm(unit);
    this.stripe = unit.flags & STRIPE ? STRIPE_ROWS : 0;
    this.frame?.close();
    this.frame = frame;
    this.light = unit.light;
    this.exact = Boolean(unit.flags & EXACT);
    this.shownAt = performance.now();
    Video.decoded();
  }

  fail(error) {
    this.failures++;
    const last = this.underWay.at(-1);
    this.stop(); // until the next keyframe
    if (last) confirm(last);
    if (error.name !== "NotSupportedError") return;
    this.unable = "video.h264";
    this.close();
  }

  // [ms] Since the newest picture: grey from then on, gone from then on.
  get ages() { return this.connection.ages.picture; }

  // [ms] Of the newest picture, from the light on; undefined: not known.
  get age() { return this.light === null ? undefined : this.connection.clock.age(this.light); }

  // [ms] Since the newest one was decoded.
  get silence() { return this.light === null ? Infinity : performance.now() - this.shownAt; }

  // [kbit/s] That arrive, over the last seconds.
  get kbit() {
    const now = performance.now(), span = now - this.since;
    if (span > RATE_MS) [this.rate, this.bytes, this.since] = [(this.bytes * 8) / span, 0, now];
    return this.rate;
  }

  // Before the age in words: it is exact only where the camera says when the light arrived.
  get least() { return this.exact ? "" : "≥ "; }

  // What is wrong with the picture; empty: nothing.
  get words() {
    if (this.unable) return words.t(this.unable, { codec: this.codec });
    if (this.light === null) return words.t("no picture");
    if (this.silence > this.ages[0]) return words.t("video.silent", { s: units.number(this.silence / 1000) });
    if (this.age === undefined) return words.t("video.no_age");
    if (this.age <= this.connection.ages.state[0]) return "";
    return words.t("video.old", { s: this.least + units.number(this.age / 1000, 1) });
  }

  // Draw the newest picture. Returns whether one is to be seen.
  draw() {
    const { canvas, frame } = this;
    if (frame) {
      if (canvas.width !== frame.displayWidth || canvas.height !== frame.displayHeight) {
        canvas.width = frame.displayWidth;
        canvas.height = frame.displayHeight;
      }
      this.g.drawImage(frame, 0, 0);
      frame.close();
      this.frame = null;
    }
    const seen = this.silence < this.ages[1]; // grey first, and then it vanishes
    canvas.hidden = !seen;
    canvas.className = this.silence > this.ages[0] || this.age === undefined ? "stopped" : "";
    return seen;
  }
}

function confirm(unit) {
  if (unit.socket.readyState === WebSocket.OPEN) unit.socket.send(String(unit.number));
}

function cannot() {
  if (!isSecureContext) return "video.insecure";
  return typeof VideoDecoder === "undefined" ? "video.webcodecs" : "";
}

// As RFC 6381 names it, from the sequence parameter set of a keyframe.
function codecOf(data) {
  for (let k = 0; k + 6 < data.length; k++)
    if (!data[k] && !data[k + 1] && data[k + 2] === 1 && (data[k + 3] & 31) === 7)
      return `avc1.${[4, 5, 6].map((j) => data[k + j].toString(16).padStart(2, "0")).join("")}`;
  return null;
}

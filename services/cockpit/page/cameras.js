// Several cameras: one fills the screen, the others stand small at the edge, each with its name, its
// age and what arrives of it. A tap makes one large; which one it is the service says, to all pages.

import { make, write } from "./dom.js";
import { units } from "./units.js";
import { Video } from "./video.js";
import { words } from "./words.js";

export class Cameras {
  // choose(name): the pilot wants it large
  constructor(first, connection, choose) {
    this.connection = connection;
    this.choose = choose;
    this.large = first; // its video
    this.videos = [first]; // in the order of the service's list
    this.tiles = new Map(); // by name
    this.place = document.getElementById("cameras");
  }

  // listed: name of each camera, and whether the link has no room for it; undefined: there is one only
  show(listed = [], large = "") {
    for (const [name] of listed) if (!this.tiles.has(name)) this.add(name);
    const chosen = this.tiles.get(large)?.video ?? this.videos[0];
    if (chosen !== this.large) this.swap(chosen);
    for (const [name, tile] of this.tiles) {
      const entry = listed.find((each) => each[0] === name);
      tile.video.want(Boolean(entry) || tile.video === this.videos[0]); // another drone has others
      tile.button.hidden = tile.video === this.large || !entry;
      if (!tile.button.hidden) label(tile, entry[1]);
    }
  }

  add(name) {
    const [button, called, text] = [make("button", "", "camera"), make("b"), make("span")];
    const first = !this.tiles.size;
    const video = first ? this.videos[0] : new Video(document.createElement("canvas"), this.connection, name);
    if (!first) this.videos.push(video);
    video.name = name;
    button.disabled = this.connection.watching;
    button.append(called, text);
    if (video !== this.large) button.prepend(video.canvas);
    button.addEventListener("click", () => this.choose(name));
    this.place.append(button);
    this.tiles.set(name, { video, button, called, text });
  }

  // The pictures change their places and nothing else: neither is decoded anew.
  swap(video) {
    const before = this.large;
    before.canvas.id = "";
    for (const { dataset, style } of [before.canvas, video.canvas]) dataset.style = style.cssText = "";
    crop(before);
    this.tiles.get(before.name)?.button.prepend(before.canvas);
    this.large = video;
    video.canvas.id = "picture";
    document.body.prepend(video.canvas);
  }

  next() {
    const names = [...this.tiles.keys()], at = names.indexOf(this.large.name);
    if (names.length) this.choose(names[(at + 1) % names.length]);
  }

  // Draws all. Returns whether the large one is to be seen.
  draw() {
    let seen = false;
    for (const video of this.videos) {
      const shown = video.draw();
      if (video === this.large) seen = shown;
      else crop(video);
    }
    return seen;
  }
}

function label({ video, button, called, text }, roomless) {
  const { age, least, silence, ages, kbit } = video;
  const known = age !== undefined && silence < Infinity;
  const how = roomless ? words.t("no_room") : known ? `${least}${units.age(age)}` : words.t("no picture");
  const said = roomless || !known ? how : `${how} · ${units.number(kbit)} kbit/s`;
  const name = words.camera(video.name);
  write(called, name);
  write(text, said);
  text.className = roomless || !known || silence > ages[0] ? "old" : "";
  button.setAttribute("aria-label", `${name} · ${said}`);
}

// What of the picture is for machines lies above what is shown.
function crop({ canvas, stripe = 0 }) {
  const share = stripe / canvas.height;
  const style = `height:${100 / (1 - share)}%;translate:0 ${-100 * share}%`;
  if (canvas.dataset.style !== style) canvas.style.cssText = canvas.dataset.style = style;
}

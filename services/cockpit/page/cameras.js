// Several cameras: one fills the screen, the others stand small at the edge, each with its name, its
// age and what arrives of it. A tap makes one large; which one it is the service says, to all pages.

import { $, make, write } from "./dom.js";
import { units } from "./units.js";
import { Video } from "./video.js";
import { words } from "./words.js";

// first: the video of the first one; choose(name): the pilot wants it large
export function cameraTiles(first, connection, choose) {
  let large = first;
  const videos = [first]; // in the order of the service's list
  const tiles = new Map(); // by name

  function add(name) {
    const [button, called, text] = [make("button", "", "camera"), make("b"), make("span")];
    const video = tiles.size ? new Video(document.createElement("canvas"), connection, name) : first;
    if (tiles.size) videos.push(video);
    video.name = name;
    button.disabled = connection.watching;
    button.append(called, text);
    if (video !== large) button.prepend(video.canvas);
    button.addEventListener("click", () => choose(name));
    $("cameras").append(button);
    tiles.set(name, { video, button, called, text });
  }

  // The pictures change their places and nothing else: neither is decoded anew.
  function swap(video) {
    const before = large;
    before.canvas.id = "";
    for (const { dataset, style } of [before.canvas, video.canvas]) dataset.style = style.cssText = "";
    crop(before);
    tiles.get(before.name)?.button.prepend(before.canvas);
    large = video;
    video.canvas.id = "picture";
    document.body.prepend(video.canvas);
  }

  return {
    get large() { return large; },
    // listed: name of each camera, and whether the link has no room for it; undefined: there is one only
    show(listed = [], chosen = "") {
      for (const [name] of listed) if (!tiles.has(name)) add(name);
      const video = tiles.get(chosen)?.video ?? first;
      if (video !== large) swap(video);
      for (const [name, tile] of tiles) {
        const entry = listed.find((each) => each[0] === name);
        tile.button.hidden = tile.video === large || !entry;
        if (!tile.button.hidden) label(tile, entry[1]);
      }
    },
    next() {
      const names = [...tiles.keys()], at = names.indexOf(large.name);
      if (names.length) choose(names[(at + 1) % names.length]);
    },
    // Draws all. Returns whether the large one is to be seen.
    draw() {
      const shown = videos.map((video) => video.draw());
      for (const video of videos) if (video !== large) crop(video);
      return shown[videos.indexOf(large)];
    },
  };
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

// Lights, lasers and the gripper, by the names of the vehicle file. A dimmer has steps, a switch is on
// or off; a gripper moves while its button is held, and only then.

import { $, make, write } from "./dom.js";
import { stepped } from "./steering.js";
import { units } from "./units.js";
import { words } from "./words.js";

export class Tools {
  // wish(what, fields): ask the drone; moved(): the gripper is held, or no longer
  constructor(wish, moved) {
    this.wish = wish;
    this.moved = moved;
    this.gripper = 0; // [-] + opens, while it is held here
    this.made = ""; // for which outputs, in which language
    this.values = {}; // [-] newest, by name
    $("tools-open").addEventListener("click", () => this.open($("tools").hidden));
    addEventListener("blur", () => this.release());
  }

  open(open) {
    if (!open) this.release();
    $("tools").hidden = !open;
    $("tools-open").setAttribute("aria-expanded", String(open));
    document.body.classList.toggle("equipped", open);
  }

  release() { this.hold(0); }

  hold(way) {
    if (way === this.gripper) return;
    this.gripper = way;
    for (const button of $("tools").querySelectorAll("[data-way]"))
      button.classList.toggle("down", Number(button.dataset.way) === way);
    this.moved();
  }

  // outputs: [name, kind, value] of each, undefined: not known; mine: this page has the sticks.
  show(outputs, mine) {
    $("tools-open").hidden = !outputs.length;
    if (!outputs.length && !$("tools").hidden) this.open(false);
    if (!mine) this.release();
    const made = words.language + outputs.map(([name, kind]) => `${name} ${kind}`).join();
    if (made !== this.made) {
      this.release();
      this.made = made;
      $("tools").replaceChildren(...outputs.map(([name, kind]) => this.row(name, kind)));
    }
    outputs.forEach(([name, kind, value], k) => {
      this.values[name] = value;
      const row = $("tools").children[k];
      for (const button of row.querySelectorAll("button")) if (button.disabled === mine) button.disabled = !mine;
      const said = row.querySelector(".value"), text = this.text(kind, value);
      if (said) write(said, text);
      if (kind === "switch") said.setAttribute("aria-pressed", String(Boolean(value)));
    });
  }

  text(kind, value) {
    if (value === undefined || value === null) return "–";
    return kind === "switch" ? words.t(value ? "on" : "off") : units.share(value);
  }

  row(name, kind) {
    const row = make("div");
    row.append(make("b", name === "light" ? words.t("light") : name.replaceAll("_", " ")));
    if (kind === "gripper") row.append(this.held(-1), this.held(1));
    else if (kind === "switch") row.append(this.button("–", () => this.set(name, this.values[name] ? 0 : 1), "value"));
    else {
      row.append(this.button("−", () => this.step(name, -1)), make("output", "", "value"), this.button("+", () => this.step(name, 1)));
    }
    return row;
  }

  button(text, click, kind = "") {
    const button = make("button", text, kind);
    button.addEventListener("click", click);
    return button;
  }

  held(way) {
    const button = this.button(words.t(way > 0 ? "gripper.open" : "gripper.close"), () => {});
    button.dataset.way = way;
    button.addEventListener("pointerdown", (e) => {
      e.preventDefault();
      button.setPointerCapture(e.pointerId);
      this.hold(way);
    });
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"])
      button.addEventListener(name, () => this.gripper === way && this.release());
    return button;
  }

  step(name, way) {
    const next = stepped(this.values[name], way);
    if (next !== undefined) this.set(name, next);
  }

  set(name, value) { this.wish("output", { output: name, value }); }
}

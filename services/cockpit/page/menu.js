// Sheets at the side, one at a time; none covers depth, heading, what arms, steers or stops.

import { $ } from "./dom.js";

const SHEETS = { menu: "menu-open", keys: "keys-open", pad: "pad-open", drawer: "drawer-open" }; // and what opens them

export class Menu {
  // opened(name): a sheet is shown
  constructor(opened) {
    this.opened = opened;
    this.open = "";
    for (const [name, button] of Object.entries(SHEETS)) {
      $(button).addEventListener("click", () => this.toggle(name));
      $(name).querySelector(".close").addEventListener("click", () => this.show(""));
    }
    addEventListener("keydown", (e) => {
      if (e.key === "Escape") this.show("");
      if (e.key === "?" && !(e.target instanceof HTMLInputElement)) this.toggle("keys");
    });
  }

  toggle(name) { this.show(this.open === name ? "" : name); }

  show(name) {
    this.open = name;
    for (const [each, button] of Object.entries(SHEETS)) {
      $(each).hidden = each !== name;
      $(button).setAttribute("aria-expanded", String(each === name));
    }
    document.body.classList.toggle("panelled", Boolean(name));
    if (name) this.opened(name);
  }
}

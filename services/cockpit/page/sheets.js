// Sheets at the side, one at a time, and the card of the first visit; none covers depth, heading, what
// arms, steers or stops.

import { $, make, put, remember, remembered, write } from "./dom.js";
import { PAD_ACTIONS } from "./pad.js";
import { words } from "./words.js";

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

// Which key does what: the table of services/piloting/keys.py. Keys are named by their place on the
// keyboard (KeyboardEvent.code).

const ARROWS = { ArrowUp: "↑", ArrowDown: "↓", ArrowLeft: "←", ArrowRight: "→" };

export class Keys {
  constructor(table) {
    this.table = table;
    this.actions = new Map(); // row by code
    for (const row of table) for (const code of row.codes) this.actions.set(code, row);
  }

  static async load() { return new Keys(await (await fetch("keys.json")).json()); }

  codes(action) { return this.table.find((each) => each.action === action).codes; }

  // The list of them.
  draw() {
    $("keys").querySelector("dl").replaceChildren(...this.table.flatMap(({ action, kind, codes }) => [
      make("dt", [...new Set(codes.map(keyName))].join(", ")),
      make("dd", kind === "hold" ? `${words.t(`key.${action}`)} (${words.t("hold")})` : words.t(`key.${action}`)),
    ]));
  }
}

// How a key is called.
export function keyName(code) {
  return ARROWS[code] ?? code.replace(/^(Key|Digit)/, "").replace(/(\w)(Left|Right)$/, "$1");
}

// What steers and what stops, on the first visit: it goes with the first arming.

const STORE = "flown";

export class Card {
  constructor(pad) {
    this.pad = pad;
    this.flown = remembered(STORE) !== null;
    $("card-shut").addEventListener("click", () => this.end());
  }

  end() {
    this.flown = true;
    remember(STORE, "yes");
  }

  /** @param {PageView} view */
  show(view, watching) {
    if (view.armed && !this.flown) this.end();
    const hidden = this.flown || watching;
    $("card").hidden = hidden;
    document.body.classList.toggle("first", !hidden);
    if (hidden) return;
    put("card-pad", this.pad.any ? padName(this.pad.any) : words.t("pad"), this.pad.any ? "on" : "");
  }
}

// Browsers add maker and product to it.
export const padName = (raw) => raw.id.replace(/\s*\(.*/, "") || raw.id;

// What of a pad does what: choose an action, then press what it is to have. What is pressed lights up.

export class PadSheet {
  constructor(pad) {
    this.pad = pad;
    $("pad-reset").addEventListener("click", () => pad.reset());
    $("pad").querySelector("ul").replaceChildren(...PAD_ACTIONS.map((action) => {
      const row = make("li"), name = make("span"), button = make("button");
      name.dataset.t = `key.${action}`;
      button.dataset.action = action;
      button.addEventListener("click", () => pad.wait(pad.waits?.action === action ? null : action));
      row.append(name, button);
      return row;
    }));
  }

  draw() {
    const { any, waits } = this.pad, map = this.pad.pad ? this.pad.map : {};
    write($("pad-name"), any ? any.id : words.t("pad.none"));
    for (const button of $("pad").querySelectorAll("li button")) {
      const { action } = button.dataset, to = map[action], here = action === waits?.action;
      write(button, here ? words.t("press_now") : called(to));
      const on = Array.isArray(to) ? Math.abs(any?.axes[to[0]] ?? 0) > 0.5 : any?.buttons[to]?.pressed;
      button.className = here ? "waits" : on ? "on" : "";
      button.disabled = !any;
    }
  }
}

function called(to) {
  if (Array.isArray(to)) return `${words.t("axis")} ${to[0]} ${to[1] < 0 ? "−" : "+"}`;
  return to >= 0 ? `${words.t("button")} ${to}` : "–";
}

// Which key does what: the table of services/piloting/keys.py. Keys are named by their place on the
// keyboard (KeyboardEvent.code).

import { $, make } from "./dom.js";
import { words } from "./words.js";

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

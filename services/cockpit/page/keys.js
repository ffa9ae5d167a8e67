// Which key does what: the table of services/piloting/keys.py, and the pilot's own choice for this
// browser. Keys are named by their place on the keyboard (KeyboardEvent.code).

const OWNED = /^(Control|Alt|Meta|OS|F\d|Tab|Escape|ContextMenu|CapsLock|PrintScreen)/; // by browser and system
const STORE = "keys";
const ARROWS = { ArrowUp: "↑", ArrowDown: "↓", ArrowLeft: "←", ArrowRight: "→" };

export class Keys {
  constructor(table) {
    this.table = table;
    try { this.own = JSON.parse(localStorage.getItem(STORE)) ?? {}; } catch { this.own = {}; }
    this.learn();
  }

  static async load() { return new Keys(await (await fetch("keys.json")).json()); }

  learn() {
    this.actions = new Map(); // by code
    for (const row of this.table) for (const code of this.codes(row.action)) this.actions.set(code, row);
  }

  codes(action) {
    const row = this.table.find((each) => each.action === action);
    const own = this.own[action];
    return Array.isArray(own) ? own.filter((code) => typeof code === "string" && !OWNED.test(code)) : row.codes;
  }

  // Give a key to an action. Returns why not, as a sentence's key; empty: done. Whatever had it has none.
  set(action, code) {
    if (OWNED.test(code)) return "key_owned";
    if (action !== "stop" && this.actions.get(code)?.action === "stop") return "key_is_stop";
    for (const row of this.table)
      if (this.codes(row.action).includes(code)) this.own[row.action] = this.codes(row.action).filter((each) => each !== code);
    this.own[action] = [code];
    this.keep();
    return "";
  }

  reset() { this.own = {}; this.keep(); }

  keep() {
    this.learn();
    try { localStorage.setItem(STORE, JSON.stringify(this.own)); } catch { /* not allowed: not remembered */ }
  }
}

// How a key is called.
export function keyName(code) {
  return ARROWS[code] ?? code.replace(/^(Key|Digit)/, "").replace(/(\w)(Left|Right)$/, "$1");
}

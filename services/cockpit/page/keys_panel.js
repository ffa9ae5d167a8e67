// The map of keys, and changing it: press the key that an action is to have.

import { $, make } from "./dom.js";
import { keyName } from "./keys.js";
import { words } from "./words.js";

export class KeysPanel {
  // say(words): a sentence for the pilot
  constructor(keys, say) {
    this.keys = keys;
    this.say = say;
    this.waits = ""; // the action that waits for its key
    $("keys-reset").addEventListener("click", () => { keys.reset(); this.draw(); });
    // Before the keyboard's own listener: what is given to an action does nothing else.
    addEventListener("keydown", (e) => this.waits && this.give(e), { capture: true });
  }

  give(event) {
    event.preventDefault();
    event.stopImmediatePropagation();
    const refused = event.code === "Escape" ? "" : this.keys.set(this.waits, event.code);
    if (refused) this.say(words.t(refused));
    this.waits = "";
    this.draw();
  }

  draw() {
    $("keys").querySelector("ul").replaceChildren(...this.keys.table.map((row) => {
      const line = make("li"), text = words.t(`key.${row.action}`), waits = this.waits === row.action;
      const names = [...new Set(this.keys.codes(row.action).map(keyName))].join(", ") || "–";
      const button = make("button", waits ? words.t("press_now") : names, waits ? "waits" : "");
      button.addEventListener("click", () => { this.waits = waits ? "" : row.action; button.blur(); this.draw(); });
      line.append(make("span", row.kind === "hold" ? `${text} (${words.t("hold")})` : text), button);
      return line;
    }));
  }
}

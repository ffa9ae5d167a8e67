// The map of keys, and changing it: press the key that an action is to have.

import { keyName } from "./keys.js";
import { words } from "./words.js";

const $ = (id) => document.getElementById(id);

export class KeysPanel {
  // say(words): a sentence for the pilot
  constructor(keys, say) {
    Object.assign(this, { keys, say });
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
      const [line, name, button] = ["li", "span", "button"].map((tag) => document.createElement(tag));
      const text = words.t(`key.${row.action}`);
      name.textContent = row.kind === "hold" ? `${text} (${words.t("hold")})` : text;
      const waits = this.waits === row.action;
      button.textContent = waits ? words.t("press_now") : [...new Set(this.keys.codes(row.action).map(keyName))].join(", ") || "–";
      button.className = waits ? "waits" : "";
      button.addEventListener("click", () => { this.waits = waits ? "" : row.action; button.blur(); this.draw(); });
      line.append(name, button);
      return line;
    }));
  }
}

// What of a pad does what: choose an action, then press what it is to have. What is pressed lights up.

import { $, make, write } from "./dom.js";
import { PAD_ACTIONS } from "./pad.js";
import { words } from "./words.js";

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

// What steers and what stops, on the first visit: it goes with the first arming.

import { $, put, remember, remembered } from "./dom.js";
import { words } from "./words.js";

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

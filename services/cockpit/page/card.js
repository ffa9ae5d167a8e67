// What steers and what stops, on the first visit: it goes with the first arming.

import { $, put } from "./dom.js";
import { words } from "./words.js";

const STORE = "flown";

export class Card {
  constructor(pad) {
    this.pad = pad;
    try { this.flown = localStorage.getItem(STORE) !== null; } catch { this.flown = false; }
    $("card-shut").addEventListener("click", () => this.end());
  }

  end() {
    this.flown = true;
    try { localStorage.setItem(STORE, "yes"); } catch { /* not allowed: not remembered */ }
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

// The pad's mapping: a picture of it in which what is pressed lights up, and what does what.

import { $, make } from "./dom.js";
import { PAD_ACTIONS } from "./pad.js";
import { words } from "./words.js";

// Where the buttons of a standard pad are, in the order of the W3C's Gamepad; then its two sticks.
const AT = [[158, 66], [172, 52], [144, 52], [158, 38], [40, 14], [160, 14], [40, 4], [160, 4], [82, 46], [118, 46], [74, 78], [126, 78], [42, 38], [42, 66], [28, 52], [56, 52], [100, 34]];
const STICKS = [[74, 78], [126, 78]];

export class PadPanel {
  constructor(pad) {
    this.pad = pad;
    this.shown = "";
    $("pad-reset").addEventListener("click", () => { pad.reset(); this.shown = ""; });
    $("pad").querySelector("ul").replaceChildren(...PAD_ACTIONS.map((action) => {
      const [row, name, button] = ["li", "span", "button"].map((tag) => make(tag));
      name.dataset.t = `key.${action}`;
      button.dataset.action = action;
      button.addEventListener("click", () => pad.wait(pad.waits?.action === action ? null : action));
      row.append(name, button);
      return row;
    }));
  }

  draw() {
    const raw = this.pad.any, map = this.pad.pad ? this.pad.map : {};
    $("pad-name").textContent = raw ? raw.id : words.t("pad.none");
    const kind = raw ? `${raw.mapping} ${raw.buttons.length} ${raw.axes.length}` : "";
    if (kind !== this.shown) {
      this.shown = kind;
      $("pad-picture").innerHTML = raw ? picture(raw) : "";
    }
    raw?.buttons.forEach((b, k) => $("pad-picture").querySelector(`[data-button="${k}"]`)?.classList.toggle("on", b.pressed));
    if (raw?.mapping === "standard") STICKS.forEach(([x, y], k) => {
      const dot = $("pad-picture").querySelector(`[data-stick="${k}"]`);
      dot.setAttribute("cx", x + 6 * (raw.axes[2 * k] ?? 0));
      dot.setAttribute("cy", y + 6 * (raw.axes[2 * k + 1] ?? 0));
      dot.classList.toggle("on", Math.hypot(raw.axes[2 * k] ?? 0, raw.axes[2 * k + 1] ?? 0) > 0.2);
    });
    for (const button of $("pad").querySelectorAll("li button")) {
      const { action } = button.dataset, to = map[action], waits = this.pad.waits?.action === action;
      const [axis, sign] = Array.isArray(to) ? to : [];
      const name = axis !== undefined ? `${words.t("axis")} ${axis} ${sign < 0 ? "−" : "+"}` : to >= 0 ? `${words.t("button")} ${to}` : "–";
      button.textContent = waits ? words.t("press_now") : name;
      button.className = waits ? "waits" : "";
      button.disabled = !raw;
    }
  }
}

function picture(raw) {
  const standard = raw.mapping === "standard";
  const at = (k) => (standard && AT[k]) || [10 + 20 * (k % 10), 12 + 22 * Math.floor(k / 10)];
  const body = standard ? '<rect x="14" y="20" width="172" height="76" rx="30"/>' : "";
  const one = (_, k) => {
    const [x, y] = at(k);
    return `<circle data-button="${k}" cx="${x}" cy="${y}" r="${standard && k > 3 && k < 8 ? 5 : 7}"/><text x="${x}" y="${y}">${k}</text>`;
  };
  const sticks = standard ? STICKS.map(([x, y], k) => `<circle data-stick="${k}" cx="${x}" cy="${y}" r="9"/>`).join("") : "";
  return `<svg viewBox="0 -4 200 104" role="img">${body}${sticks}${raw.buttons.map(one).join("")}</svg>`;
}

// Sheets at the side, one at a time, and the card of the first visit; none covers depth, heading, what
// arms, steers or stops.

import { $, make, put, remember, remembered, write } from "./dom.js";
import { PAD_ACTIONS } from "./pad.js";
import { words } from "./words.js";

const SHEETS = { menu: "menu-open", keys: "keys-open", pad: "pad-open", drawer: "drawer-open" }; // and what opens them

// opened(name): a sheet is shown
export function sheets(opened) {
  let open = "";

  function show(name) {
    open = name;
    for (const [each, button] of Object.entries(SHEETS)) {
      $(each).hidden = each !== name;
      $(button).setAttribute("aria-expanded", String(each === name));
    }
    document.body.classList.toggle("panelled", Boolean(name));
    if (name) opened(name);
  }

  const toggle = (name) => show(open === name ? "" : name);
  for (const [name, button] of Object.entries(SHEETS)) {
    $(button).addEventListener("click", () => toggle(name));
    $(name).querySelector(".close").addEventListener("click", () => show(""));
  }
  addEventListener("keydown", (e) => {
    if (e.key === "Escape") show("");
    if (e.key === "?" && !(e.target instanceof HTMLInputElement)) toggle("keys");
  });
  return { show, get open() { return open; } };
}

// Which key does what: the table of services/piloting/keys.py. Keys are named by their place on the
// keyboard (KeyboardEvent.code).

const ARROWS = { ArrowUp: "↑", ArrowDown: "↓", ArrowLeft: "←", ArrowRight: "→" };

export async function loadKeys() {
  const table = await (await fetch("keys.json")).json();
  return {
    actions: new Map(table.flatMap((row) => row.codes.map((code) => [code, row]))), // row by code
    codes: (action) => table.find((each) => each.action === action).codes,
    // The list of them.
    draw: () => $("keys").querySelector("dl").replaceChildren(...table.flatMap(({ action, kind, codes }) => [
      make("dt", [...new Set(codes.map(keyName))].join(", ")),
      make("dd", kind === "hold" ? `${words.t(`key.${action}`)} (${words.t("hold")})` : words.t(`key.${action}`)),
    ])),
  };
}

// How a key is called.
export function keyName(code) {
  return ARROWS[code] ?? code.replace(/^(Key|Digit)/, "").replace(/(\w)(Left|Right)$/, "$1");
}

// What steers and what stops, on the first visit: it goes with the first arming.

const STORE = "flown";

export function card(pad) {
  let flown = remembered(STORE) !== null;

  function end() {
    flown = true;
    remember(STORE, "yes");
  }

  $("card-shut").addEventListener("click", end);
  return (view, watching) => {
    if (view.armed && !flown) end();
    const hidden = flown || watching;
    $("card").hidden = hidden;
    document.body.classList.toggle("first", !hidden);
    if (!hidden) put("card-pad", pad.any ? padName(pad.any) : words.t("pad"), pad.any ? "on" : "");
  };
}

// Browsers add maker and product to it.
export const padName = (raw) => raw.id.replace(/\s*\(.*/, "") || raw.id;

// What of a pad does what: choose an action, then press what it is to have. What is pressed lights up.
// Returns what draws it.
export function padSheet(pad) {
  $("pad-reset").addEventListener("click", () => pad.reset());
  const rows = PAD_ACTIONS.map((action) => {
    const row = make("li"), name = make("span"), button = make("button");
    [name.dataset.t, button.dataset.action] = [`key.${action}`, action];
    button.addEventListener("click", () => pad.wait(pad.waits?.action === action ? null : action));
    row.append(name, button);
    return { row, action, button };
  });
  $("pad").querySelector("ul").replaceChildren(...rows.map(({ row }) => row));
  return () => {
    const { any, waits } = pad, map = pad.pad ? pad.map : {};
    write($("pad-name"), any ? any.id : words.t("pad.none"));
    for (const { action, button } of rows) {
      const to = map[action], here = action === waits?.action;
      write(button, here ? words.t("press_now") : called(to));
      const on = Array.isArray(to) ? Math.abs(any?.axes[to[0]] ?? 0) > 0.5 : any?.buttons[to]?.pressed;
      button.className = here ? "waits" : on ? "on" : "";
      button.disabled = !any;
    }
  };
}

function called(to) {
  if (Array.isArray(to)) return `${words.t("axis")} ${to[0]} ${to[1] < 0 ? "−" : "+"}`;
  return to >= 0 ? `${words.t("button")} ${to}` : "–";
}

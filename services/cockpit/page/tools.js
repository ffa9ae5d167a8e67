// Lights, lasers and the gripper, by the names of the vehicle file. A dimmer has steps, a switch is on
// or off; a gripper moves while its button is held, and only then.

import { $, make, write } from "./dom.js";
import { stepped } from "./steering.js";
import { units } from "./units.js";
import { words } from "./words.js";

// wish(what, fields): ask the drone; moved(): the gripper is held, or no longer
export function toolPanel(wish, moved) {
  let gripper = 0; // [-] + opens, while it is held here
  let made = ""; // for which outputs, in which language
  const values = {}; // [-] newest, by name
  const set = (output, value) => wish("output", { output, value });
  const release = () => hold(0);

  function hold(way) {
    if (way === gripper) return;
    gripper = way;
    for (const each of $("tools").querySelectorAll("[data-way]")) each.classList.toggle("down", Number(each.dataset.way) === way);
    moved();
  }

  function open(opens) {
    if (!opens) release();
    $("tools").hidden = !opens;
    $("tools-open").setAttribute("aria-expanded", String(opens));
    document.body.classList.toggle("equipped", opens);
  }

  function button(text, click, kind = "") {
    const element = make("button", text, kind);
    element.addEventListener("click", click);
    return element;
  }

  function held(way) {
    const element = make("button", words.t(way > 0 ? "gripper.open" : "gripper.close"));
    element.dataset.way = way;
    element.addEventListener("pointerdown", (e) => {
      e.preventDefault();
      element.setPointerCapture(e.pointerId);
      hold(way);
    });
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"])
      element.addEventListener(name, () => gripper === way && release());
    return element;
  }

  function step(name, way) {
    const next = stepped(values[name], way);
    if (next !== undefined) set(name, next);
  }

  function row([name, kind]) {
    const line = make("div");
    line.append(make("b", name === "light" ? words.t("light") : name.replaceAll("_", " ")));
    if (kind === "gripper") line.append(held(-1), held(1));
    else if (kind === "switch") line.append(button("–", () => set(name, values[name] ? 0 : 1), "value"));
    else line.append(button("−", () => step(name, -1)), make("output", "", "value"), button("+", () => step(name, 1)));
    return line;
  }

  $("tools-open").addEventListener("click", () => open($("tools").hidden));
  addEventListener("blur", release);
  return {
    release,
    get gripper() { return gripper; },
    // outputs: [name, kind, value] of each, undefined: not known; mine: this page has the sticks.
    show(outputs, mine) {
      $("tools-open").hidden = !outputs.length;
      if (!outputs.length && !$("tools").hidden) open(false);
      if (!mine) release();
      const wanted = words.language + outputs.map(([name, kind]) => `${name} ${kind}`).join();
      if (wanted !== made) {
        release();
        made = wanted;
        $("tools").replaceChildren(...outputs.map(row));
      }
      outputs.forEach(([name, kind, value], k) => {
        values[name] = value;
        const line = $("tools").children[k], said = line.querySelector(".value");
        for (const each of line.querySelectorAll("button")) if (each.disabled === mine) each.disabled = !mine;
        if (said) write(said, text(kind, value));
        if (kind === "switch") said.setAttribute("aria-pressed", String(Boolean(value)));
      });
    },
  };
}

function text(kind, value) {
  if (value === undefined || value === null) return "–";
  return kind === "switch" ? words.t(value ? "on" : "off") : units.share(value);
}

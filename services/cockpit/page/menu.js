// Panels over the picture, one at a time; they never cover what arms, steers or stops.

const $ = (id) => document.getElementById(id);
const PANELS = { menu: "menu-open", keys: "keys-open", pad: "pad-open" }; // and what opens them

export class Menu {
  // opened(name): a panel is shown
  constructor(opened) {
    this.opened = opened;
    this.open = "";
    for (const [name, button] of Object.entries(PANELS)) {
      $(button).addEventListener("click", () => this.toggle(name));
      $(name).querySelector(".close").addEventListener("click", () => this.show(""));
    }
    addEventListener("keydown", (e) => {
      if (e.key === "Escape") this.show("");
      if (e.key === "?" && !e.target.matches?.("input")) this.toggle("keys");
    });
  }

  toggle(name) { this.show(this.open === name ? "" : name); }

  show(name) {
    this.open = name;
    for (const each of Object.keys(PANELS)) $(each).hidden = each !== name;
    $("menu-open").setAttribute("aria-expanded", String(Boolean(name)));
    document.body.classList.toggle("panelled", Boolean(name));
    if (name) this.opened(name);
  }
}

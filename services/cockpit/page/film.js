// The buttons `film` and `snapshot`. A film runs once the recorder says so.

import { words } from "./words.js";

export class Film {
  constructor(wish) {
    for (const what of ["film", "snapshot"]) {
      this[what] = document.getElementById(what);
      this[what].addEventListener("click", () => wish(what));
    }
  }

  show(view, may) {
    const seconds = view.filming_s, runs = seconds !== undefined;
    const clock = runs && `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")}`;
    const said = runs ? `● ${clock}` : words.t("film");
    if (this.film.textContent !== said) this.film.textContent = said;
    this.film.setAttribute("aria-pressed", String(runs));
    this.film.setAttribute("aria-label", runs ? `${words.t("filming")} ${clock}` : said);
    const taken = view.snapshots ? `${words.t("snapshot")} ✓${view.snapshots}` : words.t("snapshot");
    if (this.snapshot.textContent !== taken) this.snapshot.textContent = taken;
    for (const what of ["film", "snapshot"]) this[what].disabled = !may;
  }
}

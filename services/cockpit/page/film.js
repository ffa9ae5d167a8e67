// The buttons `film` and `snapshot`, wherever the page has them. A film runs once the recorder says so.

export class Film {
  constructor(wish) {
    for (const what of ["film", "snapshot"]) this[what] = document.getElementById(what);
    for (const what of ["film", "snapshot"]) this[what]?.addEventListener("click", () => wish(what));
  }

  show(view, may) {
    if (!this.film) return;
    const seconds = view.filming_s, runs = seconds !== undefined;
    const clock = runs && `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")}`;
    const words = runs ? `● Filming ${clock}` : "Film";
    if (this.film.textContent !== words) this.film.textContent = words;
    this.film.setAttribute("aria-pressed", String(runs));
    for (const what of ["film", "snapshot"]) if (this[what]) this[what].disabled = !may;
    const taken = view.snapshots ? `Snapshot ✓${view.snapshots}` : "Snapshot";
    if (this.snapshot && this.snapshot.textContent !== taken) this.snapshot.textContent = taken;
  }
}

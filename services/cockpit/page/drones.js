// The drones that can be reached. The pilot picks one, confirms, and `lindy fly` changes to it.

const CHANGING_MS = 15000; // so long a change is said to go on while there is no connection
const TOLD_MS = 20000; // so long is said what it has led to
const $ = (id) => document.getElementById(id);

function put(element, words, kind = "") {
  if (element.textContent !== words) element.textContent = words;
  if (element.className !== kind) element.className = kind;
}

export class Drones {
  constructor(connection) {
    this.connection = connection;
    this.rows = new Map(); // by name
    this.names = ""; // in the order in which the rows stand
    this.open = false;
    this.wanted = ""; // drone that is to be confirmed
    this.drone = ""; // that this page shows
    this.left = ""; // the drone that it showed before
    this.changedAt = -Infinity;
    this.going = ""; // a change, in words …
    this.goingAt = -Infinity;
    $("list").addEventListener("click", () => this.toggle(!this.open));
    $("confirm").querySelector(".yes").addEventListener("click", () => {
      this.connection.fly(this.wanted);
      this.toggle(false);
    });
    $("confirm").querySelector(".no").addEventListener("click", () => { this.wanted = ""; this.draw(); });
  }

  toggle(open) {
    [this.open, this.wanted] = [open, ""];
    this.draw();
  }

  // The newest list; null: there is none.
  get list() {
    const { drones, listed } = this.connection;
    return drones && performance.now() - listed < this.connection.ages.drones[0] ? drones : null;
  }

  show(view) {
    const now = performance.now();
    if (view.drone && view.drone !== this.drone) {
      if (this.drone) {
        [this.left, this.changedAt, this.going] = [this.drone, now, ""];
        this.toggle(false);
      }
      this.drone = view.drone;
    }
    if (this.connection.picture) [this.going, this.goingAt] = [view.change ?? "", now];
    this.draw();
    const words = this.words(now);
    put($("change"), words);
    $("change").hidden = !words;
  }

  words(now) {
    if (this.going && now - this.goingAt < CHANGING_MS) return this.going;
    if (now - this.changedAt > TOLD_MS) return "";
    const left = this.list?.flown === this.drone && this.list.left;
    return `this page shows ${this.drone} now${left ? ` · ${left}` : ""}`;
  }

  draw() {
    const list = this.list, open = this.open && Boolean(list);
    $("list").hidden = !list;
    $("list").setAttribute("aria-expanded", String(open));
    put($("list"), list ? `Drones: ${list.drones.length + (list.more ?? 0)}` : "Drones");
    $("drones").hidden = !open;
    document.body.classList.toggle("choosing", open);
    if (open) this.fill(list);
  }

  // Rows stay the same elements while their texts change: a finger may be on one.
  fill(list) {
    for (const drone of list.drones) this.row(drone, list.flown);
    const names = list.drones.map((drone) => drone.name);
    if (names.join() !== this.names) {
      this.names = names.join();
      for (const name of this.rows.keys()) if (!names.includes(name)) this.rows.delete(name);
      $("drones").querySelector("ul").replaceChildren(...names.map((name) => this.rows.get(name).line));
    }
    put($("more"), list.more ? `and ${list.more} more, which are not listed` : "");
    $("more").hidden = !list.more;
    this.confirm(list);
  }

  row(drone, flown) {
    if (!this.rows.has(drone.name)) this.rows.set(drone.name, this.made(drone.name));
    const { parts, button } = this.rows.get(drone.name);
    const activity = drone.activity ? `${drone.activity}${drone.armed ? ", armed" : ""}`.replaceAll("_", " ") : "";
    put(parts[0], drone.name, "name");
    put(parts[1], drone.vehicle ?? "");
    put(parts[2], activity);
    const here = drone.name === flown ? "shown here" : "";
    const flies = drone.activity ? (drone.pilot ? `${drone.pilot} flies` : "nobody flies") : "";
    put(parts[3], [flies, here].filter(Boolean).join(" · "));
    put(parts[4], [drone.misfit, drone.alarms].filter(Boolean).join("; "), drone.failsafe ? "acts" : "alarm");
    button.hidden = this.connection.watching || Boolean(here);
    button.disabled = Boolean(drone.misfit);
  }

  made(name) {
    const [line, words, button] = ["li", "div", "button"].map((tag) => document.createElement(tag));
    const parts = Array.from({ length: 5 }, () => document.createElement("span"));
    button.textContent = "Fly …";
    button.addEventListener("click", () => { this.wanted = name; this.draw(); });
    words.append(...parts.slice(0, 4));
    line.append(words, button, parts[4]);
    return { line, parts, button };
  }

  confirm(list) {
    const wanted = list.drones.find((drone) => drone.name === this.wanted);
    const flown = list.drones.find((drone) => drone.name === list.flown);
    $("confirm").hidden = !wanted;
    if (!wanted) return;
    const leaves = flown?.armed ? `${list.flown} stays armed: it stops and holds.` : "";
    const waits = wanted.pilot ? `${wanted.pilot} flies ${wanted.name}: you watch until it is free.` : "";
    const [words, yes, no] = $("confirm").children;
    put(words, [`Leave ${list.flown} and fly ${wanted.name}?`, leaves, waits].filter(Boolean).join(" "));
    put(yes, `Fly ${wanted.name}`, "yes");
    put(no, "Stay", "no");
    yes.disabled = Boolean(wanted.misfit);
  }
}

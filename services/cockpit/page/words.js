// Sentences by their keys, in the pilot's language. English has them all: those of events come from
// the event table. What another language lacks is shown in English.

import { units } from "./units.js";

export const LANGUAGES = { en: "English", no: "Norsk", sv: "Svenska", de: "Deutsch", es: "Español", zh: "中文" };

async function read(language) {
  return (await fetch(`words_${language}.json`)).json();
}

class Words {
  constructor(english) {
    this.english = this.own = english;
    this.language = "en";
  }

  async use(language) {
    if (!(language in LANGUAGES)) return;
    this.own = language === "en" ? this.english : await read(language);
    this.language = document.documentElement.lang = language;
    /** @type {NodeListOf<HTMLElement>} */
    const named = document.querySelectorAll("[data-t]");
    for (const element of named) element.textContent = this.t(element.dataset.t);
  }

  t(key, values = {}) {
    const sentence = find(this.own, key) ?? find(this.english, key) ?? key;
    return sentence.replace(/\{(\w+)\}/g, (_, name) => values[name] ?? "–");
  }

  // A sentence that the service says: that of its event is translated, and its details stay.
  said(text, event) {
    const english = find(this.english, event), own = find(this.own, event);
    return english && own ? text.replace(english, () => own) : text;
  }

  // A notice of the drone: its sentence, and in brackets its numbers and what it is about.
  notice({ code, numbers = {}, about = [], more = "" }) {
    const own = Object.entries(numbers), plain = own.map(([name, value]) => [name, units.number(value, Number.isInteger(value) ? 0 : 1)]);
    const amounts = own.filter(([name]) => name in AMOUNTS).map(([name, value]) => AMOUNTS[name](value));
    const rest = [...amounts, ...about.map((each) => this.event(each)), more].filter(Boolean).join(", ");
    return this.t(code, Object.fromEntries(plain)) + (rest ? ` (${rest})` : "");
  }

  // The sentence of an event with its subject, such as a sensor; a service has its name alone.
  event(name) {
    const [kind, subject] = name.split(":");
    return this.t(name) + (subject && !(name in this.english) && kind in this.english ? ` (${subject})` : "");
  }

  // The first camera has a name of ours, the others those of the vehicle file.
  camera(name) { return name === "front" ? this.t("front") : name.replaceAll("_", " "); }
}

// Numbers of a notice that are not in its sentence.
const AMOUNTS = {
  left: (share) => units.share(share), m: (metres) => units.depth(metres, 1), celsius: (c) => units.temperature(c),
  wait_s: (s) => `${units.number(s)} s`, hz: (hz) => `${units.number(hz)}/s`,
};

// By the event's name, or by its kind. A condition has one sentence, whether it acts or not.
function find(sentences, key) {
  const name = key.replace(/^failsafe:(?! )/, "notice:");
  return sentences[name] ?? (name.includes(" ") ? undefined : sentences[name.split(":")[0]]);
}

export const words = new Words(await read("en"));

// Sentences by their keys, in the pilot's language. English has them all: those of events come from
// the event table. What another language lacks is shown in English.

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

  // The first camera has a name of ours, the others those of the vehicle file.
  camera(name) { return name === "front" ? this.t("front") : name.replaceAll("_", " "); }
}

// By the event's name, or by its kind. A condition has one sentence, whether it acts or not.
function find(sentences, key) {
  const name = key.replace(/^failsafe:(?! )/, "notice:");
  return sentences[name] ?? (name.includes(" ") ? undefined : sentences[name.split(":")[0]]);
}

export const words = new Words(await read("en"));

// Alarms that are new are heard and felt, and spoken where the pilot wants it.

const BEEPS = [[0, 880], [0.18, 660], [0.36, 880]]; // [s] from when on, [Hz]
const BEEP_S = 0.14;
const AGAIN_MS = 10000; // an alarm that lasts is heard again
export const LEAK = "leak";

export class Alarms {
  constructor(settings, words) {
    this.settings = settings;
    this.words = words;
    this.audio = null;
    this.since = new Map(); // by name: when it was last heard [ms]
    // Browsers let a page sound once somebody has touched it.
    for (const name of ["pointerdown", "keydown"]) addEventListener(name, () => this.wake(), { once: true, capture: true });
  }

  wake() {
    const Audio = globalThis.AudioContext;
    if (Audio) this.audio ??= new Audio();
  }

  // alarms: code and sentence of every alarm that stands now. The numbers of a sentence may change;
  // it is the same alarm as long as its code is.
  look(alarms, now) {
    const names = alarms.map(([name]) => name);
    for (const known of this.since.keys()) if (!names.includes(known)) this.since.delete(known);
    const due = alarms.filter(([name]) => now - (this.since.get(name) ?? -Infinity) > AGAIN_MS);
    if (!due.length) return;
    const fresh = due.filter(([name]) => !this.since.has(name));
    for (const [name] of due) this.since.set(name, now);
    // Water inside is heard whatever else a pilot has silenced.
    if (this.settings.sound === "on" || due.some(([name]) => name === LEAK)) this.sound();
    if (this.settings.speech === "on") fresh.forEach(([, sentence]) => this.speak(sentence));
  }

  sound() {
    navigator.vibrate?.([200, 100, 200]);
    const { audio } = this;
    if (!audio) return;
    for (const [at, hertz] of BEEPS) {
      const tone = audio.createOscillator(), gain = audio.createGain(), begins = audio.currentTime + at;
      tone.frequency.value = hertz;
      gain.gain.setValueAtTime(0.25, begins);
      gain.gain.exponentialRampToValueAtTime(0.001, begins + BEEP_S);
      tone.connect(gain).connect(audio.destination);
      tone.start(begins);
      tone.stop(begins + BEEP_S);
    }
  }

  speak(sentence) {
    if (!globalThis.speechSynthesis) return;
    const said = new SpeechSynthesisUtterance(sentence);
    said.lang = this.words.language;
    speechSynthesis.speak(said);
  }
}

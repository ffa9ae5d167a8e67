// Numbers as the pilot reads them: units, and digits by his language.

/** @type {Record<string, { length: [number, string], speed: [number, string], temperature: (c: number) => [number, string] }>} */
const SYSTEMS = {
  metric: { length: [1, "m"], speed: [1, "m/s"], temperature: (c) => [c, "°C"] },
  imperial: { length: [1 / 0.3048, "ft"], speed: [1 / 0.3048, "ft/s"], temperature: (c) => [c * 1.8 + 32, "°F"] },
  knots: { length: [1, "m"], speed: [3600 / 1852, "kn"], temperature: (c) => [c, "°C"] },
};
export const UNKNOWN = "–";

class Units {
  system = SYSTEMS.metric;
  language = "en";
  formats = new Map(); // by number of decimals

  use(system, language) {
    this.system = SYSTEMS[system] ?? SYSTEMS.metric;
    this.language = language;
    this.formats.clear();
  }

  number(value, decimals = 0) {
    if (value === undefined || value === null) return UNKNOWN;
    if (!this.formats.has(decimals))
      this.formats.set(decimals, new Intl.NumberFormat(this.language, { minimumFractionDigits: decimals, maximumFractionDigits: decimals, useGrouping: false, signDisplay: "negative" }));
    return this.formats.get(decimals).format(value);
  }

  get lengthUnit() { return this.system.length[1]; }

  // [m] to what is shown, and back.
  length(metres) { return metres === undefined ? undefined : metres * this.system.length[0]; }

  metres(length) { return length / this.system.length[0]; }

  // undefined: not known.
  depth(metres, decimals = 2) { return metres === undefined ? undefined : `${this.number(this.length(metres), decimals)} ${this.lengthUnit}`; }

  share(value) { return `${this.number(100 * value)} %`; }

  bearing(degrees, digits = 1) { return `${this.number(Math.round(degrees) % 360).padStart(digits, "0")}°`; }

  speed(value) { return `${this.number(value * this.system.speed[0], 2)} ${this.system.speed[1]}`; }

  temperature(celsius) {
    const [value, unit] = this.system.temperature(celsius);
    return `${this.number(value)} ${unit}`;
  }

  ms(value) { return value === undefined ? UNKNOWN : `${this.number(value, value < 9.95 ? 1 : 0)} ms`; }

  // [ms] In seconds from one on.
  age(value) {
    if (value === undefined) return UNKNOWN;
    return value < 995 ? `${this.number(value)} ms` : `${this.number(value / 1000, 1)} s`;
  }

  time(seconds) {
    if (seconds === undefined || seconds === null) return UNKNOWN;
    const two = (n) => String(Math.floor(n)).padStart(2, "0");
    const hours = Math.floor(seconds / 3600);
    return `${hours ? `${hours}:` : ""}${two((seconds / 60) % 60)}:${two(seconds % 60)}`;
  }
}

export const units = new Units();

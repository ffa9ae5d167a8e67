// The service's clock, as far as it can be known from here: texts say when they were sent, and the
// fastest of the last seconds took half of the shortest way there and back.

const SPAN_MS = 3000;

export class ServiceClock {
  constructor() { this.forget(); }

  forget() { this.heard = []; }

  // sent: [ms] by the service's clock; arrived: [ms] by this page's; delay: [ms] there and back, or undefined
  learn(sent, arrived, delay) {
    this.heard.push({ arrived, apart: arrived - sent, delay: delay ?? Infinity });
    while (this.heard[0].arrived < arrived - SPAN_MS) this.heard.shift();
    const least = (of) => this.heard.reduce((a, b) => Math.min(a, of(b)), Infinity);
    const delays = least((h) => h.delay);
    this.apart = least((h) => h.apart) - (delays < Infinity ? delays / 2 : 0);
  }

  // [ms] How old something is that happened at this moment of the service's clock; undefined: not known.
  age(moment) {
    if (!this.heard.length) return undefined;
    return Math.max(0, performance.now() - this.apart - moment);
  }
}

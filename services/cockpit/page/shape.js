// From a stick's travel to a command.

// Share of full speed at full stick: the pilot's limit, less while slow is held, all while boost is; both
// 0 … 1, and continuous, so that a trigger causes no jump.
export function level(limit, slow, boost) {
  return Math.min(1, limit + boost * (1 - limit) - slow * limit * 0.6);
}

// Odd, monotonic, 0 inside the dead-band, continuous at its edge, ±1 at full travel; NaN is 0.
export function shape(travel, deadBand, expo) {
  const beyond = (Math.min(Math.abs(travel), 1) - deadBand) / (1 - deadBand);
  if (!(beyond > 0)) return 0;
  return Math.sign(travel) * beyond * (1 - expo * (1 - beyond * beyond));
}

const STEPS = [0, 0.25, 0.5, 0.75, 1]; // of a dimmer

// The next step up or down; undefined: there is none.
export function stepped(now, way) {
  return way > 0 ? STEPS.find((each) => each > (now ?? 0) + 0.01) : STEPS.findLast((each) => each < (now ?? 0) - 0.01);
}

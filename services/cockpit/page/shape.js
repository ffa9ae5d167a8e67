// From a stick's travel to a command.

export const GAINS = { Slow: 0.25, Normal: 0.6, Boost: 1.0 };

// Odd, monotonic, 0 inside the dead-band, continuous at its edge, ±1 at full travel; NaN is 0.
export function shape(travel, deadBand, expo) {
  const beyond = (Math.min(Math.abs(travel), 1) - deadBand) / (1 - deadBand);
  if (!(beyond > 0)) return 0;
  return Math.sign(travel) * beyond * (1 - expo * (1 - beyond * beyond));
}

// Where the picture lies on the screen. It fills it; for that at most a fifth of it is cut off, so
// that where the shapes differ more, as on a phone that is held upright, it has a margin.

const CUT = 1.25; // so much larger than a picture that is whole
const SHAPE = 16 / 9; // where there is no picture

let styled = null, style = ""; // the canvas that was placed last, and how

// Returns where its optical axis is [px], and how many pixels a radian is there.
// stripe: rows [px] at its top that are for machines; free: from and to [px] what covers little
export function placePicture(canvas, { stripe, fov, whole, free }) {
  const W = innerWidth, H = innerHeight, seen = !canvas.hidden;
  const width = seen ? canvas.width : SHAPE, height = seen ? canvas.height - stripe : 1;
  const contain = Math.min(W / width, H / height), cover = Math.max(W / width, H / height);
  const scale = whole ? contain : Math.min(cover, contain * CUT);
  const w = width * scale, h = height * scale, left = (W - w) / 2;
  const middle = (free[0] + free[1] - h) / 2; // between what lies above and below
  const top = h < H ? Math.max(0, Math.min(middle, H - h)) : (H - h) / 2;
  const above = seen ? stripe * scale : 0;
  const wanted = `left:${left}px;top:${top - above}px;width:${w}px;height:${h + above}px;clip-path:inset(${above}px 0 0 0)`;
  if (seen && (canvas !== styled || wanted !== style)) [styled, style, canvas.style.cssText] = [canvas, wanted, wanted];
  return { x: W / 2, y: top + h / 2 - (seen ? (stripe * scale) / 2 : 0), perRadian: w / 2 / Math.tan((fov * Math.PI) / 360) };
}

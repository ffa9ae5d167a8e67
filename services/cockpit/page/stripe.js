// The simulated picture has its time in 64 black or white blocks at its top, for machines. Nobody
// flies by them, so they are not shown. Other cameras' pictures have none.

const COLUMNS = 32, ROWS = 2, WIDTH = 16, HEIGHT = 8; // blocks, and their size [px]
const BLACK = 80, WHITE = 175;

// How many rows [px] of a picture are such a stripe, with those that the codec blurs into it.
export function stripeRows(frame) {
  const width = COLUMNS * WIDTH, height = ROWS * HEIGHT;
  if (frame.displayWidth < width || frame.displayHeight < 4 * height) return 0;
  const g = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
  g.drawImage(frame, 0, 0, width, height, 0, 0, width, height);
  const { data } = g.getImageData(0, 0, width, height);
  let black = 0, white = 0;
  for (let row = 0; row < ROWS; row++)
    for (let column = 0; column < COLUMNS; column++) {
      const level = data[4 * ((row + 0.5) * HEIGHT * width + (column + 0.5) * WIDTH)];
      black += level < BLACK;
      white += level > WHITE;
    }
  return black && white && black + white === COLUMNS * ROWS ? height + 2 : 0;
}

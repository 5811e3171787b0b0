// Pictures as numbers, and the differences of two.

const OPAQUE = 0.9; // of both pictures' coverage, where a difference counts
const COLOURS = [[16, 14, 40], [92, 28, 110], [186, 54, 85], [242, 129, 38], [252, 240, 150]]; // from 0 to the scale's end

export const scaleColours = `linear-gradient(90deg, ${COLOURS.map((c) => `rgb(${c.join(" ")})`).join(", ")})`;

/** The stored values of a picture, [0, 1]; transparent ones are as they are, unless `white` is put behind. */
export async function read(image, white) {
  await image.decode();
  const { naturalWidth: width, naturalHeight: height } = image;
  const canvas = Object.assign(document.createElement("canvas"), { width, height });
  const context = canvas.getContext("2d", { willReadFrequently: true });
  if (white) {
    context.fillStyle = "#fff";
    context.fillRect(0, 0, width, height);
  }
  context.drawImage(image, 0, 0);
  const pixels = context.getImageData(0, 0, width, height).data;
  return { width, height, pixels };
}

/** What a picture says at a pixel: [r, g, b] in [0, 1], a unit normal, or one number; null where it is transparent. */
export function valueAt({ pixels, width }, x, y, kind) {
  const place = 4 * (y * width + x);
  if (pixels[place + 3] / 255 <= OPAQUE) return null;
  const colour = [0, 1, 2].map((i) => pixels[place + i] / 255);
  if (kind === "number") return [colour[0]];
  if (kind === "colour") return colour;
  const normal = colour.map((value) => 2 * value - 1);
  const length = Math.hypot(...normal);
  return normal.map((value) => value / Math.max(length, 1e-6));
}

/** The difference of two values: the angle in degrees of normals, the mean of the channels' differences otherwise. */
export function difference(first, second, kind) {
  if (!first || !second) return null;
  if (kind === "normal") {
    const dot = first.reduce((sum, value, i) => sum + value * second[i], 0);
    return (Math.acos(Math.min(1, Math.max(-1, dot))) * 180) / Math.PI;
  }
  return first.reduce((sum, value, i) => sum + Math.abs(value - second[i]), 0) / first.length;
}

/** Paints the differences of two pictures; returns their mean where both have a value, null where none is. */
export function paint(canvas, left, right, kind, largest) {
  const [width, height] = [left.width, left.height];
  Object.assign(canvas, { width, height });
  const picture = new ImageData(width, height);
  let [sum, count] = [0, 0];
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      const error = difference(valueAt(left, x, y, kind), valueAt(right, x, y, kind), kind);
      if (error === null) continue;
      sum += error;
      count += 1;
      picture.data.set([...colourOf(error / largest), 255], 4 * (y * width + x));
    }
  }
  canvas.getContext("2d").putImageData(picture, 0, 0);
  return count ? sum / count : null;
}

function colourOf(share) {
  const place = Math.min(share, 1) * (COLOURS.length - 1);
  const node = Math.min(Math.floor(place), COLOURS.length - 2);
  return COLOURS[node].map((value, i) => Math.round(value + (place - node) * (COLOURS[node + 1][i] - value)));
}

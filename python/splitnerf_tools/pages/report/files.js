// Lights in files of the page's reader: nothing but the page itself reads them.
import { EXRLoader } from "three/examples/jsm/loaders/EXRLoader.js";
import { HDRLoader } from "three/examples/jsm/loaders/HDRLoader.js";

const LOADERS = { hdr: HDRLoader, exr: EXRLoader };
const [NOT_FINITE, SIGN] = [0x7c00, 0x8000]; // of halves: the exponent of infinities and of what is no number; the sign

/** A light, { name, width, height, content, note }, of an .hdr or .exr file; content are halves as of view/halves.js. */
export async function lightOf(file) {
  const kind = file.name.split(".").pop().toLowerCase();
  if (!(kind in LOADERS)) throw new Error(`${file.name}: is no .hdr or .exr file`);
  let read;
  try {
    read = new LOADERS[kind]().parse(await file.arrayBuffer());
  } catch (error) {
    throw new Error(`${file.name}: ${error.message ?? error}`);
  }
  const { data, width, height } = read;
  if (data.length !== 4 * width * height) throw new Error(`${file.name}: has no red, green and blue`);
  if (width !== 2 * height) throw new Error(`${file.name}: is ${width}x${height}; an equirectangular map is twice as wide as high`);
  if (data.some((code) => (code & NOT_FINITE) === NOT_FINITE)) throw new Error(`${file.name}: has pixels that are not finite`);
  const note = data.some((code) => code > SIGN) ? "Its negative radiance is shown as 0." : "";
  for (let i = 0; i < data.length; i++) if (data[i] & SIGN) data[i] = 0;
  return { name: file.name, width, height, note, content: kind === "exr" ? fromTop(data, 4 * width) : data };
}

/** Rows that begin at the bottom, from the top. */
function fromTop(data, row) {
  const turned = new Uint16Array(data.length);
  for (let at = 0; at < data.length; at += row) turned.set(data.subarray(at, at + row), data.length - row - at);
  return turned;
}

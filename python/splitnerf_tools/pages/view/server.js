// What the page asks its server. All addresses are relative: the token in the page's own address goes with them.
import { asLight, halves } from "./halves.js";

/** The server is not there, or went while it answered: what was asked may be asked again. */
export class Lost extends Error {}

/** The answer to a request; an Error with the server's one line where it refuses. */
async function asked(address, options) {
  let answer;
  try {
    answer = await fetch(address, options);
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Lost("splitnerf does not answer; is the command still running?");
  }
  if (answer.ok) return answer;
  const said = await answer.json().catch(() => ({}));
  throw new Error(said.error ?? `the server answers ${answer.status}`);
}

/** What `read` makes of the rest of an answer. */
async function rest(read, signal) {
  try {
    return await read();
  } catch (error) {
    if (signal?.aborted) throw error;
    throw new Lost("the connection broke off; what was missing is asked for again once splitnerf answers");
  }
}

const bodyOf = async (address, kind) => {
  const answer = await asked(address);
  return rest(() => answer[kind]());
};

export const readScene = () => bodyOf("scene.json", "json");
export const readAsset = (number) => bodyOf(`assets/${number}`, "arrayBuffer");
export const readPhoto = (number) => bodyOf(`photos/${number}`, "blob");
export const readCurves = (first) => bodyOf(`curves/${first}`, "json");

/** Presses a button of the run that trains. */
export const press = (button) => asked(`control/${button}`, { method: "POST" });

export const readLight = async (number) => asLight(await readHalves(`lights/${number}`));

/** Sends the bytes of a light; the server reads them and answers with the light's number. */
export async function sendLight(file) {
  const answer = await asked(`lights?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file });
  return (await answer.json()).number;
}

/** Asks for path-traced pictures of a camera, and tells `arrived` each one: { asset, spp, texture }. */
export async function streamPictures(camera, signal, arrived) {
  const answer = await asked("final", { method: "POST", body: camera, signal });
  const reader = answer.body.getReader();
  let bytes = new Uint8Array(0);
  for (;;) {
    const { value, done } = await rest(() => reader.read(), signal);
    if (done) return;
    bytes = joined(bytes, value);
    for (let picture; (picture = firstPicture(bytes)); bytes = picture.rest) arrived(picture);
  }
}

const HEAD = 20; // bytes: five whole numbers

/** The picture that bytes begin with, and what follows it; null where it is not complete. */
function firstPicture(bytes) {
  if (bytes.length < HEAD) return null;
  const view = new DataView(bytes.buffer, bytes.byteOffset);
  const [asset, width, height, spp, length] = [0, 4, 8, 12, 16].map((place) => view.getUint32(place, true));
  if (bytes.length < HEAD + length) return null;
  const texture = halves(bytes.slice(HEAD, HEAD + length).buffer, width, height);
  return { asset, spp, texture, rest: bytes.subarray(HEAD + length) };
}

function joined(first, second) {
  const both = new Uint8Array(first.length + second.length);
  both.set(first);
  both.set(second, first.length);
  return both;
}

async function readHalves(address) {
  const answer = await asked(address);
  const [width, height] = answer.headers.get("Picture-Size").split("x").map(Number);
  return halves(await rest(() => answer.arrayBuffer()), width, height);
}

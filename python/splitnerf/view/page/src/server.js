// What the page asks its server. All addresses are relative: the token in the page's own address goes with them.
import { asLight, halves } from "./halves.js";

/** The answer to a request; an Error with the server's one line where it refuses. */
async function asked(address, options) {
  let answer;
  try {
    answer = await fetch(address, options);
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Error("the server does not answer; is splitnerf view still running?");
  }
  if (answer.ok) return answer;
  const said = await answer.json().catch(() => ({}));
  throw new Error(said.error ?? `the server answers ${answer.status}`);
}

export const readScene = async () => (await asked("scene.json")).json();
export const readAsset = async (number) => (await asked(`assets/${number}`)).arrayBuffer();
export const readPhoto = async (number) => (await asked(`photos/${number}`)).blob();

export const readLight = async (number) => asLight(await readHalves(`lights/${number}`));

/** The deviations in the asset's texture coordinates, whose v runs from the top. */
export const readDeviations = (number) => readHalves(`deviations/${number}`);

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
    const { value, done } = await reader.read();
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
  return halves(await answer.arrayBuffer(), width, height);
}

// What the page asks its server. All addresses are relative: the token in the page's own address goes with them.
import * as THREE from "three";

/** The answer to a request; an Error with the server's one line where it refuses. */
async function asked(address, options) {
  let answer;
  try {
    answer = await fetch(address, options);
  } catch {
    throw new Error("the server does not answer; is splitnerf view still running?");
  }
  if (answer.ok) return answer;
  const said = await answer.json().catch(() => ({}));
  throw new Error(said.error ?? `the server answers ${answer.status}`);
}

export const readScene = async () => (await asked("scene.json")).json();
export const readAsset = async (number) => (await asked(`assets/${number}`)).arrayBuffer();

/** A light [h, w] as three's equirectangular texture. three's y-up directions meet the texels as in docs/data.md. */
export async function readLight(number) {
  const texture = await readHalves(`lights/${number}`);
  texture.mapping = THREE.EquirectangularReflectionMapping;
  texture.flipY = true; // three's v runs from the bottom, the rows from the top
  return texture;
}

/** The deviations in the asset's texture coordinates, whose v runs from the top. */
export const readDeviations = (number) => readHalves(`deviations/${number}`);

/** Sends the bytes of a light; the server reads them and answers with the light's number. */
export async function sendLight(file) {
  const answer = await asked(`lights?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file });
  return (await answer.json()).number;
}

async function readHalves(address) {
  const answer = await asked(address);
  const [width, height] = answer.headers.get("Picture-Size").split("x").map(Number);
  const texture = new THREE.DataTexture(new Uint16Array(await answer.arrayBuffer()), width, height, THREE.RGBAFormat, THREE.HalfFloatType);
  texture.minFilter = texture.magFilter = THREE.LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

// Pictures of 16-bit floats, red, green, blue, alpha, row by row from the top, as three's textures; and the curve of a screen.
import * as THREE from "three";

export function halves(buffer, width, height) {
  const texture = new THREE.DataTexture(new Uint16Array(buffer), width, height, THREE.RGBAFormat, THREE.HalfFloatType);
  texture.minFilter = texture.magFilter = THREE.LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

/** A light [h, w] as three's equirectangular texture. three's y-up directions meet the texels as in docs/data.md. */
export function asLight(texture) {
  texture.mapping = THREE.EquirectangularReflectionMapping;
  texture.flipY = true; // three's v runs from the bottom, the rows from the top
  return texture;
}

/** The sRGB curve of linear light, clipped to [0, 1] (IEC 61966-2-1). */
export function encoded(linear) {
  const clipped = Math.min(Math.max(linear, 0), 1);
  return clipped <= 0.0031308 ? 12.92 * clipped : 1.055 * clipped ** (1 / 2.4) - 0.055;
}

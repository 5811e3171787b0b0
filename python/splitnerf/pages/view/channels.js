// What is shown of a surface: three's shading, or one of its maps instead.
import * as THREE from "three";

export const CHANNELS = ["shaded", "albedo", "roughness", "metallic", "normals", "uncertainty"];
const STRIPE = 3; // pixels, as in the report

const DECLARED = /* glsl */ `
uniform int channel;
uniform int quantity;
uniform vec4 unknown;
uniform vec3 knownColours[4];
uniform vec3 unknownColours[2];
uniform sampler2D deviations;

// The report's colours of a deviation: a scale from dark to bright, and stripes where it is unknown.
vec3 colourOf(float share) {
  if (share > 1.0) return unknownColours[int(floor((gl_FragCoord.x + gl_FragCoord.y) / ${STRIPE}.0)) % 2];
  float place = share * 3.0;
  int node = min(int(place), 2);
  return mix(knownColours[node], knownColours[node + 1], place - float(node));
}
`;

// After three's tone mapping and sRGB curve: maps are shown as they are. Normals are those of the world, z up.
const SHOWN = /* glsl */ `
if (channel == 1) gl_FragColor = sRGBTransferOETF(vec4(diffuseColor.rgb, 1.0));
if (channel == 2) gl_FragColor = vec4(vec3(roughnessFactor), 1.0);
if (channel == 3) gl_FragColor = vec4(vec3(metalnessFactor), 1.0);
if (channel == 4) gl_FragColor = vec4(0.5 * (inverse(mat3(viewMatrix)) * normal) + 0.5, 1.0);
#ifdef USE_MAP
if (channel == 5) gl_FragColor = vec4(colourOf(texture2D(deviations, vMapUv)[quantity] / unknown[quantity]), 1.0);
#endif
`;

/** The numbers that all materials of an asset share. */
export function channelUniforms(uncertainty) {
  const colours = (rows) => rows.map((row) => new THREE.Vector3(...row));
  return {
    channel: { value: 0 },
    quantity: { value: 0 },
    unknown: { value: new THREE.Vector4(...uncertainty.unknown) },
    knownColours: { value: colours(uncertainty.known_colours) },
    unknownColours: { value: colours(uncertainty.unknown_colours) },
    deviations: { value: null },
  };
}

/** The material that draws what our path tracer draws of a GLB's material, and its maps on demand. */
export function withChannels(material, uniforms) {
  if (!material.isMeshStandardMaterial) {
    const { map, color, side, vertexColors } = material; // an unlit one: the tracer lights it too
    material = new THREE.MeshStandardMaterial({ map, color, side, vertexColors, metalness: 0 });
  }
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, uniforms);
    shader.fragmentShader = shader.fragmentShader
      .replace("#include <common>", `#include <common>\n${DECLARED}`)
      .replace("#include <colorspace_fragment>", `#include <colorspace_fragment>\n${SHOWN}`);
  };
  return material;
}

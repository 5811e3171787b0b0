// What is shown of a surface: three's shading, or one of its maps instead.
import * as THREE from "three";

export const CHANNELS = ["shaded", "albedo", "roughness", "metallic", "normals"];

// After three's tone mapping and sRGB curve: maps are shown as they are. Normals are those of the world, z up.
const SHOWN = /* glsl */ `
if (channel == 1) gl_FragColor = sRGBTransferOETF(vec4(diffuseColor.rgb, 1.0));
if (channel == 2) gl_FragColor = vec4(vec3(roughnessFactor), 1.0);
if (channel == 3) gl_FragColor = vec4(vec3(metalnessFactor), 1.0);
if (channel == 4) gl_FragColor = vec4(0.5 * (inverse(mat3(viewMatrix)) * normal) + 0.5, 1.0);
`;

/** The material that draws what our path tracer draws of a GLB's material, and its maps on demand. */
export function withChannels(material, uniforms) {
  if (!material.isMeshStandardMaterial) {
    const { map, color, side, vertexColors } = material; // an unlit one: the tracer lights it too
    material = new THREE.MeshStandardMaterial({ map, color, side, vertexColors, metalness: 0 });
  }
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, uniforms);
    shader.fragmentShader = shader.fragmentShader
      .replace("#include <common>", "#include <common>\nuniform int channel;")
      .replace("#include <colorspace_fragment>", `#include <colorspace_fragment>\n${SHOWN}`);
  };
  return material;
}

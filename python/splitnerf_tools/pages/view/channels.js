// What is shown of a surface: three's shading, or one of its maps instead.
import * as THREE from "three";

export const CHANNELS = ["shaded", "albedo", "roughness", "metallic", "normals", "occlusion"];

// After three's tone mapping and sRGB curve: maps are shown as they are. Normals are those of the world, z up.
const SHOWN = /* glsl */ `
if (channel == 1) gl_FragColor = sRGBTransferOETF(vec4(diffuseColor.rgb, 1.0));
if (channel == 2) gl_FragColor = vec4(vec3(roughnessFactor), 1.0);
if (channel == 3) gl_FragColor = vec4(vec3(metalnessFactor), 1.0);
if (channel == 4) gl_FragColor = vec4(0.5 * (inverse(mat3(viewMatrix)) * normal) + 0.5, 1.0);
#ifndef USE_AOMAP
float ambientOcclusion = 1.0;
#endif
if (channel == 5) gl_FragColor = vec4(vec3(ambientOcclusion), 1.0);
`;

// The whole texture, its first row at the top, in place of what the camera sees. It is seen from behind, as v runs down.
const UNFOLDED = /* glsl */ `
if (unfolded) gl_Position = vec4((vec2(2.0, -2.0) * uv + vec2(-1.0, 1.0)) * stretch, 0.0, 1.0);
`;
const facing = (chunk) => THREE.ShaderChunk[chunk].replaceAll("gl_FrontFacing", "(gl_FrontFacing != unfolded)");

/** The material that draws what our path tracer draws of a GLB's material, and its maps on demand. */
export function withChannels(material, uniforms) {
  if (!material.isMeshStandardMaterial) {
    const { map, color, side, vertexColors } = material; // an unlit one: the tracer lights it too
    material = new THREE.MeshStandardMaterial({ map, color, side, vertexColors, metalness: 0 });
  }
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, uniforms);
    shader.vertexShader = shader.vertexShader
      .replace("#include <common>", "#include <common>\nuniform bool unfolded;\nuniform vec2 stretch;")
      .replace("#include <project_vertex>", `#include <project_vertex>\n${UNFOLDED}`);
    shader.fragmentShader = shader.fragmentShader
      .replace("#include <common>", "#include <common>\nuniform int channel;\nuniform bool unfolded;")
      .replace("#include <normal_fragment_begin>", facing("normal_fragment_begin"))
      .replace("#include <colorspace_fragment>", `#include <colorspace_fragment>\n${SHOWN}`);
  };
  return material;
}

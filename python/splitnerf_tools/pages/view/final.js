// "Final": the server's path tracer draws what the page shows, better and better until something moves.
import * as THREE from "three";
import { streamPictures } from "./server.js";

const QUIET = 150; // milliseconds without movement before a request
const LARGEST = 1024; // pixels of a picture's longer side

const NOISY = 128; // paths a pixel from which on a picture is shown as it is
// Linear, premultiplied radiance, through the same tone mapping as three's own picture. The noise of few paths is taken out by the
// middle one of 3 x 3 pixels, channel by channel, which keeps edges: it stands where four of the nine are smaller.
const SHADERS = {
  vertexShader: /* glsl */ `varying vec2 place; void main() { place = uv; gl_Position = vec4(position.xy, 0.0, 1.0); }`,
  fragmentShader: /* glsl */ `
    uniform sampler2D picture;
    uniform bool denoise;
    varying vec2 place;
    vec4 straight(vec2 offset) {
      vec4 radiance = texture2D(picture, vec2(place.x, 1.0 - place.y) + offset / vec2(textureSize(picture, 0)));
      return vec4(radiance.rgb / max(radiance.a, 1e-4), radiance.a);
    }
    void main() {
      gl_FragColor = straight(vec2(0.0));
      if (denoise) {
        vec4 near[9];
        for (int i = 0; i < 9; i++) near[i] = straight(vec2(i % 3 - 1, i / 3 - 1));
        for (int i = 0; i < 9; i++) {
          vec4 smaller = vec4(0.0);
          for (int j = 0; j < 9; j++) smaller += vec4(lessThan(near[j], near[i])) + (j < i ? vec4(equal(near[j], near[i])) : vec4(0.0));
          gl_FragColor = mix(gl_FragColor, near[i], vec4(equal(smaller, vec4(4.0))));
        }
      }
      #include <tonemapping_fragment>
      #include <colorspace_fragment>
    }`,
};

/** A picture that fills its part of the window. */
export class Plate {
  constructor() {
    this.material = new THREE.ShaderMaterial({ ...SHADERS, uniforms: { picture: { value: null }, denoise: { value: false } }, transparent: true, depthTest: false });
    this.mesh = new THREE.Mesh(new THREE.PlaneGeometry(2, 2), this.material);
    this.mesh.frustumCulled = false;
  }

  set(texture, paths) {
    this.paths = paths;
    this.material.uniforms.picture.value?.dispose();
    this.material.uniforms.picture.value = texture;
  }

  render(renderer, camera, denoise) {
    this.material.uniforms.denoise.value = denoise && this.paths < NOISY;
    renderer.render(this.mesh, camera);
  }
}

export class Final {
  /** `say` gets a line about the picture, `numbers` tells each asset's light. */
  constructor(viewer, numbers, say, failed) {
    Object.assign(this, { viewer, numbers, say, failed, on: false });
    viewer.addEventListener("drawn", () => this.follow());
  }

  set(on) {
    if (on === this.on) return;
    this.on = on;
    this.say("");
    this.stop();
    this.viewer.draw();
  }

  stop() {
    clearTimeout(this.timer);
    this.request?.abort();
    this.asked = undefined;
    for (const view of this.viewer.views) view.setPicture(null);
  }

  /** After each drawing: what the page shows now is asked for, where it is not what was asked for last. */
  follow() {
    if (!this.on) return;
    const wanted = JSON.stringify(this.camera());
    if (wanted === this.asked) return;
    this.stop();
    this.asked = wanted;
    this.viewer.draw();
    const { channel, wireframe, unfolded } = this.viewer.values;
    if (channel === 0 && !wireframe && !unfolded) this.timer = setTimeout(() => this.ask(wanted), QUIET);
  }

  camera() {
    const [, , width, height] = this.viewer.boxes[0];
    const scale = Math.min(1, LARGEST / Math.max(width, height));
    const [across, up] = [Math.max(1, Math.round(scale * width)), Math.max(1, Math.round(scale * height))];
    const pose = this.viewer.camera.matrixWorld.clone().transpose().elements; // row by row
    const { turn, channel, wireframe, unfolded, paths } = this.viewer.values;
    const ground = this.viewer.views[0].casts(this.viewer.through);
    const versions = this.viewer.views.map((view) => view.version); // a new asset is traced anew
    return { pose, intrinsics: this.viewer.intrinsics(across, up), width: across, height: up, turn, lights: this.numbers(), ground, paths: Number(paths), shown: [channel, wireframe, unfolded], versions };
  }

  async ask(wanted) {
    const request = (this.request = new AbortController());
    this.say("path tracing …");
    try {
      await streamPictures(wanted, request.signal, ({ asset, spp, texture }) => {
        this.viewer.views[asset].setPicture(texture, spp);
        this.say(`path traced, ${spp} ${spp === 1 ? "path" : "paths"} a pixel`);
        this.viewer.draw();
      });
    } catch (error) {
      if (!request.signal.aborted) this.failed(error);
    }
  }
}

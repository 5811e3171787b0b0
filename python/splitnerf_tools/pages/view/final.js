// "Final": the server's path tracer draws what the page shows, better and better until something moves.
import * as THREE from "three";
import { streamPictures } from "./server.js";

const QUIET = 150; // milliseconds without movement before a request
const LARGEST = 1024; // pixels of a picture's longer side

// Linear, premultiplied radiance, through the same tone mapping as three's own picture.
const SHADERS = {
  vertexShader: /* glsl */ `varying vec2 place; void main() { place = uv; gl_Position = vec4(position.xy, 0.0, 1.0); }`,
  fragmentShader: /* glsl */ `
    uniform sampler2D picture;
    varying vec2 place;
    void main() {
      vec4 radiance = texture2D(picture, vec2(place.x, 1.0 - place.y));
      gl_FragColor = vec4(radiance.rgb / max(radiance.a, 1e-4), radiance.a);
      #include <tonemapping_fragment>
      #include <colorspace_fragment>
    }`,
};

/** A picture that fills its part of the window. */
export class Plate {
  constructor() {
    this.material = new THREE.ShaderMaterial({ ...SHADERS, uniforms: { picture: { value: null } }, transparent: true, depthTest: false });
    this.mesh = new THREE.Mesh(new THREE.PlaneGeometry(2, 2), this.material);
    this.mesh.frustumCulled = false;
  }

  set(texture) {
    this.material.uniforms.picture.value?.dispose();
    this.material.uniforms.picture.value = texture;
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
    if (this.viewer.values.channel === 0) this.timer = setTimeout(() => this.ask(wanted), QUIET);
  }

  camera() {
    const [, , width, height] = this.viewer.boxes[0];
    const scale = Math.min(1, LARGEST / Math.max(width, height));
    const [across, up] = [Math.max(1, Math.round(scale * width)), Math.max(1, Math.round(scale * height))];
    const pose = this.viewer.camera.matrixWorld.clone().transpose().elements; // row by row
    const { turn, channel } = this.viewer.values;
    const versions = this.viewer.views.map((view) => view.version); // a new asset is traced anew
    return { pose, intrinsics: this.viewer.intrinsics(across, up), width: across, height: up, turn, lights: this.numbers(), channel, versions };
  }

  async ask(wanted) {
    const request = (this.request = new AbortController());
    this.say("path tracing …");
    try {
      await streamPictures(wanted, request.signal, ({ asset, spp, texture }) => {
        this.viewer.views[asset].setPicture(texture);
        this.say(`path traced, ${spp} ${spp === 1 ? "path" : "paths"} a pixel`);
        this.viewer.draw();
      });
    } catch (error) {
      if (!request.signal.aborted) this.failed(error);
    }
  }
}

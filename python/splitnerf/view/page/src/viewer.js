// The picture: one scene an asset, side by side, with one camera. The world is the data's, z up.
import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { channelUniforms, withChannels } from "./channels.js";

const Z_UP = Math.PI / 2; // about x: from the y up of GLB files and of three's lights
const PLAIN = new THREE.Color(0x8f9296);
const TONES = { none: THREE.LinearToneMapping, aces: THREE.ACESFilmicToneMapping }; // linear: exposure alone

export class Viewer {
  constructor(canvas, description) {
    this.canvas = canvas;
    this.start = description.camera;
    this.halfField = description.camera.half_field;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
    this.renderer.autoClear = false;
    this.camera = new THREE.PerspectiveCamera();
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => this.draw());
    this.views = description.sources.map(() => new View(description.uncertainty));
    this.home();
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  /** The camera of `splitnerf relight`: the object's front, from 20 degrees above. */
  home() {
    const { position, target, radius } = this.start;
    this.camera.position.set(...position);
    this.controls.target.set(...target);
    this.controls.minDistance = 1.02 * 0.1 * radius;
    this.controls.maxDistance = 50 * radius;
    this.controls.update();
    this.draw();
  }

  /** Turns the camera about the object, by radians, and moves it nearer by a factor. */
  move(azimuth, elevation, nearer = 1) {
    const arm = new THREE.Spherical();
    const toYUp = new THREE.Quaternion().setFromUnitVectors(this.camera.up, new THREE.Vector3(0, 1, 0));
    const offset = this.camera.position.clone().sub(this.controls.target).applyQuaternion(toYUp);
    arm.setFromVector3(offset);
    arm.theta += azimuth;
    arm.phi -= elevation;
    arm.radius = Math.min(Math.max(arm.radius * nearer, this.controls.minDistance), this.controls.maxDistance);
    offset.setFromSpherical(arm.makeSafe()).applyQuaternion(toYUp.invert());
    this.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
    this.draw();
  }

  /** Sets what all assets share: the names are those of the panel's fields. */
  set({ channel, quantity, turn, exposure, tone, background, blur }) {
    this.renderer.toneMapping = TONES[tone];
    this.renderer.toneMappingExposure = 2 ** exposure;
    for (const view of this.views) {
      view.uniforms.channel.value = channel;
      view.uniforms.quantity.value = quantity;
      view.setBackground(background && channel === 0, blur);
      view.turnLight((turn * Math.PI) / 180);
    }
    this.draw();
  }

  /** Asks for a picture; it is drawn with the screen's next one. */
  draw() {
    this.asked ??= requestAnimationFrame(() => {
      this.asked = undefined;
      this.drawNow();
    });
  }

  drawNow() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    const size = this.renderer.getSize(new THREE.Vector2());
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    if (size.x !== width || size.y !== height) this.renderer.setSize(width, height, false);
    this.setLens(width / this.views.length / height);
    this.renderer.setScissorTest(true);
    this.views.forEach((view, i) => {
      const box = [(i * width) / this.views.length, 0, width / this.views.length, height];
      this.renderer.setViewport(...box);
      this.renderer.setScissor(...box);
      this.renderer.clear();
      this.renderer.render(view.scene, this.camera);
    });
  }

  /** The field of view of the shorter side is always the same. */
  setLens(aspect) {
    const half = aspect < 1 ? Math.atan(Math.tan(this.halfField) / aspect) : this.halfField;
    const distance = this.camera.position.distanceTo(this.controls.target);
    Object.assign(this.camera, { aspect, fov: (half * 360) / Math.PI });
    this.camera.near = Math.max(distance - 3 * this.start.radius, 0.01 * distance);
    this.camera.far = distance + 100 * this.start.radius;
    this.camera.updateProjectionMatrix();
  }
}

/** One asset in its light. */
class View {
  constructor(uncertainty) {
    this.scene = new THREE.Scene();
    this.uniforms = channelUniforms(uncertainty);
    this.light = null;
    this.setBackground(true, 0);
    this.turnLight(0);
  }

  async setAsset(glb) {
    const { scene } = await new GLTFLoader().parseAsync(glb, "");
    scene.rotation.x = Z_UP;
    scene.traverse((part) => {
      if (part.isMesh) part.material = withChannels(part.material, this.uniforms);
    });
    this.scene.add(scene);
  }

  setLight(texture) {
    this.light?.dispose();
    this.light = this.scene.environment = texture;
    this.setBackground(this.hasBackground, this.scene.backgroundBlurriness);
  }

  setBackground(shown, blur) {
    this.hasBackground = shown;
    this.scene.background = shown && this.light ? this.light : PLAIN;
    this.scene.backgroundBlurriness = blur;
  }

  /** Turns the light about the vertical, counter-clockwise seen from above. */
  turnLight(angle) {
    for (const rotation of [this.scene.environmentRotation, this.scene.backgroundRotation]) rotation.set(Z_UP, 0, angle, "ZYX");
  }
}

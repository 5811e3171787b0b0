// One asset in its light.
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { withChannels } from "./channels.js";
import { Plate } from "./final.js";
import { Ground } from "./ground.js";

const Z_UP = Math.PI / 2; // about x: from the y up of GLB files and of three's lights
export const PLAIN = new THREE.Color(0x8f9296);

export class View {
  constructor() {
    this.scene = new THREE.Scene();
    this.object = new THREE.Group();
    this.ground = new Ground();
    this.scene.add(this.object, this.ground.plane);
    this.uniforms = { channel: { value: 0 }, unfolded: { value: false }, stretch: { value: new THREE.Vector2() } }; // of all materials
    this.light = null;
    this.version = 0; // of the asset that is shown
    this.plate = new Plate();
  }

  /** Shows the asset of a GLB in place of the one before. */
  async setAsset(glb) {
    const { scene } = await new GLTFLoader().parseAsync(glb, "");
    this.object.traverse((part) => part.isMesh && forget(part));
    this.object.clear();
    scene.rotation.x = Z_UP;
    scene.traverse((part) => {
      if (part.isMesh) part.material = withChannels(part.material, this.uniforms);
    });
    this.object.add(scene);
    this.ground.place(this.object);
    this.setSurface();
  }

  /** Wires, and the surface laid out as its textures are. */
  setSurface() {
    const { wireframe, unfolded } = this.values;
    this.uniforms.unfolded.value = unfolded;
    this.object.traverse(({ isMesh, material }) => {
      if (!isMesh) return;
      material.userData.side ??= material.side;
      const side = unfolded ? THREE.DoubleSide : material.userData.side;
      if (side !== material.side) Object.assign(material, { side, needsUpdate: true });
      material.wireframe = wireframe;
    });
    this.object.traverse((part) => (part.frustumCulled = !unfolded));
  }

  /** The light, an equirectangular texture that becomes this view's own. */
  setLight(texture) {
    this.light?.dispose();
    this.light = this.scene.environment = texture;
    this.setBackground();
    this.ground.setLight(texture, this.values.turn);
  }

  /** Sets what the panel says; the light turns about the vertical, counter-clockwise seen from above. */
  set(values) {
    this.values = values;
    this.uniforms.channel.value = values.channel;
    const angle = (values.turn * Math.PI) / 180;
    for (const rotation of [this.scene.environmentRotation, this.scene.backgroundRotation]) rotation.set(Z_UP, 0, angle, "ZYX");
    this.setBackground();
    this.setSurface();
    this.ground.setLight(this.light, values.turn);
  }

  /** Whether the ground shows its shadow; a photo has its own. */
  casts(through) {
    const { ground, channel, wireframe, unfolded } = this.values;
    return ground && channel === 0 && !wireframe && !unfolded && !through;
  }

  /** The light is the background of the shaded picture alone. */
  setBackground() {
    const shown = this.light && this.values.background && this.values.channel === 0 && !this.values.unfolded;
    this.scene.background = shown ? this.light : PLAIN;
    this.scene.backgroundBlurriness = this.values.blur;
  }

  /** Shows a path-traced picture in place of three's; null takes it away. */
  setPicture(texture, paths) {
    this.plate.set(texture, paths);
    this.object.visible = !texture;
  }

  render(renderer, camera, [, , width, height], through) {
    this.ground.plane.visible = this.object.visible && this.casts(through);
    const side = Math.min(width, height);
    this.uniforms.stretch.value.set(side / width, side / height);
    renderer.render(this.scene, camera);
    if (!this.object.visible) this.plate.render(renderer, camera, this.values.denoise);
  }
}

/** Frees what the graphics card holds of a mesh. */
function forget({ geometry, material }) {
  geometry.dispose();
  for (const value of Object.values(material)) if (value?.isTexture) value.dispose();
  material.dispose();
}

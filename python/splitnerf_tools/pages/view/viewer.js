// The picture: one scene an asset, side by side, with one camera. The world is the data's, z up.
import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { matrixOf } from "./cameras.js";
import { element } from "./elements.js";
import { PLAIN, View } from "./view.js";

const TONES = { none: THREE.LinearToneMapping, neutral: THREE.NeutralToneMapping, agx: THREE.AgXToneMapping }; // linear: exposure alone
const BAR = 90; // pixels that a scale bar has at most

/** Tells "drawn" after each picture, and "left" where the user moves away from a photo's camera. */
export class Viewer extends EventTarget {
  constructor(canvas, description) {
    super();
    this.canvas = canvas;
    this.start = description.camera;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
    this.renderer.autoClear = false;
    this.renderer.setClearColor(PLAIN);
    this.camera = new THREE.PerspectiveCamera();
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("start", () => this.leave());
    this.controls.addEventListener("change", () => this.draw());
    this.views = description.sources.map(() => new View());
    this.overlay = new THREE.Scene();
    this.boxes = [];
    this.through = null; // the photo's camera that is looked through
    this.factor = 1; // its exposure
    this.spunAt = 0;
    this.bar = element("div", { class: "bar3d", title: "a length at the object's middle, in the units of the data" });
    this.axes = element("div", { class: "bar3d axes3d", "aria-hidden": "true" });
    canvas.after(this.bar, this.axes);
    this.home();
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  /** The camera of `splitnerf relight`: the object's front, from 20 degrees above. */
  home() {
    this.leave();
    const { position, target, radius } = this.start;
    this.camera.position.set(...position);
    this.controls.target.set(...target);
    this.controls.minDistance = 0.1 * radius;
    this.controls.maxDistance = 50 * radius;
    this.controls.update();
    this.draw();
  }

  /** Turns the camera about the object, by radians, and moves it nearer by a factor. */
  move(azimuth, elevation, nearer = 1) {
    this.leave();
    const toYUp = new THREE.Quaternion().setFromUnitVectors(this.camera.up, new THREE.Vector3(0, 1, 0));
    const offset = this.camera.position.clone().sub(this.controls.target).applyQuaternion(toYUp);
    const arm = new THREE.Spherical().setFromVector3(offset);
    arm.theta += azimuth;
    arm.phi -= elevation;
    arm.radius = Math.min(Math.max(arm.radius * nearer, this.controls.minDistance), this.controls.maxDistance);
    offset.setFromSpherical(arm.makeSafe()).applyQuaternion(toYUp.invert());
    this.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
    this.draw();
  }

  /** Looks through a photo's camera, at its exposure; null leaves it. Moving on turns about the point that it looks at. */
  lookThrough(camera) {
    this.through = camera;
    this.factor = camera?.exposure ?? 1;
    if (camera) {
      const centre = new THREE.Vector3(...this.start.target);
      matrixOf(camera.pose).decompose(this.camera.position, this.camera.quaternion, new THREE.Vector3());
      const forward = new THREE.Vector3(0, 0, -1).applyQuaternion(this.camera.quaternion);
      const depth = Math.max(centre.sub(this.camera.position).dot(forward), this.controls.minDistance);
      this.controls.target.copy(this.camera.position).addScaledVector(forward, depth);
    }
    this.draw();
  }

  leave() {
    if (!this.through) return;
    this.lookThrough(null);
    this.controls.update();
    this.dispatchEvent(new Event("left"));
  }

  /** Sets what all assets share: the names are those of the panel's fields. */
  set(values) {
    this.values = values;
    if (values.spin && !this.controls.autoRotate) this.spunAt = performance.now();
    this.controls.autoRotate = values.spin;
    this.renderer.toneMapping = TONES[values.tone];
    for (const view of this.views) view.set(values);
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
    this.spin();
    const size = this.renderer.getSize(new THREE.Vector2());
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    if (size.x !== width || size.y !== height) this.renderer.setSize(width, height, false);
    const more = this.views.map((view) => view.casts(this.through) && view.ground.grow(this.renderer, view.object));
    this.renderer.toneMappingExposure = this.factor * 2 ** this.values.exposure;
    this.renderer.setScissorTest(false);
    this.renderer.clear();
    this.renderer.setScissorTest(true);
    this.boxes = this.views.map((_, i) => this.box((i * width) / this.views.length, width / this.views.length, height));
    this.setLens(this.boxes[0][2], this.boxes[0][3]);
    this.views.forEach((view, i) => {
      this.renderer.setViewport(...this.boxes[i]);
      this.renderer.setScissor(...this.boxes[i]);
      view.render(this.renderer, this.camera, this.boxes[i], this.through);
      this.renderer.render(this.overlay, this.camera);
    });
    this.measure();
    this.dispatchEvent(new Event("drawn"));
    if (more.some(Boolean)) this.draw();
  }

  /** Turns on by the time that went by, where that is wanted, and so asks for the next picture. */
  spin() {
    const now = performance.now();
    if (this.controls.autoRotate && !this.through) this.controls.update(Math.min((now - this.spunAt) / 1000, 1));
    this.spunAt = now;
  }

  /** The scale bar: 1, 2 or 5 times a power of ten. */
  measure() {
    const { channel, unfolded } = this.values ?? {};
    const [, , width, height] = this.boxes[0];
    const pixels = this.intrinsics(width, height)[0] / this.camera.position.distanceTo(this.controls.target); // of a length of 1
    const power = 10 ** Math.floor(Math.log10(BAR / pixels));
    const length = [5, 2, 1].find((factor) => factor * power * pixels <= BAR) * power;
    this.bar.hidden = channel === undefined || unfolded;
    this.bar.textContent = String(Number(length.toPrecision(1)));
    this.bar.style.width = `${length * pixels}px`;
    this.axes.hidden = this.bar.hidden;
    const seen = this.camera.quaternion.clone().invert();
    const ends = ["x", "y", "z"].map((name, i) => ({ name, ...new THREE.Vector3().setComponent(i, 1).applyQuaternion(seen) }));
    ends.sort((a, b) => a.z - b.z); // the nearest one lies above the others
    const drawn = ends.map(({ name, x, y }) => `<path class="${name}" d="M0 0L${20 * x} ${-20 * y}"/><text x="${27 * x}" y="${4 - 27 * y}">${name}</text>`);
    this.axes.innerHTML = `<svg viewBox="-34 -34 68 68" width="68">${drawn.join("")}</svg>`;
  }

  /** Saves the picture as it is shown. */
  save(name) {
    this.drawNow();
    this.canvas.toBlob((content) => {
      const link = element("a", { href: URL.createObjectURL(content), download: `${name}.png` });
      link.click();
      URL.revokeObjectURL(link.href);
    });
  }

  /** [left, bottom, width, height] of a picture in its part of the window: of a photo's shape where its camera is looked through. */
  box(left, width, height) {
    if (!this.through) return [left, 0, width, height];
    const scale = Math.min(width / this.through.width, height / this.through.height);
    const [across, up] = [scale * this.through.width, scale * this.through.height];
    return [left + (width - across) / 2, (height - up) / 2, across, up];
  }

  /** [fx, fy, cx, cy] in pixels of a picture. The field of view of the shorter side is always the same, but a photo's. */
  intrinsics(width, height) {
    if (this.through) {
      const [fx, fy, cx, cy] = this.through.intrinsics;
      const [across, down] = [width / this.through.width, height / this.through.height];
      return [fx * across, fy * down, cx * across, cy * down];
    }
    const focal = Math.min(width, height) / 2 / Math.tan(this.start.half_field);
    return [focal, focal, width / 2, height / 2];
  }

  setLens(width, height) {
    const [fx, fy, cx, cy] = this.intrinsics(width, height);
    const distance = this.camera.position.distanceTo(new THREE.Vector3(...this.start.target));
    const near = Math.max(distance - 3 * this.start.radius, 0.01 * distance);
    const far = distance + 100 * this.start.radius;
    const edges = [-cx / fx, (width - cx) / fx, cy / fy, (cy - height) / fy].map((slope) => near * slope);
    this.camera.projectionMatrix.makePerspective(...edges, near, far);
    this.camera.projectionMatrixInverse.copy(this.camera.projectionMatrix).invert();
    this.camera.updateMatrixWorld();
  }
}

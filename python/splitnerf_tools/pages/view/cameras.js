// The photos' cameras: drawn as frusta, and looked through with the photo over the picture.
import * as THREE from "three";
import { Divider, element } from "./elements.js";

const SIZE = 0.05; // of a frustum, as a share of the cameras' distance from the object
const NEAR = 14; // pixels within which a click means a camera
const COLOUR = 0x1c6b8c;

export class Cameras {
  constructor(viewer, list) {
    this.viewer = viewer;
    this.list = list;
    this.lines = list.length ? frusta(list, viewer.controls.target) : null;
    if (this.lines) viewer.overlay.add(this.lines);
    this.photos = document.getElementById("photos");
    this.shown = [];
    viewer.addEventListener("drawn", () => this.place());
    viewer.addEventListener("left", () => this.look(-1));
    viewer.canvas.addEventListener("click", (event) => this.clicked(event));
    this.show(false);
    this.look(-1);
  }

  show(shown) {
    if (this.lines) this.lines.visible = shown;
    this.viewer.draw();
  }

  /** Looks through a photo's camera; -1 leaves it. `changed` is told. */
  look(number) {
    if (number === this.number) return;
    this.number = number;
    const camera = this.list[number] ?? null;
    this.shown = camera ? this.viewer.views.map(() => this.photo(number)) : [];
    this.photos.replaceChildren(...this.shown.map(({ stage }) => stage));
    this.viewer.lookThrough(camera);
    this.changed?.(number);
  }

  /** A photo over the picture, and the line that divides them. */
  photo(number) {
    const image = new Image();
    image.onerror = () => this.failed?.(number);
    Object.assign(image, { alt: `photo ${this.list[number].name}`, src: `photos/${number}` });
    const divider = new Divider("How much of the photo is shown", () => {
      for (const { divider: other } of this.shown) other.slider.value = divider.slider.value;
      this.place();
    });
    divider.tags.forEach((tag, i) => (tag.textContent = ["photo", "render"][i]));
    return { image, divider, stage: element("div", { class: "stage" }, image, ...divider.nodes) };
  }

  /** The photo lies where its camera's picture is, left of the line. */
  place() {
    this.shown.forEach(({ image, divider, stage }, i) => {
      const [left, bottom, width, height] = this.viewer.boxes[i];
      Object.assign(stage.style, { left: `${left}px`, bottom: `${bottom}px`, width: `${width}px`, height: `${height}px` });
      divider.cut(image);
    });
  }

  /** A click near a camera's drawn frustum looks through it. */
  clicked(event) {
    if (!this.lines?.visible || this.viewer.through) return;
    const { left, top, height } = this.viewer.canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - left, event.clientY - top];
    const distances = this.viewer.boxes.flatMap(([boxLeft, , width]) =>
      this.list.map((camera, number) => {
        const place = new THREE.Vector3(camera.pose[3], camera.pose[7], camera.pose[11]).project(this.viewer.camera);
        const [across, down] = [boxLeft + (width * (place.x + 1)) / 2, (height * (1 - place.y)) / 2];
        return { number, distance: place.z < 1 ? Math.hypot(across - x, down - y) : Infinity };
      }),
    );
    const nearest = distances.reduce((a, b) => (b.distance < a.distance ? b : a));
    if (nearest.distance < NEAR) this.look(nearest.number);
  }
}

/** A pose's matrix, camera to world. */
export const matrixOf = (pose) => new THREE.Matrix4().set(...pose);

/** A pyramid of lines for each camera. */
function frusta(list, centre) {
  const points = [];
  for (const { pose, intrinsics, width, height } of list) {
    const toWorld = matrixOf(pose);
    const apex = new THREE.Vector3().setFromMatrixPosition(toWorld);
    const depth = SIZE * apex.distanceTo(centre);
    const [fx, fy, cx, cy] = intrinsics;
    const corners = [[0, 0], [width, 0], [width, height], [0, height]].map(([x, y]) =>
      new THREE.Vector3((depth * (x - cx)) / fx, (depth * (cy - y)) / fy, -depth).applyMatrix4(toWorld),
    );
    corners.forEach((corner, i) => points.push(apex, corner, corner, corners[(i + 1) % 4]));
  }
  const geometry = new THREE.BufferGeometry().setFromPoints(points);
  return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: COLOUR, toneMapped: false }));
}

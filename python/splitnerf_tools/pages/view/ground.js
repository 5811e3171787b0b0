// The shadow on the ground below an object: for many directions of the light, what of the ground lies behind the object as seen from there.
import * as THREE from "three";

const SIDE = 512; // texels of the shadow
const REACH = 3; // half of the ground's edge, in the object's radii
const DIRECTIONS = 96; // sampled from the light by what they send to the ground; the object hides the same share of that
const A_PICTURE = 8; // directions that are added with each picture
const LOWEST = 0.05; // sine of a direction's elevation: a flatter one throws its shadow farther than the ground reaches

const target = (type, format) => new THREE.WebGLRenderTarget(SIDE, SIDE, { type, format, depthBuffer: false });
const plate = (fragmentShader, uniforms, more = {}) =>
  new THREE.Mesh(
    new THREE.PlaneGeometry(2, 2),
    new THREE.ShaderMaterial({
      vertexShader: "varying vec2 place; void main() { place = uv; gl_Position = vec4(position.xy, 0.0, 1.0); }",
      fragmentShader, uniforms, depthTest: false, depthWrite: false, ...more,
    }),
  );

export class Ground {
  constructor() {
    this.hidden = target(THREE.UnsignedByteType, THREE.RGBAFormat); // from one direction
    this.sum = target(THREE.HalfFloatType, THREE.RGBAFormat);
    this.mask = new THREE.MeshBasicMaterial({ side: THREE.DoubleSide, toneMapped: false });
    this.add = plate(
      `uniform sampler2D map; varying vec2 place; void main() { gl_FragColor = vec4(texture2D(map, place).r / ${DIRECTIONS.toFixed(1)}); }`,
      { map: { value: this.hidden.texture } },
      { transparent: true, blending: THREE.CustomBlending, blendSrc: THREE.OneFactor, blendDst: THREE.OneFactor },
    );
    this.add.frustumCulled = false;
    this.plane = new THREE.Mesh(
      new THREE.PlaneGeometry(2, 2),
      new THREE.ShaderMaterial({
        vertexShader: "varying vec2 place; void main() { place = uv; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }",
        fragmentShader: /* glsl */ `
          uniform sampler2D map; uniform float share; varying vec2 place;
          void main() {
            float edge = smoothstep(1.0, 0.6, 2.0 * distance(place, vec2(0.5)));
            gl_FragColor = vec4(vec3(0.0), share * edge * texture2D(map, place).r);
          }`,
        uniforms: { map: { value: this.sum.texture }, share: { value: 0 } },
        transparent: true,
        depthWrite: false,
      }),
    );
    this.eye = new THREE.Camera();
    this.directions = [];
    this.done = 0;
  }

  /** Lays the ground below an object [a group, z up]. */
  place(object) {
    const box = new THREE.Box3().setFromObject(object);
    const centre = box.getCenter(new THREE.Vector3());
    this.radius = 0.5 * box.getSize(new THREE.Vector3()).length();
    this.plane.position.set(centre.x, centre.y, box.min.z - 1e-3 * this.radius);
    this.plane.scale.setScalar(REACH * this.radius);
    this.done = 0;
  }

  /** The light, an equirectangular texture of halves, turned by degrees about the vertical. */
  setLight(texture, turn) {
    if (texture === this.light && turn === this.turn) return;
    if (texture !== this.light) this.samples = texture && samplesOf(texture.image);
    Object.assign(this, { light: texture, turn });
    const [c, s] = [Math.cos((turn * Math.PI) / 180), Math.sin((turn * Math.PI) / 180)];
    this.directions = (this.samples ?? []).map(([x, y, z]) => [c * x - s * y, s * x + c * y, z]);
    this.done = 0;
  }

  /** Adds some directions; true while more are to come. */
  grow(renderer, object) {
    if (!this.radius || this.done >= this.directions.length) return false;
    const [colour, tone] = [renderer.getClearColor(new THREE.Color()), renderer.toneMapping];
    renderer.toneMapping = THREE.NoToneMapping;
    const scene = new THREE.Scene();
    const parent = object.parent;
    scene.add(object);
    scene.overrideMaterial = this.mask;
    renderer.setClearColor(0x000000, 0);
    if (this.done === 0) {
      renderer.setRenderTarget(this.sum);
      renderer.clear();
    }
    for (const direction of this.directions.slice(this.done, (this.done += A_PICTURE))) {
      this.lookAlong(direction);
      renderer.setRenderTarget(this.hidden);
      renderer.clear();
      renderer.render(scene, this.eye);
      renderer.setRenderTarget(this.sum);
      renderer.render(this.add, this.eye);
    }
    parent.add(object);
    renderer.setRenderTarget(null);
    renderer.setClearColor(colour, 1);
    renderer.toneMapping = tone;
    this.plane.material.uniforms.share.value = DIRECTIONS / this.done;
    return this.done < this.directions.length;
  }

  /** The object is pressed flat onto the ground along the direction, and the ground fills the picture. */
  lookAlong([x, y, z]) {
    const { x: cx, y: cy, z: low } = this.plane.position;
    const [a, b, k] = [x / z, y / z, 1 / this.plane.scale.x];
    this.eye.projectionMatrix.set(k, 0, -k * a, k * (a * low - cx), 0, k, -k * b, k * (b * low - cy), 0, 0, -0.1 * k, 0.1 * k * low, 0, 0, 0, 1);
    this.eye.projectionMatrixInverse.copy(this.eye.projectionMatrix).invert();
  }
}

/** Directions to the light above the ground, as many where more of it falls on the ground; z up. */
function samplesOf({ data, width, height }) {
  const value = THREE.DataUtils.fromHalfFloat;
  const rows = Math.floor(height / 2);
  const running = new Float64Array(rows * width);
  const ends = new Float64Array(rows);
  for (let row = 0, all = 0; row < rows; row++) {
    const theta = ((row + 0.5) / height) * Math.PI;
    const weight = Math.cos(theta) > LOWEST ? Math.cos(theta) * Math.sin(theta) : 0;
    for (let column = 0, sum = 0; column < width; column++) {
      const place = 4 * (row * width + column);
      sum += weight * (value(data[place]) + value(data[place + 1]) + value(data[place + 2]));
      running[row * width + column] = sum;
    }
    ends[row] = all += running[row * width + width - 1];
  }
  if (!(ends[rows - 1] > 0)) return [];
  const found = (list, share) => { // the texel and the place in it
    const end = share * list[list.length - 1];
    const i = Math.min(list.findIndex((each) => each > end) >>> 0, list.length - 1);
    const before = i && list[i - 1];
    return [i, i + Math.min((end - before) / (list[i] - before), 1)];
  };
  return Array.from({ length: DIRECTIONS }, (_, i) => {
    const [row, v] = found(ends, (0.5 + i * 0.7548776662) % 1); // a sequence that fills the square evenly from its start
    const [, u] = found(running.subarray(row * width, (row + 1) * width), (0.5 + i * 0.5698402910) % 1);
    const [theta, phi] = [(v / height) * Math.PI, 2 * Math.PI * (0.5 - u / width)];
    return [Math.sin(theta) * Math.cos(phi), Math.sin(theta) * Math.sin(phi), Math.cos(theta)];
  });
}

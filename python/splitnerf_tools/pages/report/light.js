// The lights, with an exposure, and the radiance under the pointer.
import { DataUtils } from "three";
import { encoded } from "../view/halves.js";
import { listenToSliders, slider, tellSliders } from "../view/controls.js";
import { element, placeIn, short, tabs, unpacked } from "../view/elements.js";

export async function lights(section, { lights: given }) {
  if (!given.length) return false;
  const shown = await Promise.all(given.map(async (light) => new Light(light, new Uint16Array(await unpacked(light.packed)))));
  const state = { stops: 0, own: true };
  const draw = () => {
    for (const light of shown) light.draw((state.own ? light.white : shown[0].white) / 2 ** state.stops);
  };
  const said = element("p", { class: "said" });
  const under = (light, event) => {
    const [u, v] = placeIn(light.canvas, event);
    const parts = shown.map((one) => `${one.name} ${one.at(u, v).map((value) => short(value)).join(" ")}`);
    said.textContent = `azimuth ${Math.round(360 * (0.5 - u))}°, elevation ${Math.round(90 - 180 * v)}°: ${parts.join(" · ")}`;
    for (const one of shown) one.mark(u, v);
  };
  const leave = () => {
    said.textContent = "Radiance under the pointer: red, green, blue.";
    for (const one of shown) one.mark(null);
  };
  for (const light of shown) {
    light.canvas.addEventListener("pointermove", (event) => under(light, event));
    light.canvas.addEventListener("pointerleave", leave);
  }
  leave();
  const row = element("div", { class: "toolbar" });
  const exposure = slider("exposure", "Exposure", { min: -10, max: 10, step: 0.25, unit: " EV" });
  listenToSliders(row, () => {
    state.stops = Number(exposure.querySelector("input").value);
    draw();
  });
  row.classList.add("controls");
  row.append(exposure);
  if (shown.length > 1) {
    row.append(
      tabs("White", ["each by its own mean", `all as the ${given[0].name}`], (i) => {
        state.own = i === 0;
        draw();
      }),
    );
  }
  tellSliders(row);
  section.querySelector(".lights").after(row, element("div", { class: "cards lights widget" }, ...shown.map((light) => light.figure)), said);
  return true;
}

class Light {
  constructor({ name, white, width, height }, codes) {
    Object.assign(this, { name, white, width, height });
    this.radiance = Float32Array.from(codes, DataUtils.fromHalfFloat);
    this.canvas = element("canvas", { width, height, role: "img", "aria-label": name });
    this.cross = element("i", { class: "cross", hidden: true });
    this.limit = element("span");
    const caption = element("figcaption", {}, `${name}; white is a radiance of `, this.limit);
    this.figure = element("figure", { class: "card" }, element("div", { class: "sky" }, this.canvas, this.cross), caption);
  }

  /** Draws the light: `white` and more is white, the sRGB curve. */
  draw(white) {
    this.limit.textContent = short(white);
    const picture = new ImageData(this.width, this.height);
    for (let i = 0; i < this.radiance.length; i++) picture.data[i] = i % 4 === 3 ? 255 : Math.round(255 * encoded(this.radiance[i] / white));
    this.canvas.getContext("2d").putImageData(picture, 0, 0);
  }

  at(u, v) {
    const place = 4 * (Math.floor(v * this.height) * this.width + Math.floor(u * this.width));
    return [...this.radiance.subarray(place, place + 3)];
  }

  mark(u, v) {
    this.cross.hidden = u === null;
    if (u !== null) Object.assign(this.cross.style, { left: `${100 * u}%`, top: `${100 * v}%` });
  }
}

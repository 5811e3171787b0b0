// The delivered asset in three dimensions, with the modules of the viewer's page.
import { CHANNELS } from "../view/channels.js";
import { asLight, halves } from "../view/halves.js";
import { Viewer } from "../view/viewer.js";
import { element, range, tabs, unpacked } from "./elements.js";

const STEP = Math.PI / 36; // radians of the camera a key
const KEYS = {
  ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0], ArrowUp: [0, STEP], ArrowDown: [0, -STEP],
  "+": [0, 0, 0.9], "=": [0, 0, 0.9], "-": [0, 0, 1 / 0.9],
};

export async function object(section, { camera, lights }) {
  const glb = document.getElementById("glb");
  if (!glb) return false;
  if (!document.createElement("canvas").getContext("webgl2")) {
    section.querySelector(".static").textContent = "This browser has no WebGL 2, which the 3D view needs.";
    return false;
  }
  const canvas = element("canvas", { tabindex: 0, "aria-label": "The object. Drag to turn it; arrow keys turn it, + and - zoom." });
  const panel = element("div", { class: "toolbar" });
  section.append(element("div", { class: "card widget object" }, element("div", { class: "view3d" }, canvas), panel));
  section.classList.add("live"); // the canvas takes the size that it has
  const viewer = new Viewer(canvas, { camera, sources: [{}] });
  const [view] = viewer.views;
  const values = { channel: 0, turn: 0, exposure: 0, tone: "none", background: true, blur: 0.3 };
  const set = (change) => viewer.set(Object.assign(values, change));
  viewer.controls.enableZoom = false; // the wheel scrolls the page, until the canvas is clicked
  canvas.style.touchAction = "pan-y"; // as does a finger that moves up or down
  canvas.addEventListener("focus", () => (viewer.controls.enableZoom = true));
  canvas.addEventListener("blur", () => (viewer.controls.enableZoom = false));
  canvas.addEventListener("keydown", (event) => {
    if (!KEYS[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    viewer.move(...KEYS[event.key]);
  });
  set({});
  let [chosen, loaded] = [0, false];
  const light = async (number) => {
    chosen = number;
    const { width, height, packed } = lights[number];
    const content = await unpacked(packed);
    if (chosen !== number) return;
    view.setLight(asLight(halves(content, width, height)));
    if (loaded) viewer.draw();
  };
  panel.append(tabs("What is shown", CHANNELS, (channel) => set({ channel })));
  if (lights.length > 1) panel.append(tabs("Light", lights.map((one) => one.name), light));
  else if (lights.length) light(0);
  const behind = element("input", { type: "checkbox", checked: true, onchange: () => set({ background: behind.checked }) });
  panel.append(
    range("Turn the light", { min: -180, max: 180, step: 1, unit: "°" }, (turn) => set({ turn })),
    range("Exposure", { min: -6, max: 6, step: 0.1, unit: " EV" }, (exposure) => set({ exposure })),
    element("label", { class: "axis" }, behind, " light behind"),
    element("button", { type: "button", onclick: () => viewer.home() }, "front view"),
    element("span", { class: "hint" }, "drag to turn; click, then the wheel zooms"),
  );
  await view.setAsset(await unpacked(glb.textContent));
  loaded = true;
  viewer.draw();
  return true;
}

// The asset in three dimensions, with the viewer's picture and controls.
import { Controls } from "../view/controls.js";
import { listenForFiles, opener } from "../view/drop.js";
import { element, unpacked } from "../view/elements.js";
import { asLight, halves } from "../view/halves.js";
import { Viewer } from "../view/viewer.js";
import { lightOf } from "./files.js";

export async function object(section, { camera, lights, studio, name }) {
  const glb = document.getElementById("glb");
  if (!glb) return false;
  if (!document.createElement("canvas").getContext("webgl2")) {
    section.querySelector(".static").textContent = "This browser has no WebGL 2, which the 3D view needs.";
    return false;
  }
  const canvas = element("canvas", { tabindex: 0, "aria-label": "The object. Drag to turn it; arrow keys turn it, + and - zoom." });
  const panel = element("form", { "aria-label": "How to show it", autocomplete: "off" });
  const card = element("div", { class: "card widget object" }, element("div", { class: "view3d" }, canvas), panel);
  section.querySelector(".place").append(card);
  section.classList.add("live"); // the canvas takes the size that it has
  const viewer = new Viewer(canvas, { camera, sources: [{}] });
  const [view] = viewer.views;
  viewer.controls.enableZoom = false; // the wheel scrolls the page, until the canvas is clicked
  canvas.style.touchAction = "pan-y"; // as does a finger that moves up or down
  canvas.addEventListener("focus", () => (viewer.controls.enableZoom = true));
  canvas.addEventListener("blur", () => (viewer.controls.enableZoom = false));
  const all = [...lights, ...studio];
  let chosen = -1;
  const light = async (number) => {
    if (number === chosen) return;
    chosen = number;
    const { width, height, packed, content } = all[number];
    const texels = content ?? (await unpacked(packed));
    if (chosen !== number) return;
    view.setLight(asLight(halves(texels, width, height)));
    viewer.draw();
  };
  const changed = (values) => {
    viewer.set(values);
    light(Number(values.light));
  };
  const said = element("p", { class: "hint" });
  const opened = async (file) => {
    try {
      const one = await lightOf(file);
      all.push(one);
      controls.setLights(names(), all.length - 1);
      controls.tell();
      said.textContent = one.note;
    } catch (error) {
      said.textContent = error.message;
    }
  };
  const names = () => all.map((one, i) => [i, one.name]);
  const hint = element("p", { class: "hint" }, "Drag to turn; click, then the wheel zooms and keys work.");
  const controls = new Controls(panel, viewer, { changed, name, lights: [...opener(opened), said], last: [hint] });
  controls.listen(card);
  controls.setLights(names(), 0);
  listenForFiles(opened);
  controls.tell();
  await view.setAsset(await unpacked(glb.textContent));
  viewer.draw();
  return true;
}

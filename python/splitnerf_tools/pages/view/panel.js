// The panel of the viewer's page: the controls, and those that need its server: path tracing, files, and the photos' cameras.
import { check, Controls, select } from "./controls.js";
import { opener } from "./drop.js";
import { element } from "./elements.js";

const KEYS = {
  final: ["f", "final: path traced"],
  cameras: ["c", "the photos' cameras"],
  through: ["n p", "through the next, the previous one"],
  fold: ["h", "hide the panel"],
};
const PATHS = [16, 64, 256, 1024].map((paths) => [paths, `${paths} paths`]);

const field = (id) => document.getElementById(id);

export class Panel extends Controls {
  constructor(viewer, description, changed, opened) {
    const names = description.cameras.map((camera, i) => [i, camera.name]);
    const photos = element("fieldset", {}, check("cameras", "Cameras (click one)"), select("through", "Look through", [[-1, "none"], ...names]));
    const files = description.sources.flatMap(({ name, facts }, i) => {
      const file = `${name.replace(/\.glb$/i, "")}.glb`;
      return facts ? [element("p", { class: "hint" }, element("a", { href: `assets/${i}`, download: file }, file), `: ${facts}`)] : [];
    });
    const last = names.length ? [photos, ...files] : files;
    super(field("panel"), viewer, {
      changed, last, keys: KEYS, name: description.sources[0].name,
      first: [element("div", { class: "pair" }, check("final", "Final: path traced"), select("paths", "up to", PATHS), check("denoise", "Denoise", true))],
      lights: opener(opened),
    });
    this.form.elements.paths.value = 256;
    this.showLights(description.lights, description.first_light ?? undefined);
    field("fold").addEventListener("click", () => this.fold());
    const photo = (steps) => () => names.length && this.step("through", steps);
    this.listen(window, {
      f: () => this.toggle("final"),
      c: () => names.length && this.toggle("cameras"),
      n: photo(1),
      p: photo(-1),
      h: () => this.fold(),
    });
    this.tell();
  }

  get values() {
    const { through = -1, cameras = false, ...values } = super.values;
    return { ...values, through: Number(through), cameras };
  }

  /** Says in the panel which photo's camera is looked through, -1 for none. */
  setThrough(number) {
    this.form.elements.through.value = number;
  }

  /** The lights to choose from; "own" is each run's own. */
  showLights(lights, chosen) {
    const own = lights.filter((light) => light.own);
    const rest = lights.filter((light) => !light.own || own.length > 1);
    const rows = rest.map((light) => [light.number, light.name]);
    if (own.length) rows.unshift(["own", own.length > 1 ? "each its own" : own[0].name]);
    this.setLights(rows, chosen);
  }

  fold() {
    const hidden = (field("panel").hidden = !field("panel").hidden);
    field("fold").setAttribute("aria-expanded", String(!hidden));
  }
}

// The controls of an asset's picture, the same in the page of `splitnerf view` and in the report; their values, and their keys.
import { CHANNELS } from "./channels.js";
import { element } from "./elements.js";

const TONES = { none: "none", neutral: "neutral", agx: "AgX" };
const STEP = Math.PI / 36; // radians of the camera a key
const KEYS = { // of each control, and of what has none
  channel: ["1 – 6", "what is shown"],
  unfolded: ["u", "as textures"],
  wireframe: ["w", "wireframe"],
  turn: ["[ ]", "turn the light"],
  exposure: [", .", "darker, brighter"],
  tone: ["t", "tone mapping"],
  ground: ["g", "ground shadow"],
  background: ["b", "light as background"],
  spin: ["a", "turn about the object"],
  home: ["r", "front view"],
  save: ["s", "save picture"],
  full: ["x", "full screen"],
  "": ["← → ↑ ↓ + −", "turn the object; nearer, farther"],
};

export const check = (name, words, checked = false) =>
  element("label", { class: "check" }, element("input", { type: "checkbox", name, checked }), ` ${words}`);
export const select = (name, words, options = []) =>
  element("label", {}, `${words} `, element("select", { name }, ...options.map(([value, shown]) => new Option(shown, value))));
export const slider = (name, words, { min, max, step, value = 0, unit = "" }) =>
  element("label", {}, `${words} `, element("output", { "data-unit": unit }), element("input", { type: "range", name, min, max, step, value }));
const button = (name, words) => element("button", { type: "button", name }, words);

/** Shows each slider's number beside its name. */
export function tellSliders(form) {
  for (const output of form.querySelectorAll("label > output")) output.value = `${output.nextSibling.value}${output.dataset.unit}`;
}

/** Calls `moved` after each change; a double click on a slider resets it. */
export function listenToSliders(form, moved) {
  const tell = () => {
    tellSliders(form);
    moved();
  };
  form.addEventListener("input", tell);
  form.addEventListener("dblclick", ({ target }) => {
    if (target.type !== "range") return;
    target.value = target.defaultValue;
    tell();
  });
}

export class Controls {
  /** Fills a form. `changed` is called with the values after each change; `first` stands above the light, `lights` below it, `last`
   * below all that lights; `keys` are those of what they hold. */
  constructor(form, viewer, { changed, first = [], lights = [], last = [], keys = {}, name = "asset" }) {
    Object.assign(this, { form, viewer, changed });
    const pills = CHANNELS.map((words, i) =>
      element("label", {}, element("input", { type: "radio", name: "channel", value: i, checked: i === 0 }), element("span", {}, words)));
    this.lit = element("fieldset", {},
      ...first,
      select("light", "Light"), ...lights,
      slider("turn", "Turn the light", { min: -180, max: 180, step: 1, unit: "°" }),
      slider("exposure", "Exposure", { min: -6, max: 6, step: 0.1, unit: " EV" }),
      select("tone", "Tone mapping", Object.entries(TONES)),
      check("ground", "Ground shadow", true),
      check("background", "Light as background"),
      slider("blur", "Blur of the background", { min: 0, max: 1, step: 0.05, value: 0.3 }));
    const all = { ...KEYS, ...keys };
    form.classList.add("controls");
    form.append(
      element("fieldset", { class: "pills", "aria-label": "What is shown" }, ...pills),
      element("div", { class: "pair" }, check("wireframe", "Wireframe"), check("unfolded", "As textures"), check("spin", "Turntable")),
      this.lit, ...last,
      element("div", { class: "pair" }, button("home", "Front view"), button("save", "Save picture"), button("full", "Full screen")),
      element("details", {}, element("summary", {}, "Keys"), element("dl", {}, ...Object.values(all).flatMap(([key, words]) => [element("dt", {}, key), element("dd", {}, words)]))));
    for (const input of form.querySelectorAll("[name]")) {
      const told = all[input.name];
      const reset = input.type === "range" ? "; a double click resets it" : "";
      if (told) (input.closest("label") ?? input).title = `${told[1]} (${told[0]})${reset}`;
    }
    listenToSliders(form, () => this.tell());
    form.addEventListener("submit", (event) => event.preventDefault());
    const { home, save, full } = form.elements;
    home.addEventListener("click", () => viewer.home());
    save.addEventListener("click", () => viewer.save(name));
    full.addEventListener("click", () => this.fullScreen());
  }

  /** What the fields say; `through` and others are those of the page that has them. */
  get values() {
    const values = {};
    for (const input of this.form.querySelectorAll("[name]")) {
      if (input.type === "checkbox") values[input.name] = input.checked;
      else if (input.type === "range") values[input.name] = Number(input.value);
      else if (input.type !== "radio" || input.checked) values[input.name] = input.value;
    }
    return { ...values, channel: Number(values.channel) };
  }

  /** The lights to choose from, [value, name]. */
  setLights(rows, chosen) {
    const { light } = this.form.elements;
    light.replaceChildren(...rows.map(([value, words]) => new Option(words, value)));
    if (chosen !== undefined) light.value = chosen;
  }

  tell() {
    tellSliders(this.form);
    const { values } = this;
    this.lit.disabled = values.channel !== 0; // maps are shown as they are
    this.changed(values);
  }

  write(input, value) {
    if (input.matches(":disabled")) return;
    input[input.type === "checkbox" || input.type === "radio" ? "checked" : "value"] = value;
    this.tell();
  }

  fullScreen() {
    if (document.fullscreenElement) document.exitFullscreen();
    else this.form.parentElement.requestFullscreen();
  }

  /** Moves a slider by so many steps, round the end where it is an angle; a list by so many of its lines. */
  step(name, steps) {
    const input = this.form.elements[name];
    if (input.options) return this.write(input, input.options[(input.selectedIndex + steps + input.options.length) % input.options.length].value);
    const value = Number(input.value) + steps * Number(input.step);
    const span = input.max - input.min;
    this.write(input, name === "turn" ? value - span * Math.round(value / span) : value);
  }

  toggle(name) {
    const input = this.form.elements[name];
    this.write(input, !input.checked);
  }

  /** Keys of a target do what they say, but in a field that uses them itself. */
  listen(target, more = {}) {
    const { viewer } = this;
    const { channel, save } = this.form.elements;
    const step = (name, steps) => () => this.step(name, steps);
    const toggle = (name) => () => this.toggle(name);
    const nearer = () => viewer.move(0, 0, 0.9);
    const actions = {
      ...Object.fromEntries(CHANNELS.map((_, i) => [String(i + 1), () => this.write(channel[i], true)])),
      ArrowLeft: () => viewer.move(-STEP, 0),
      ArrowRight: () => viewer.move(STEP, 0),
      ArrowUp: () => viewer.move(0, STEP),
      ArrowDown: () => viewer.move(0, -STEP),
      "+": nearer,
      "=": nearer,
      "-": () => viewer.move(0, 0, 1 / 0.9),
      "[": step("turn", -5),
      "]": step("turn", 5),
      ",": step("exposure", -5),
      ".": step("exposure", 5),
      t: step("tone", 1),
      b: toggle("background"),
      g: toggle("ground"),
      a: toggle("spin"),
      u: toggle("unfolded"),
      w: toggle("wireframe"),
      r: () => viewer.home(),
      s: () => save.click(),
      x: () => this.fullScreen(),
      ...more,
    };
    target.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.target.matches?.("select") || (event.target.matches?.("input") && event.key.startsWith("Arrow"))) return;
      const action = actions[event.key];
      if (!action) return;
      event.preventDefault();
      action();
    });
  }
}

// The panel: fields, their values, and the keys that move them.
import { CHANNELS } from "./channels.js";

const KEYS = [
  ["1 – 5", "what is shown"],
  ["← → ↑ ↓", "turn the object"],
  ["+ −", "nearer, farther"],
  ["[ ]", "turn the light"],
  [", .", "darker, brighter"],
  ["b", "background"],
  ["t", "tone mapping"],
  ["f", "final: path traced"],
  ["r", "front view"],
  ["c", "the photos' cameras"],
  ["n p", "through the next, the previous one"],
  ["h", "hide the panel"],
];
const STEP = Math.PI / 36; // radians of the camera a key

const field = (id) => document.getElementById(id);

export class Panel {
  /** `changed` is called with the values after each change. */
  constructor(description, changed) {
    this.changed = changed;
    this.fillChannels();
    this.setLights(description.lights, description.first_light ?? undefined);
    this.fill(field("through"), [[-1, "none"], ...description.cameras.map((camera, i) => [i, camera.name])]);
    field("photo-fields").hidden = description.cameras.length === 0;
    field("keys").innerHTML = KEYS.map(([key, words]) => `<dt>${key}</dt><dd>${words}</dd>`).join("");
    field("panel").addEventListener("input", () => this.tell());
    field("panel").addEventListener("submit", (event) => event.preventDefault());
    field("fold").addEventListener("click", () => this.fold());
    this.tell();
  }

  /** What the fields say. */
  get values() {
    const number = (id) => Number(field(id).value);
    return {
      channel: CHANNELS.indexOf(document.querySelector("[name=channel]:checked").value),
      light: field("light").value,
      turn: number("turn"),
      exposure: number("exposure"),
      tone: field("tone").value,
      background: field("background").checked,
      blur: number("blur"),
      final: field("final").checked,
      cameras: field("cameras").checked,
      through: number("through"),
    };
  }

  /** Says in the panel which photo's camera is looked through, -1 for none. */
  setThrough(number) {
    field("through").value = number;
  }

  /** The lights to choose from; "own" is each run's own. */
  setLights(lights, chosen) {
    const own = lights.filter((light) => light.own);
    const rest = lights.filter((light) => !light.own || own.length > 1);
    const rows = rest.map((light) => [light.number, light.name]);
    if (own.length) rows.unshift(["own", own.length > 1 ? "each its own" : own[0].name]);
    this.fill(field("light"), rows);
    if (chosen !== undefined) field("light").value = chosen;
  }

  fill(select, rows) {
    select.replaceChildren(...rows.map(([value, words]) => new Option(words, value)));
  }

  fillChannels() {
    for (const name of CHANNELS) {
      const label = document.createElement("label");
      label.innerHTML = `<input type="radio" name="channel" value="${name}"> <span>${name}</span>`;
      label.firstChild.checked = name === "shaded";
      field("channels").append(label);
    }
  }

  tell() {
    for (const output of document.querySelectorAll("#panel output")) {
      const input = output.parentElement.querySelector("input");
      output.value = `${input.value}${input.dataset.unit ?? ""}`;
    }
    this.changed(this.values);
  }

  fold() {
    const hidden = (field("panel").hidden = !field("panel").hidden);
    field("fold").setAttribute("aria-expanded", String(!hidden));
  }

  /** Moves a slider by so many steps, round the end where it is an angle. */
  step(id, steps) {
    const input = field(id);
    const value = Number(input.value) + steps * Number(input.step);
    const span = input.max - input.min;
    input.value = id === "turn" ? value - span * Math.round(value / span) : value;
    this.tell();
  }

  /** What each key does; `viewer` is moved by some. */
  actions(viewer) {
    const channel = (number) => {
      document.querySelectorAll("[name=channel]")[number].checked = true;
      this.tell();
    };
    const tone = () => {
      field("tone").value = field("tone").value === "none" ? "aces" : "none";
      this.tell();
    };
    const toggle = (id) => () => {
      field(id).checked = !field(id).checked;
      this.tell();
    };
    const photo = (steps) => () => {
      const options = field("through").options.length; // the first one is "none"
      field("through").selectedIndex = (field("through").selectedIndex + steps + options) % options;
      this.tell();
    };
    return {
      ...Object.fromEntries(CHANNELS.map((_, i) => [String(i + 1), () => channel(i)])),
      ArrowLeft: () => viewer.move(-STEP, 0),
      ArrowRight: () => viewer.move(STEP, 0),
      ArrowUp: () => viewer.move(0, STEP),
      ArrowDown: () => viewer.move(0, -STEP),
      "+": () => viewer.move(0, 0, 0.9),
      "=": () => viewer.move(0, 0, 0.9),
      "-": () => viewer.move(0, 0, 1 / 0.9),
      "[": () => this.step("turn", -5),
      "]": () => this.step("turn", 5),
      ",": () => this.step("exposure", -5),
      ".": () => this.step("exposure", 5),
      b: toggle("background"),
      f: toggle("final"),
      c: toggle("cameras"),
      n: photo(1),
      p: photo(-1),
      t: tone,
      r: () => viewer.home(),
      h: () => this.fold(),
    };
  }

  /** Keys count anywhere but in a field that uses them itself. */
  listen(viewer) {
    const actions = this.actions(viewer);
    addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.target.matches?.("select") || (event.target.matches?.("input") && event.key.startsWith("Arrow"))) return;
      const action = actions[event.key];
      if (!action) return;
      event.preventDefault();
      action();
    });
  }
}

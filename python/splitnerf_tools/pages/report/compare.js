// Two pictures of each view with a slider between them, or their difference.
import { Divider, element, placeIn, short, tabs } from "../view/elements.js";
import { difference, paint, read, scaleColours, valueAt } from "./differences.js";

const UNITS = { colour: "", number: "", normal: "°" };
const WORDS = {
  colour: "|difference| of sRGB values, mean of the three channels",
  number: "|difference|",
  normal: "angle between the normals",
};

export function compare(section) {
  const pairs = JSON.parse(section.dataset.pairs);
  const sides = section.dataset.sides ? JSON.parse(section.dataset.sides) : null;
  const stages = [...section.querySelectorAll("article")].map((article) => new Stage(article));
  if (!pairs.length || !stages.length) return false;
  const state = { pair: pairs[0], error: false };
  const legend = element("p", { class: "legend-row", "aria-live": "polite" });
  const show = () => {
    for (const stage of stages) stage.show(state.pair, state.pair.sides ?? sides, state.error);
    const { kind, largest } = state.pair;
    const bar = element("i", { style: `background:${scaleColours}` });
    legend.replaceChildren(...(state.error ? [`${WORDS[kind]}: 0 `, bar, ` ${largest}${UNITS[kind]} and more`] : []));
  };
  const row = element("div", { class: "toolbar" });
  section.querySelector(".cards").before(row);
  row.append(
    tabs("What is compared", pairs.map((pair) => pair.name), (i) => {
      state.pair = pairs[i];
      show();
    }),
    tabs("How", ["slider", "error"], (i) => {
      state.error = i === 1;
      show();
    }),
    legend,
  );
  return true;
}

/** One view's pictures, one over the other. */
class Stage {
  constructor(article) {
    this.pictures = Object.fromEntries([...article.querySelectorAll("img")].map((image) => [image.dataset.picture, image]));
    this.right = element("img", { alt: "" });
    this.left = element("img", { alt: "" });
    this.error = element("canvas", { role: "img" });
    this.divider = new Divider("", () => this.place());
    const { line, tags, slider } = this.divider;
    Object.assign(this, { line, names: tags, slider });
    this.box = element("div", { class: "stage whole" }, this.right, this.left, this.error, ...this.divider.nodes);
    this.said = element("p", { class: "said" });
    article.append(this.box, this.said);
    this.box.addEventListener("pointermove", (event) => this.point(event));
    this.box.addEventListener("pointerleave", () => this.say());
    this.name = article.querySelector("h3").firstChild.textContent.trim();
  }

  async show(pair, sides, error) {
    this.pair = pair;
    const [left, right] = [this.pictures[pair.left], this.pictures[pair.right]];
    this.sides = [left && sides[0], right && sides[1]];
    this.values = null;
    this.about = "";
    const both = Boolean(left && right);
    this.box.hidden = !left && !right;
    if (this.box.hidden) return this.say("no such map");
    const [first, second] = [left ?? right, right ?? left];
    this.left.src = first.src;
    this.right.src = second.src;
    this.left.alt = first.alt;
    this.right.alt = second.alt;
    this.slider.hidden = this.line.hidden = !both || error;
    this.slider.setAttribute("aria-label", `${this.name}: how much of ${sides[0]} is shown`);
    this.error.setAttribute("aria-label", `difference of ${first.alt} and ${second.alt}`);
    this.error.hidden = !both || !error;
    this.left.hidden = this.right.hidden = !this.error.hidden;
    this.names.forEach((tag, i) => {
      tag.textContent = this.sides[i] ?? "";
      tag.hidden = !this.sides[i] || !this.error.hidden;
    });
    this.place();
    this.say(both ? "" : "no truth to compare with");
    const white = pair.kind === "colour" && first.dataset.picture !== "albedo" && !pair.left.endsWith("albedo");
    const values = await Promise.all([left, right].map((image) => image && read(image, white)));
    if (this.pair !== pair) return;
    this.values = values;
    const { naturalWidth: width, naturalHeight: height } = first;
    this.box.style.aspectRatio = `${width} / ${height}`;
    this.box.classList.toggle("coarse", this.box.clientWidth > 2 * width);
    if (both && error) {
      const mean = paint(this.error, values[0], values[1], pair.kind, pair.largest);
      this.about = mean === null ? "nothing to compare" : `mean ${short(mean)}${UNITS[pair.kind]}`;
      this.say();
    }
  }

  place() {
    this.divider.cut(this.left, this.slider.hidden ? (this.sides?.[0] ? 100 : 0) : undefined);
  }

  say(words = "") {
    this.said.textContent = words || this.about;
  }

  /** The values under the pointer. */
  point(event) {
    if (!this.values) return;
    const [across, down] = placeIn(this.box, event);
    const one = this.values.find(Boolean);
    const [x, y] = [Math.floor(across * one.width), Math.floor(down * one.height)];
    const found = this.values.map((picture) => picture && valueAt(picture, x, y, this.pair.kind));
    const parts = found.map((value, i) => this.sides[i] && `${this.sides[i]} ${value ? value.map((v) => v.toFixed(2)).join(" ") : "–"}`);
    const error = difference(found[0], found[1], this.pair.kind);
    if (error !== null) parts.push(`difference ${short(error)}${UNITS[this.pair.kind]}`);
    this.say(`${x}, ${y}: ${parts.filter(Boolean).join(" · ")}`);
  }
}

// The page of `splitnerf view`: reads what there is to show, and ties panel, keys and picture together.
import { Cameras } from "./cameras.js";
import { Connection } from "./connection.js";
import { listenForFiles } from "./drop.js";
import { addStyle } from "./elements.js";
import { Final } from "./final.js";
import { Panel } from "./panel.js";
import { Lost, readAsset, readLight, readPhoto, readScene, sendLight } from "./server.js";
import { Training } from "./training.js";
import chartStyle from "uplot/dist/uPlot.min.css";
import shared from "./controls.css";
import style from "./style.css";
import { Viewer } from "./viewer.js";

/** One line at the bottom of the picture; an empty one takes it away. */
function say(words, wrong = false) {
  const line = document.getElementById("said");
  line.textContent = words;
  line.classList.toggle("wrong", wrong);
}

const failed = (error) => say(error.message, true);

/** The assets' lights: gives each the one that the panel names; what comes too late for a newer choice is dropped. */
class Lights {
  constructor(viewer, description) {
    Object.assign(this, { viewer, description, numbers: [] });
  }

  async choose(chosen) {
    if (chosen === this.chosen) return;
    this.chosen = chosen;
    const mine = (this.asked = {});
    const { sources, white } = this.description;
    this.numbers = sources.map((source) => (chosen === "own" ? (source.light ?? white) : Number(chosen)));
    try {
      const textures = await Promise.all(this.numbers.map(readLight));
      if (mine !== this.asked) return;
      this.viewer.views.forEach((view, i) => view.setLight(textures[i]));
      this.viewer.draw();
    } catch (error) {
      if (mine === this.asked) this.chosen = undefined; // so that it can be asked for again
      throw error;
    }
  }

  /** Reads the chosen light anew. */
  async renew(description) {
    this.description = description;
    const { chosen } = this;
    this.chosen = undefined;
    if (chosen !== undefined) await this.choose(chosen);
  }
}

/** The page: what the server has to show, and what of it is shown. */
class Page {
  constructor(description) {
    this.description = description;
    this.state = {}; // that the server tells
    this.viewer = new Viewer(document.getElementById("canvas"), description);
    this.lights = new Lights(this.viewer, description);
    this.final = new Final(this.viewer, () => this.lights.numbers, say, failed);
    this.panel = new Panel(this.viewer, this.marked(description), (values) => this.set(values), (file) => this.opened(file));
    this.cameras = new Cameras(this.viewer, description.cameras); // made after the panel, which says at once what it shows
    this.cameras.changed = (number) => this.panel.setThrough(number);
    this.cameras.failed = (number) => readPhoto(number).catch(failed); // asks again, for the server's words
    this.training = description.training ? new Training(failed) : null;
    document.title = `${description.sources.map((source) => source.name).join(" | ")} – splitnerf ${this.training ? "train" : "view"}`;
    document.getElementById("names").replaceChildren(
      ...description.sources.map((source) => Object.assign(document.createElement("span"), { textContent: source.name })),
    );
    listenForFiles((file) => this.opened(file));
  }

  set(values) {
    this.viewer.set(values);
    this.cameras?.show(values.cameras);
    this.cameras?.look(values.through);
    this.lights.choose(values.light).catch(failed);
    this.final.set(values.final);
  }

  /** The description, where each light says whether it is an asset's own. */
  marked(description) {
    const owners = description.sources.map((source) => source.light);
    for (const light of description.lights) light.own = owners.includes(light.number);
    return description;
  }

  async opened(file) {
    say(`reading ${file.name} …`);
    try {
      const number = await sendLight(file);
      this.panel.showLights(this.marked(await readScene()).lights, number);
      this.panel.tell();
      say("");
    } catch (error) {
      failed(error);
    }
  }

  /** What the server says of itself: a newer asset is loaded, and what could not be loaded before. */
  async heard(state) {
    this.training?.show(state);
    this.state = state;
    await this.loading;
    await this.renew();
    if (state.ended) this.connection.close(`The end: ${state.ended}.`);
  }

  /** Loads what is newer than what is shown; a page that nobody sees waits. */
  async renew() {
    const { version, ended } = this.state;
    const stale = this.viewer.views.some((view, i) => view.version !== (version ?? this.description.sources[i].version));
    if (this.loading || (document.hidden && !ended) || !(stale || this.lights.chosen === undefined)) return;
    this.loading = this.load().finally(() => (this.loading = undefined));
    await this.loading;
  }

  /** Loads assets and lights, as the server now describes them. */
  async load() {
    try {
      const first = this.viewer.views.every((view) => view.version === 0);
      const description = this.marked(await readScene());
      await Promise.all(this.viewer.views.map((view, i) => this.loadInto(view, i, description.sources[i])));
      this.description = description;
      this.panel.showLights(description.lights, this.panel.values.light);
      this.viewer.start = description.camera;
      if (first) this.viewer.home(); // later the camera stays where it is
      if (!first || this.training) await this.lights.renew(description);
      const own = description.sources[0].light;
      if (own !== null) await this.training?.showLight(own);
      this.panel.tell();
      const waits = description.sources.some((source) => source.version === 0);
      say(waits ? "the surface is shown once the training begins" : description.problems.join("\n"), description.problems.length > 0);
    } catch (error) {
      failed(error);
    }
  }

  async loadInto(view, number, source) {
    if (view.version === source.version) return;
    try {
      await view.setAsset(await readAsset(number));
      view.version = source.version;
    } catch (error) {
      if (!(error instanceof Lost)) view.version = source.version; // it would not load the next time either
      throw error;
    }
  }
}

async function start() {
  const page = new Page(await readScene());
  say("loading …");
  await page.load();
  page.connection = new Connection((state) => page.heard(state));
  document.addEventListener("visibilitychange", () => page.renew());
}

export function viewer() {
  addStyle(chartStyle + shared + style);
  return start()
    .catch(failed)
    .finally(() => document.body.classList.add("ready"));
}

// The page of `splitnerf view`: reads what there is to show, and ties panel, keys and picture together.
import { Cameras } from "./cameras.js";
import { listenForFiles } from "./drop.js";
import { Final } from "./final.js";
import { Panel, showLegend } from "./panel.js";
import { readAsset, readDeviations, readLight, readPhoto, readScene, sendLight } from "./server.js";
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
    const { sources, white } = this.description;
    this.numbers = sources.map((source) => (chosen === "own" ? (source.light ?? white) : Number(chosen)));
    const textures = await Promise.all(this.numbers.map(readLight));
    if (chosen !== this.chosen) return;
    this.viewer.views.forEach((view, i) => view.setLight(textures[i]));
    this.viewer.draw();
  }
}

async function start() {
  const description = await readScene();
  const owners = description.sources.map((source) => source.light);
  for (const light of description.lights) light.own = owners.includes(light.number);
  document.title = `${description.sources.map((source) => source.name).join(" | ")} – splitnerf view`;
  document.getElementById("names").replaceChildren(
    ...description.sources.map((source) => Object.assign(document.createElement("span"), { textContent: source.name })),
  );

  const viewer = new Viewer(document.getElementById("canvas"), description);
  const lights = new Lights(viewer, description);
  const final = new Final(viewer, () => lights.numbers, say, failed);
  let cameras; // made after the panel, which says at once what it shows
  const panel = new Panel(description, (values) => {
    viewer.set(values);
    cameras?.show(values.cameras);
    cameras?.look(values.through);
    showLegend(description.uncertainty, values);
    lights.choose(values.light).catch(failed);
    final.set(values.final);
  });
  cameras = new Cameras(viewer, description.cameras);
  cameras.changed = (number) => panel.setThrough(number);
  cameras.failed = (number) => readPhoto(number).catch(failed); // asks again, for the server's words
  panel.listen(viewer);
  document.getElementById("home").addEventListener("click", () => viewer.home());
  listenForFiles(async (file) => {
    say(`reading ${file.name} …`);
    try {
      const number = await sendLight(file);
      const now = await readScene();
      for (const one of now.lights) one.own = owners.includes(one.number);
      panel.setLights(now.lights, number);
      panel.tell();
      say("");
    } catch (error) {
      failed(error);
    }
  });

  say("loading …");
  await Promise.all(
    viewer.views.map(async (view, i) => {
      if (description.sources[i].uncertainty) view.uniforms.deviations.value = await readDeviations(i);
      await view.setAsset(await readAsset(i));
    }),
  );
  say(description.problems.join("\n"), description.problems.length > 0);
  panel.tell();
}

start()
  .catch(failed)
  .finally(() => document.body.classList.add("ready"));

// The page of `splitnerf view`: reads what there is to show, and ties panel, keys and picture together.
import { listenForFiles } from "./drop.js";
import { Panel, showLegend } from "./panel.js";
import { readAsset, readDeviations, readLight, readScene, sendLight } from "./server.js";
import { Viewer } from "./viewer.js";

/** One line at the bottom of the picture; an empty one takes it away. */
function say(words, wrong = false) {
  const line = document.getElementById("said");
  line.textContent = words;
  line.classList.toggle("wrong", wrong);
}

const failed = (error) => say(error.message, true);

/** Gives each asset the light that the panel names; what comes too late for a newer choice is dropped. */
function lightsOf(viewer, description) {
  let wanted;
  return async (chosen) => {
    if (chosen === wanted) return;
    wanted = chosen;
    const own = (i) => description.sources[i].light ?? description.lights.at(-1).number;
    const numbers = viewer.views.map((_, i) => (chosen === "own" ? own(i) : Number(chosen)));
    const textures = await Promise.all(numbers.map(readLight));
    if (chosen !== wanted) return;
    viewer.views.forEach((view, i) => view.setLight(textures[i]));
    viewer.draw();
  };
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
  const light = lightsOf(viewer, description);
  const panel = new Panel(description, (values) => {
    viewer.set(values);
    showLegend(description.uncertainty, values);
    light(values.light).catch(failed);
  });
  panel.listen(viewer);
  listenForFiles(async (file) => {
    say(`reading ${file.name} …`);
    try {
      const number = await sendLight(file);
      const { lights } = await readScene();
      for (const one of lights) one.own = owners.includes(one.number);
      panel.setLights(lights, number);
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

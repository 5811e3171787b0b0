// The script of report.html. The page is whole without it: each part that starts takes the place of the pictures that stand there.
import style from "./style.css";
import chartStyle from "uplot/dist/uPlot.min.css";
import { compare } from "./compare.js";
import { charts } from "./curves.js";
import { lights } from "./light.js";
import { object } from "./object.js";

const data = JSON.parse(document.getElementById("data").textContent);
document.head.append(Object.assign(document.createElement("style"), { textContent: chartStyle + style }));

/** Starts a part of the page where there is one; the section then shows it in place of what is static. */
async function start(selector, part) {
  for (const section of document.querySelectorAll(selector)) {
    try {
      if (await part(section, data)) section.classList.add("live");
    } catch (error) {
      console.error(error);
    }
  }
}

addEventListener("beforeprint", () => {
  for (const details of document.querySelectorAll("details")) details.open = true;
});

Promise.all([start("[data-pairs]", compare), start("#light", lights), start("#training", charts)])
  .then(() => start("#object", object)) // the part that takes longest
  .then(() => document.body.classList.add("ready"));

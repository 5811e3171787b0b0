// The script of report.html. The page is whole without it: each part that starts takes the place of the pictures that stand there.
import chartStyle from "uplot/dist/uPlot.min.css";
import shared from "../view/controls.css";
import { addStyle } from "../view/elements.js";
import style from "./style.css";
import { compare } from "./compare.js";
import { charts } from "./curves.js";
import { lights } from "./light.js";
import { object } from "./object.js";

/** Starts a part of the page where there is one; the section then shows it in place of what is static. */
async function start(selector, part, data) {
  for (const section of document.querySelectorAll(selector)) {
    try {
      if (await part(section, data)) section.classList.add("live");
    } catch (error) {
      console.error(error);
    }
  }
}

export async function report() {
  const data = JSON.parse(document.getElementById("data").textContent);
  addStyle(chartStyle + shared + style);
  addEventListener("beforeprint", () => {
    for (const details of document.querySelectorAll("details")) details.open = true;
  });
  await Promise.all([start("[data-pairs]", compare, data), start("#light", lights, data), start("#training", charts, data)]);
  await start("#object", object, data); // the part that takes longest
  document.body.classList.add("ready");
}

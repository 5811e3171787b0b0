// The panel's part for a run that trains: how far it is, its curves, its light, and its buttons.
import { DataUtils } from "three";
import { Chart } from "./chart.js";
import { encoded } from "./halves.js";
import { press, readCurves, readLight } from "./server.js";

const STAGES = {
  preparation: "Reads the data",
  export: "Exports the asset",
  "refinement": "Refinement: fits asset and light to the photos",
  evaluation: "Scores the asset, which is final",
};
const field = (id) => document.getElementById(id);

export class Training {
  constructor(failed) {
    this.failed = failed;
    this.chart = new Chart(field("chart"));
    field("training").hidden = false;
    field("pause").addEventListener("click", () => this.press(this.state.paused ? "resume" : "pause"));
    field("checkpoint").addEventListener("click", () => this.press("checkpoint"));
    field("stop").addEventListener("click", () => {
      if (confirm("End the training now and deliver what there is? It can be resumed from the command line.")) this.press("stop");
    });
  }

  async press(button) {
    this.pressed = button;
    this.show(this.state);
    await press(button).catch(this.failed);
  }

  /** Shows a state of the server; the curves' new lines are asked for. */
  show(state) {
    this.state = state;
    const { stage, step, steps, progress, left, psnr, paused, saved, ended } = state;
    const trains = stage === "training" && !ended;
    if (this.pressed === "checkpoint" && saved !== this.saved) this.pressed = undefined;
    this.saved = saved;
    const count = steps ? `Step ${step.toLocaleString("en")} of ${steps.toLocaleString("en")}` : `Step ${step.toLocaleString("en")}`;
    field("phase").textContent = ended ? "Ended" : stage === "training" ? (paused ? `${count}, paused` : count) : STAGES[stage];
    field("progress").hidden = !trains;
    field("progress").value = progress;
    const words = [psnr !== null && `PSNR ${psnr.toFixed(2)} dB`, trains && left !== null && `${timeOf(left)} left`, trains && this.saving(saved)];
    field("numbers").textContent = words.filter(Boolean).join(", ");
    field("buttons").hidden = !trains;
    field("pause").textContent = paused ? "Resume" : "Pause";
    field("checkpoint").disabled = this.pressed === "checkpoint";
    field("stop").disabled = this.pressed === "stop";
    this.draw(state.lines).catch(() => {}); // the next state asks again
  }

  saving(saved) {
    if (this.pressed === "stop") return "stops after this step";
    if (this.pressed === "checkpoint") return "saves after this step";
    return saved !== null && `checkpoint of step ${saved.toLocaleString("en")} saved`;
  }

  async draw(count) {
    if (this.drawing || document.hidden || count <= this.chart.lines.length) return;
    this.drawing = true;
    try {
      this.chart.add(await readCurves(this.chart.lines.length));
    } finally {
      this.drawing = false;
    }
  }

  /** Draws the light with this number, brightened or darkened so that its mean is middle grey. */
  async showLight(number) {
    const { data, width, height } = (await readLight(number)).image;
    const values = Float32Array.from(data, DataUtils.fromHalfFloat);
    const mean = values.reduce((sum, value, i) => (i % 4 === 3 ? sum : sum + value), 0) / (3 * width * height);
    const picture = new ImageData(width, height);
    values.forEach((value, i) => (picture.data[i] = i % 4 === 3 ? 255 : 255 * encoded((0.18 * value) / Math.max(mean, 1e-9))));
    Object.assign(field("recovered"), { width, height });
    field("recovered").getContext("2d").putImageData(picture, 0, 0);
  }
}

/** "1:02:03" or "2:03". */
function timeOf(seconds) {
  const whole = Math.round(seconds);
  const parts = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  if (!parts[0]) parts.shift();
  return parts.map((part, i) => (i ? String(part).padStart(2, "0") : String(part))).join(":");
}

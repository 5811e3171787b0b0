// The curves of a training: PSNR at the left, losses at the right, over the steps.
import uPlot from "uplot";

const HEIGHT = 150; // pixels without the legend
const COLOURS = ["#1c7fa8", "#d1495b", "#b5851b", "#5c946e", "#8661c1", "#8f9296", "#c86b98", "#4f6d7a", "#a3623a"];
const name = (key) => key.replace("loss_", "").replaceAll("_", " ").replace("psnr", "PSNR dB");

export class Chart {
  constructor(element) {
    this.element = element;
    this.lines = [];
    new ResizeObserver(() => this.plot?.setSize({ width: element.clientWidth, height: HEIGHT })).observe(element);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.build());
  }

  /** Adds lines of the log; the terms of the loss are those of the first one. */
  add(lines) {
    this.lines.push(...lines);
    if (this.lines.length < 2) return;
    if (!this.plot) this.build();
    this.plot.setData(this.columns());
  }

  columns() {
    const positive = (value) => (value > 0 ? value : null); // a logarithm shows no zeros
    return ["step", ...this.keys].map((key) => this.lines.map((line) => (key === "step" ? line.step : key === "psnr" ? line.psnr : positive(line[key]))));
  }

  build() {
    if (this.lines.length < 2) return;
    this.plot?.destroy();
    this.keys = ["psnr", "loss", ...Object.keys(this.lines.at(-1)).filter((key) => key.startsWith("loss_"))];
    const ink = getComputedStyle(this.element).color;
    const axis = (scale, side, size) => ({
      scale, side, size, stroke: ink, font: "11px system-ui", gap: 3, ticks: { size: 3, stroke: ink, width: 1 }, grid: { show: side !== 1, stroke: "#8883", width: 1 },
    });
    const short = (_, values) => values.map((value) => (value === null ? "" : value >= 1000 ? `${value / 1000}k` : String(value)));
    this.plot = new uPlot(
      {
        width: this.element.clientWidth,
        height: HEIGHT,
        padding: [6, 0, 0, 0],
        scales: { x: { time: false }, loss: { distr: 3 } },
        cursor: { drag: { x: true, y: false } },
        axes: [{ ...axis("x", 2, 22), values: short, space: 40 }, { ...axis("dB", 3, 26), space: 24 }, { ...axis("loss", 1, 40) }],
        series: [
          { label: "step" },
          ...this.keys.map((key, i) => ({
            label: name(key), scale: key === "psnr" ? "dB" : "loss", stroke: COLOURS[i % COLOURS.length], width: 1.5, points: { show: false }, show: i < 2,
            value: (_, value) => (value == null ? "–" : key === "psnr" ? value.toFixed(2) : value.toPrecision(3)),
          })),
        ],
      },
      this.columns(),
      this.element,
    );
  }
}

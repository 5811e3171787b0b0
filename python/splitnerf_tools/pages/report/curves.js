// The curves of the training: values under the pointer, lines that can be switched off, a logarithmic or a linear axis.
import uPlot from "uplot";
import { element, short } from "../view/elements.js";

const HEIGHT = 260;
const DECADES = 8; // of a logarithmic axis, from the largest value down

export function charts(section, { charts: given, colours }) {
  const shown = given.filter(Boolean);
  if (!shown.length) return false;
  const grid = element("div", { class: "grid-cards widget" });
  section.querySelector(".static").after(grid);
  section.classList.add("live"); // a chart takes the width that it has
  const made = shown.map((chart) => new Chart(chart, colours, grid));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => made.forEach((chart) => chart.make()));
  return true;
}

class Chart {
  constructor(chart, colours, grid) {
    Object.assign(this, { chart, colours });
    this.log = chart.log;
    this.hidden = new Set();
    this.tip = element("div", { class: "tip", hidden: true });
    this.place = element("div", { class: "plot" });
    const switched = element("input", { type: "checkbox", checked: this.log, onchange: () => this.make(switched.checked) });
    const axis = element("label", { class: "axis" }, switched, " logarithmic");
    this.figure = element("figure", { class: "chart" }, element("figcaption", {}, chart.title, axis), this.place);
    grid.append(this.figure);
    this.make();
    new ResizeObserver(() => this.plot.setSize({ width: this.place.clientWidth, height: HEIGHT })).observe(this.place);
  }

  make(log = this.log) {
    this.log = log;
    this.plot?.destroy();
    const style = getComputedStyle(document.documentElement);
    const axis = { stroke: style.getPropertyValue("--dim"), grid: { stroke: style.getPropertyValue("--line"), width: 1 }, ticks: { show: false } };
    const { x, series } = this.chart;
    const values = series.map((one) => (log ? one.values.map((value) => (value > 0 ? value : null)) : one.values));
    const options = {
      width: this.place.clientWidth,
      height: HEIGHT,
      scales: { x: { time: false }, y: log ? { distr: 3, range: (_, low, high) => decades(low, high) } : {} },
      axes: [
        { ...axis, values: (_, ticks) => ticks.map((tick) => (tick >= 1000 ? `${tick / 1000}k` : tick)) },
        { ...axis, size: 56, values: (_, ticks) => ticks.map((tick) => (tick == null ? "" : short(tick))) },
      ],
      series: [
        { label: "step" },
        ...series.map(({ name }, i) => ({
          label: name, stroke: this.colour(i), width: 1.8, spanGaps: true, show: !this.hidden.has(name), points: { show: x.length < 3 },
        })),
      ],
      cursor: { drag: { x: true, y: false }, points: { size: 6 } },
      legend: { show: series.length > 1, live: false },
      hooks: {
        setCursor: [(plot) => this.point(plot)],
        setSeries: [(plot, number, change) => number > 0 && "show" in change && this.keep(series[number - 1].name, change.show)],
      },
    };
    this.plot = new uPlot(options, [x, ...values], this.place);
    this.plot.over.append(this.tip);
  }

  colour(number) {
    return this.colours[number % this.colours.length];
  }

  keep(name, shown) {
    if (shown) this.hidden.delete(name);
    else this.hidden.add(name);
  }

  /** The values at the pointer, beside it. */
  point(plot) {
    const { idx, left } = plot.cursor;
    this.tip.hidden = idx == null || left < 0;
    if (this.tip.hidden) return;
    const rows = plot.series.slice(1).flatMap((line, i) => {
      const value = plot.data[i + 1][idx];
      if (!line.show || value == null) return [];
      return [element("div", {}, element("i", { style: `background:${this.colour(i)}` }), `${line.label} ${short(value, 4)}`)];
    });
    this.tip.replaceChildren(element("b", {}, `step ${Math.round(plot.data[0][idx])}`), ...rows);
    const right = left > plot.over.clientWidth / 2;
    Object.assign(this.tip.style, { left: right ? "" : `${left + 12}px`, right: right ? `${plot.over.clientWidth - left + 12}px` : "" });
  }
}

/** The ends of a logarithmic axis: whole decades, not more than are of use. */
function decades(low, high) {
  if (!(high > 0)) return [0.1, 1];
  const top = Math.ceil(Math.log10(high) - 1e-9);
  const bottom = Math.max(Math.floor(Math.log10(low) + 1e-9), top - DECADES);
  return [10 ** Math.min(bottom, top - 1), 10 ** top];
}

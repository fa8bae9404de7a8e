// What a simulated program did: a plot of the motion, and the instructions along its time.

import { h, replace, setText, shown } from "./dom.js";
import { decimals } from "./store.js";

/** An SMSD counts its position in sixteenths of a full step. */
const MICROSTEPS = 16;
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** Shows the answer of a simulation in `root`; `goTo` is called with a line of the text that somebody chose. */
export function mountTimeline(root, answer, goTo, axis) {
  const place = h("div", { class: "plot small", role: "img", "aria-label": "Simulated position and speed over time" });
  const rows = h("tbody", {});
  const now = h("output", { class: "mono" });
  const inUnit = (steps) => steps / (axis.steps_per_unit || 1);
  const toLine = (number, label, title) => h("button", { type: "button", class: "plain small mono bare", title, onclick: () => goTo(number) }, label);
  replace(root, h("h2", {}, "Simulation"),
    h("p", { role: "status", id: "simulated" }, answer.end, answer.end_line ? [", ", toLine(answer.end_line, `line ${answer.end_line}`, "Shows it in the text")] : "",
      answer.cut ? " (only the first steps are shown)" : ""),
    place, now,
    h("div", { class: "scroll short" }, h("table", {},
      h("thead", {}, h("tr", {}, ["Time", "Line", "Instruction", `Position, ${axis.unit}`, `Speed, ${axis.unit}/s`, "Inputs"].map((head) => h("th", { scope: "col" }, head)))), rows)));
  replace(rows, answer.steps.map((step) => h("tr", {},
    h("td", { class: "mono" }, `${step.t.toFixed(4)} s`),
    h("td", {}, step.source_line ? toLine(step.source_line, String(step.source_line), `mem${step.mem}:${step.line}`) : ""),
    h("td", { class: "mono" }, step.text),
    h("td", { class: "mono", title: `ABS_POS ${step.position}` }, shown(inUnit(step.position / MICROSTEPS), decimals(axis))),
    h("td", { class: "mono" }, shown(inUnit(step.speed), decimals(axis))),
    h("td", { class: "mono" }, step.inputs.join(" ")))));

  const columns = [(row) => row[0], (row) => inUnit(row[1] / MICROSTEPS), (row) => inUnit(row[2])].map((of) => answer.curve.map(of));
  const told = (unit) => (_, value) => (value === null || value === undefined ? "–" : `${shown(value, decimals(axis))} ${unit}`);
  const grid = { stroke: colour("--plot-grid"), width: 1 };
  const plot = new uPlot({
    width: Math.max(200, place.clientWidth), height: 220,
    scales: { x: { time: false }, p: {}, v: {} },
    axes: [
      { stroke: colour("--plot-axis"), grid, ticks: grid, values: (_, ticks) => ticks.map((tick) => `${tick} s`) },
      { scale: "p", stroke: colour("--plot-position"), size: 70, grid, ticks: grid },
      { scale: "v", side: 1, stroke: colour("--plot-speed"), size: 70, grid: { show: false }, ticks: grid },
    ],
    series: [{ label: "time", value: (_, value) => (value === null || value === undefined ? "–" : `${value.toFixed(3)} s`) },
      { label: "position", value: told(axis.unit), scale: "p", stroke: colour("--plot-position"), width: 1.6, points: { show: false } },
      { label: "speed", value: told(`${axis.unit}/s`), scale: "v", stroke: colour("--plot-speed"), width: 1.6, points: { show: false } }],
    hooks: { setCursor: [(drawn) => {
      const at = drawn.cursor.idx === null || drawn.cursor.idx === undefined ? null : columns[0][drawn.cursor.idx];
      const step = at === null ? null : answer.steps.findLast((one) => one.t <= at);
      setText(now, step ? `${at.toFixed(3)} s: ${step.text}` : "");
    }] },
  }, columns, place);
  const resized = new ResizeObserver(() => plot.setSize({ width: Math.max(200, place.clientWidth), height: 220 }));
  resized.observe(place);
  place.setAttribute("aria-label", `Simulated position and speed of ${axis.name}: ${answer.end}`);
  return () => {
    resized.disconnect();
    plot.destroy();
  };
}

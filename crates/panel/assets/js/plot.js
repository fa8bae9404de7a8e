// The plot of position and speed: what came since the page was opened, up to an hour of it.

import { h, replace, setText } from "./dom.js";
import * as store from "./store.js";

/** Full rate for so long; for the rest a sample every COARSE_S. */
const FINE_S = 130;
const COARSE_S = 0.4;
const LONGEST_S = 3600;
const WINDOWS = [[10, "10 s"], [60, "60 s"], [300, "5 min"], [1200, "20 min"], [3600, "1 h"]];

/** What was seen of each drive, by name; it stays while the page is open. */
const histories = new Map();

class History {
  constructor() {
    this.fine = [[], [], []];
    this.coarse = [[], [], []];
    this.offset = null;
  }

  add(time, position, speed) {
    push(this.fine, [time, position, speed], FINE_S);
    const last = this.coarse[0].at(-1);
    if (last === undefined || time - last >= COARSE_S) push(this.coarse, [time, position, speed], LONGEST_S);
  }

  /** The columns of the last `seconds`. */
  columns(seconds) {
    return seconds <= FINE_S - 10 ? this.fine : this.coarse;
  }
}

function push(columns, values, most) {
  for (const [column, value] of values.entries()) columns[column].push(value);
  // Cut in larger pieces, so that not every sample moves all.
  const times = columns[0];
  if (times.at(-1) - times[0] > most * 1.2) {
    const first = times.findIndex((time) => time >= times.at(-1) - most);
    for (const column of columns) column.splice(0, first);
  }
}

/** Keeps a sample of the focused drive. */
function remember(now) {
  if (now.b & (store.BIT.LOST | store.BIT.UNREAD)) return;
  let history = histories.get(now.name);
  if (!history) histories.set(now.name, history = new History());
  history.offset ??= Date.now() / 1000 - now.t / 1000;
  const time = history.offset + now.t / 1000;
  const last = history.fine[0].at(-1);
  // After a restart of the server its time begins anew.
  if (last !== undefined && time < last) {
    history.offset = Date.now() / 1000 - now.t / 1000;
    return;
  }
  history.add(time, now.p, now.v);
}
const keeper = () => {};
keeper.sample = remember;
store.watch("focus", keeper);

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** Shows the plot of `context.axis` in `root`. */
export function mountPlot(root, context) {
  const { axis } = context;
  let seconds = 60;
  let paused = false;
  let plot = null;
  const place = h("div", { class: "plot", role: "img", "aria-label": `Position and speed of ${axis.name} over time` });
  const choice = h("select", { "aria-label": "Time that is shown", onchange: () => { seconds = Number(choice.value); draw(true); } },
    WINDOWS.map(([value, label]) => h("option", { value: String(value), selected: value === seconds }, label)));
  const pause = h("button", { type: "button", id: "plot-pause", "aria-pressed": "false", onclick: () => {
    paused = !paused;
    pause.setAttribute("aria-pressed", String(paused));
    setText(pause, paused ? "Go on" : "Pause");
    if (!paused) draw(true);
  } }, "Pause");
  const hint = h("small", {}, "Drag to zoom, double-click to see all.");
  replace(root,
    h("div", { class: "row spread" }, h("h2", {}, "Plot"),
      h("div", { class: "row" }, choice, pause, h("button", { type: "button", id: "plot-csv", onclick: save }, "Export CSV"))),
    place, hint);

  const history = () => histories.get(axis.name) ?? new History();

  function make() {
    plot?.destroy();
    const line = (label, unit, scale, stroke) => ({ label, scale, stroke, width: 1.6, points: { show: false },
      value: (_, value) => (value === null || value === undefined ? "–" : `${value.toFixed(3)} ${unit}`) });
    const grid = { stroke: colour("--plot-grid"), width: 1 };
    const along = (scale, stroke, side, show) => ({ scale, stroke, side, size: 64, grid: show ? grid : { show: false }, ticks: grid });
    plot = new uPlot({
      width: Math.max(200, place.clientWidth), height: 260,
      cursor: { drag: { x: true, y: false, setScale: true } },
      scales: { x: { time: true }, p: {}, v: {} },
      axes: [
        { stroke: colour("--plot-axis"), grid, ticks: grid },
        along("p", colour("--plot-position"), 3, true),
        along("v", colour("--plot-speed"), 1, false),
      ],
      series: [{}, line("position", axis.unit, "p", colour("--plot-position")), line("speed", `${axis.unit}/s`, "v", colour("--plot-speed"))],
      hooks: { setSelect: [(drawn) => { if (drawn.select.width > 4 && !paused) pause.click(); }] },
    }, history().columns(seconds), place);
  }

  function draw(again = false) {
    if (!plot || (paused && !again)) return;
    const columns = history().columns(seconds);
    plot.batch(() => {
      plot.setData(columns, false);
      const last = columns[0].at(-1) ?? Date.now() / 1000;
      plot.setScale("x", { min: last - seconds, max: last });
    });
  }

  /** Gives what is kept as a file: full rate for the last two minutes, then coarser. */
  function save() {
    const { fine, coarse } = history();
    const begin = fine[0][0] ?? Infinity;
    const rows = [];
    for (const [columns, wanted] of [[coarse, (time) => time < begin], [fine, () => true]]) {
      for (const [row, time] of columns[0].entries()) {
        if (wanted(time)) rows.push(`${new Date(time * 1000).toISOString()},${time.toFixed(3)},${columns[1][row]},${columns[2][row]}`);
      }
    }
    const head = `time,unix_s,position_${axis.unit},speed_${axis.unit}_per_s`;
    const url = URL.createObjectURL(new Blob([`${head}\n${rows.join("\n")}\n`], { type: "text/csv" }));
    h("a", { href: url, download: `${axis.name}.csv` }).click();
    setTimeout(() => URL.revokeObjectURL(url), 1000);
  }

  make();
  const resized = new ResizeObserver(() => plot?.setSize({ width: Math.max(200, place.clientWidth), height: 260 }));
  resized.observe(place);
  const themed = () => make();
  document.addEventListener("theme", themed);
  const scheme = matchMedia("(prefers-color-scheme: dark)");
  scheme.addEventListener("change", themed);
  const end = store.watch("focus", () => draw());
  return () => {
    end();
    resized.disconnect();
    document.removeEventListener("theme", themed);
    scheme.removeEventListener("change", themed);
    plot?.destroy();
  };
}

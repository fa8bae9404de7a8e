// The plot of position and speed: what came since the page was opened, up to an hour of it.

import { h, replace, setText } from "./dom.js";
import * as store from "./store.js";

/** Full rate for so long; for the rest a sample every COARSE_S. */
const FINE_S = 130;
const COARSE_S = 0.4;
const LONGEST_S = 3600;
/** Samples come twice a second at least; where there were none for so long, nothing is known. */
const SILENCE_S = 3;
const HEIGHT_PX = 250;
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
    // A gap is kept however short it was.
    if (last === undefined || position === null || time - last >= COARSE_S) push(this.coarse, [time, position, speed], LONGEST_S);
  }

  /** Nothing is known from here on. */
  gap() {
    const last = this.fine[0].at(-1);
    if (last !== undefined && this.fine[1].at(-1) !== null) this.add(last + 1e-3, null, null);
  }

  /** The columns of the last `seconds`. */
  columns(seconds) {
    return seconds <= FINE_S - 10 ? this.fine : this.coarse;
  }

  /** What there is now; it does not grow. */
  copy() {
    const copy = new History();
    copy.fine = this.fine.map((column) => column.slice());
    copy.coarse = this.coarse.map((column) => column.slice());
    return copy;
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
  let history = histories.get(now.name);
  if (now.b & (store.BIT.LOST | store.BIT.UNREAD)) return history?.gap();
  if (!history) histories.set(now.name, history = new History());
  history.offset ??= Date.now() / 1000 - now.t / 1000;
  let time = history.offset + now.t / 1000;
  const last = history.fine[0].at(-1) ?? 0;
  if (time - last > SILENCE_S) history.gap();
  // After a restart of the server its time begins anew.
  if (time < last) {
    history.gap();
    history.offset = Math.max(Date.now() / 1000, last + 0.01) - now.t / 1000;
    time = history.offset + now.t / 1000;
  }
  history.add(time, now.p, now.v);
  return undefined;
}
const keeper = () => {};
keeper.sample = remember;
store.watch("focus", keeper);
store.watch("link", (up) => {
  if (!up) for (const history of histories.values()) history.gap();
});

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const clock = (_, times) => times.map((time) => new Date(time * 1000).toTimeString().slice(0, 8));

/** The range of a scale: what is seen and a little more, and never so little that noise fills it. */
const range = (least) => (_, low, high) => {
  if (low === null || low === undefined) return [-least / 2, least / 2];
  const missing = Math.max(0, least - (high - low)) / 2;
  const margin = Math.max((high - low) * 0.06, least * 0.06);
  return [low - missing - margin, high + missing + margin];
};

/** Shows the plot of `context.axis` in `root`. */
export function mountPlot(root, context) {
  const { axis } = context;
  let seconds = 60;
  /** What is looked at while it is paused. */
  let frozen = null;
  let plot = null;
  const place = h("div", { class: "plot zoomable", role: "img", "aria-label": `Position and speed of ${axis.name} over time` });
  const choice = h("select", { id: "plot-window", "aria-label": "Time that is shown", onchange: () => { seconds = Number(choice.value); draw(true); } },
    WINDOWS.map(([value, label]) => h("option", { value: String(value), selected: value === seconds }, label)));
  const pause = h("button", { type: "button", id: "plot-pause", class: "small", "aria-pressed": "false", onclick: () => freeze(frozen === null) }, "Pause");
  const history = () => frozen ?? histories.get(axis.name) ?? new History();

  function freeze(on) {
    frozen = on ? history().copy() : null;
    pause.setAttribute("aria-pressed", String(on));
    setText(pause, on ? "Go on" : "Pause");
    if (on) plot.setData(history().columns(seconds), false);
    else draw(true);
  }

  replace(root,
    h("div", { class: "row spread" }, h("h2", {}, "Plot"),
      h("div", { class: "row" }, h("small", { class: "wide-only" }, "Drag to zoom, double-click for all."), choice, pause,
        h("button", { type: "button", id: "plot-csv", class: "small", onclick: save }, "Export CSV"))),
    place);

  function make() {
    plot?.destroy();
    const line = (label, unit, scale, stroke) => ({ label, scale, stroke, width: 1.6, points: { show: false },
      value: (_, value) => (value === null || value === undefined ? "–" : `${value.toFixed(store.decimals(axis))} ${unit}`) });
    const grid = { stroke: colour("--plot-grid"), width: 1 };
    const along = (scale, stroke, side, show) => ({ scale, stroke, side, size: 64, grid: show ? grid : { show: false }, ticks: grid });
    const step = 1 / Math.abs(axis.steps_per_unit || 1);
    plot = new uPlot({
      width: Math.max(200, place.clientWidth), height: HEIGHT_PX,
      cursor: { drag: { x: true, y: false, setScale: true } },
      scales: { x: { time: true }, p: { range: range(10 * step) }, v: { range: range(20 * step) } },
      axes: [
        { stroke: colour("--plot-axis"), grid, ticks: grid, values: clock, space: 80 },
        along("p", colour("--plot-position"), 3, true),
        along("v", colour("--plot-speed"), 1, false),
      ],
      series: [{ label: "time", value: (_, time) => (time === null || time === undefined ? "–" : clock(_, [time])[0]) },
        line("position", axis.unit, "p", colour("--plot-position")), line("speed", `${axis.unit}/s`, "v", colour("--plot-speed"))],
      // Before the zoom itself: what is zoomed into must not run away.
      hooks: { setSelect: [(drawn) => { if (drawn.select.width > 4 && frozen === null) freeze(true); }] },
    }, history().columns(seconds), place);
    draw(true);
  }

  function draw(again = false) {
    if (!plot || (frozen && !again)) return;
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
        if (wanted(time) && columns[1][row] !== null) rows.push(`${new Date(time * 1000).toISOString()},${time.toFixed(3)},${columns[1][row]},${columns[2][row]}`);
      }
    }
    const head = `time,unix_s,position_${axis.unit},speed_${axis.unit}_per_s`;
    const url = URL.createObjectURL(new Blob([`${head}\n${rows.join("\n")}\n`], { type: "text/csv" }));
    h("a", { href: url, download: `${axis.name}.csv` }).click();
    setTimeout(() => URL.revokeObjectURL(url), 1000);
  }

  make();
  const resized = new ResizeObserver(() => plot?.setSize({ width: Math.max(200, place.clientWidth), height: HEIGHT_PX }));
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

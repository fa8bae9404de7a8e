// The plot of position and speed: what came since the page was opened, up to an hour of it.

import { h, replace, setText } from "./dom.js";
import { roundValues } from "./mechanism.js";
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

/* Position and speed have a band each, one above the other, so that neither line hides the other. */

/** The part of the height that each has, from the top and from the bottom. */
const BANDS = { p: { share: 0.62, top: true }, v: { share: 0.3, top: false } };
/** A tick with its number wants so much. */
const TICK_PX = 24;
/** How wide the numbers beside the plot are. */
const AXIS_PX = 64;

/** How a scale is laid into its band: what is seen and a little more, and never so little that noise fills it. */
function makeBand({ share, top }, least, withZero) {
  let ends = [-least / 2, least / 2];
  return {
    range(_, seenLow, seenHigh) {
      if (seenLow !== null && seenLow !== undefined) {
        const [low, high] = withZero ? [Math.min(0, seenLow), Math.max(0, seenHigh)] : [seenLow, seenHigh];
        const missing = Math.max(0, least - (high - low)) / 2;
        const margin = Math.max((high - low) * 0.06, least * 0.06);
        ends = [low - missing - margin, high + missing + margin];
      }
      const height = (ends[1] - ends[0]) / share;
      return top ? [ends[1] - height, ends[1]] : [ends[0], ends[0] + height];
    },
    ticks: () => roundValues(...ends, Math.max(1, (HEIGHT_PX * share) / TICK_PX)),
  };
}

/** Shows the plot of `context.axis` in `root`. */
export function mountPlot(root, context) {
  const { axis } = context;
  let seconds = 60;
  /** What is looked at while it is paused, and whether that is for a zoom. */
  let frozen = null;
  let zoomed = false;
  let plot = null;
  const place = h("div", { class: "plot zoomable", role: "img", "aria-label": `Position and speed of ${axis.name} over time` });
  const choice = h("select", { id: "plot-window", "aria-label": "Time that is shown", onchange: () => { seconds = Number(choice.value); reset(); } },
    WINDOWS.map(([value, label]) => h("option", { value: String(value), selected: value === seconds }, label)));
  const pause = h("button", { type: "button", id: "plot-pause", class: "small", "aria-pressed": "false", onclick: () => freeze(frozen === null) }, "Pause");
  const whole = h("button", { type: "button", id: "plot-reset", class: "small", hidden: true, onclick: () => reset() }, "Reset zoom");
  const legend = makeLegend(axis);
  const history = () => frozen ?? histories.get(axis.name) ?? new History();

  function freeze(on) {
    frozen = on ? history().copy() : null;
    pause.setAttribute("aria-pressed", String(on));
    setText(pause, on ? "Resume" : "Pause");
    if (on) return plot.setData(history().columns(seconds), false);
    return reset();
  }

  /** Shows all of the time that is chosen. */
  function reset() {
    zoomed = false;
    whole.hidden = true;
    draw(true);
  }

  /** What is zoomed into must not run away. */
  function zoom(drawn) {
    if (drawn.select.width <= 4) return;
    if (frozen === null) freeze(true);
    zoomed = true;
    whole.hidden = false;
  }

  replace(root,
    h("div", { class: "row spread" }, h("h2", {}, "Plot"),
      h("div", { class: "row" }, h("small", { class: "wide-only" }, "Drag to zoom."), whole, choice, pause,
        h("button", { type: "button", id: "plot-csv", class: "small", onclick: save }, "Export CSV"))),
    legend.element, place);

  function make() {
    plot?.destroy();
    const step = 1 / Math.abs(axis.steps_per_unit || 1);
    const bands = { p: makeBand(BANDS.p, 10 * step, false), v: makeBand(BANDS.v, 20 * step, true) };
    const grid = { stroke: colour("--plot-grid"), width: 1 };
    const along = (scale, stroke) => ({ scale, stroke, side: 3, size: AXIS_PX, grid, ticks: { show: false }, splits: bands[scale].ticks, values: (_, values) => values.map(String) });
    const line = (scale, stroke) => ({ scale, stroke, width: 1.6, points: { show: false } });
    plot = new uPlot({
      width: Math.max(200, place.clientWidth), height: HEIGHT_PX, legend: { show: false },
      cursor: { drag: { x: true, y: false, setScale: true }, bind: { dblclick: () => () => { reset(); return null; } } },
      scales: { x: { time: true }, p: { range: bands.p.range }, v: { range: bands.v.range } },
      axes: [
        { stroke: colour("--plot-axis"), grid, ticks: grid, values: clock, space: 80, size: 34 },
        along("p", colour("--plot-position")),
        // In the same place as that of the position: each has its numbers in its band.
        { ...along("v", colour("--plot-speed")), size: 0, gap: 5 - AXIS_PX },
      ],
      series: [{}, line("p", colour("--plot-position")), line("v", colour("--plot-speed"))],
      hooks: { setSelect: [zoom], setCursor: [tell] },
    }, history().columns(seconds), place);
    draw(true);
  }

  /** Tells the values at the cursor, or else the last. */
  function tell() {
    const columns = plot.data;
    const row = plot.cursor.idx ?? columns[0].length - 1;
    legend.show(columns[0][row], columns[1][row], columns[2][row]);
  }

  function draw(again = false) {
    if (!plot || ((frozen || zoomed) && !again)) return;
    const columns = history().columns(seconds);
    plot.batch(() => {
      plot.setData(columns, false);
      const last = columns[0].at(-1) ?? Date.now() / 1000;
      plot.setScale("x", { min: last - seconds, max: last });
    });
    tell();
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

/** The names of both lines with their values. */
function makeLegend(axis) {
  const time = h("span", { class: "number quiet wide-only" });
  const entry = (name, kind) => {
    const value = h("span", { class: "number" });
    return [h("span", { class: `entry ${kind}` }, h("i", { "aria-hidden": "true" }), `${name} `, value), value];
  };
  const [positionEntry, position] = entry("position", "position");
  const [speedEntry, speed] = entry("speed", "speed");
  const known = (value) => value !== null && value !== undefined;
  return {
    element: h("div", { class: "legend" }, positionEntry, speedEntry, time),
    show(at, p, v) {
      setText(position, known(p) ? store.placeText(axis, p) : "–");
      setText(speed, known(v) ? store.speedText(axis, v) : "–");
      setText(time, known(at) ? clock(null, [at])[0] : "");
    },
  };
}

// Bake-out of an SMD3's motor: temperature, set-point, start and end; limits and homing at a glance.

import { h, replace, setClass, setText, shown } from "./dom.js";
import { api, ofAxis } from "./net.js";
import * as store from "./store.js";

const MOST_S = 6 * 3600;
const EVERY_S = 1;
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** Temperatures that were seen, by name of the drive: times, temperatures, set-points. */
const seen = new Map();

const keeper = () => {};
keeper.sample = (now) => {
  const warm = now.q?.TMOT;
  if (warm === undefined || now.b & (store.BIT.LOST | store.BIT.UNREAD)) return;
  let columns = seen.get(now.name);
  if (!columns) seen.set(now.name, columns = [[], [], []]);
  const time = Date.now() / 1000;
  if (time - (columns[0].at(-1) ?? 0) < EVERY_S) return;
  columns[0].push(time);
  columns[1].push(warm);
  columns[2].push(now.q.BAKET ?? null);
  if (columns[0].length > MOST_S * 1.1) for (const column of columns) column.splice(0, column.length - MOST_S);
};
store.watch("focus", keeper);

/** Shows the bake-out of `context.axis` in `root`. */
export function mountBake(root, context) {
  const { axis } = context;
  const warm = h("div", { class: "big number", id: "temperature" }, "–");
  const mode = h("p", { id: "bake-state", role: "status" });
  const set = h("input", { id: "setpoint", type: "text", inputMode: "decimal", value: "150", size: 6 });
  const place = h("div", { class: "plot", role: "img", "aria-label": "Motor temperature over time" });
  const limits = h("div", { class: "lights" });
  const start = () => context.attempt(async () => {
    const setpoint = Number(set.value.trim());
    if (!set.value.trim() || !Number.isFinite(setpoint)) throw new Error("Give the set-point as a number of °C, as in 150");
    await api("POST", ofAxis(axis.name, "/bake"), { setpoint });
    context.notify("good", `${axis.name} bakes towards ${setpoint} °C`);
  });
  const end = () => context.attempt(async () => {
    await api("DELETE", ofAxis(axis.name, "/bake"));
    context.notify("good", `${axis.name} cools`);
  });
  replace(root, h("div", { class: "drive-page" },
    h("section", { class: "card" }, h("h2", {}, "Bake-out"), warm, mode,
      h("div", { class: "field" }, h("label", { for: "setpoint" }, "Set-point, in °C"), set),
      h("div", { class: "row" },
        h("button", { type: "button", class: "primary", id: "bake-start", onclick: start }, "Start baking"),
        h("button", { type: "button", id: "bake-end", onclick: end }, "End baking"))),
    h("section", { class: "card" }, h("h2", {}, "Limits and faults"), limits,
      h("div", { class: "row" },
        h("button", { type: "button", onclick: () => context.attempt(() => api("POST", ofAxis(axis.name, "/clear"), {})) }, "Clear faults")),
      h("p", { class: "quiet" }, "A latched fault stays until its cause is gone and it has been cleared. What each flag means stands on the page of the drive.")),
    h("section", { class: "card wide" }, h("h2", {}, "Motor temperature"), place)));

  let plot = null;
  const make = () => {
    plot?.destroy();
    const grid = { stroke: colour("--plot-grid"), width: 1 };
    const line = (label, stroke, dash, paths) => ({ label, stroke, dash, paths, width: 1.8, points: { show: false }, value: (_, value) => (value === null || value === undefined ? "–" : `${value.toFixed(1)} °C`) });
    plot = new uPlot({
      width: Math.max(200, place.clientWidth), height: 280,
      scales: { y: { range: (_, low, high) => [Math.min(15, Math.floor(low ?? 15)), Math.max(40, Math.ceil((high ?? 40) * 1.05))] } },
      axes: [{ stroke: colour("--plot-axis"), grid, ticks: grid }, { stroke: colour("--plot-axis"), grid, ticks: grid, values: (_, ticks) => ticks.map((tick) => `${tick} °C`), size: 70 }],
      series: [{}, line("motor", colour("--plot-speed")), line("set-point", colour("--plot-position"), [6, 4], uPlot.paths.stepped({ align: 1 }))],
    }, seen.get(axis.name) ?? [[], [], []], place);
  };
  make();
  const resized = new ResizeObserver(() => plot?.setSize({ width: Math.max(200, place.clientWidth), height: 280 }));
  resized.observe(place);
  document.addEventListener("theme", make);

  const lights = new Map();
  const show = (names, now) => {
    for (const name of names) {
      if (!lights.has(name)) {
        const light = h("span", { class: "light" }, name);
        lights.set(name, light);
        limits.append(light);
      }
      setClass(lights.get(name), "on", now.flags[name]);
    }
  };
  let drawn = 0;
  const stop = store.watch("focus", (now) => {
    setText(warm, now.q?.TMOT === undefined ? "–" : `${shown(now.q.TMOT, 1)} °C`);
    const baking = Boolean(now.flags?.BAKE);
    setText(mode, baking ? `baking, set-point ${shown(now.q?.BAKET, 0)} °C` : "not baking");
    show(Object.keys(now.flags ?? {}), now);
    const length = seen.get(axis.name)?.[0].length ?? 0;
    if (length !== drawn) {
      drawn = length;
      plot?.setData(seen.get(axis.name));
    }
  });
  return () => {
    stop();
    resized.disconnect();
    document.removeEventListener("theme", make);
    plot?.destroy();
  };
}

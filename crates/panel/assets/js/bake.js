// An SMD3's bake-out, limits, homing and faults at a glance.

import { h, prose, replace, setClass, setText, shown } from "./dom.js";
import { api, ofAxis } from "./net.js";
import * as store from "./store.js";

const MOST_S = 6 * 3600;
const EVERY_S = 1;
const LEAST_SHOWN_S = 60;
const HEIGHT_PX = 300;
/** So long after a change elsewhere the settings are read again: changes seldom come alone. */
const SOON_MS = 300;
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** Why there is no temperature, as far as the flags tell. */
const brokenSensor = (now) => (now.flags?.TOPEN ? "the temperature sensor is open (TOPEN)" : now.flags?.TSHORT ? "the temperature sensor is short-circuited (TSHORT)" : "");

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
  columns[1].push(brokenSensor(now) ? null : warm);
  columns[2].push(now.q.BAKET ?? null);
  if (columns[0].length > MOST_S * 1.1) for (const column of columns) column.splice(0, column.length - MOST_S);
};
store.watch("focus", keeper);

/** Shows the bake-out of `context.axis` in `root`. */
export function mountBake(root, context) {
  const part = (name, label) => h("section", { class: `card ${name}`, "aria-label": label });
  const [bake, plot, limits, faults] = [part("", "Bake-out"), part("plot-card", "Motor temperature"), part("", "Limits and homing"), part("", "Faults")];
  replace(root, h("div", { class: "drive-page" }, h("div", { class: "column" }, plot, limits), h("div", { class: "column" }, bake, faults)));
  const ends = [mountControl(bake, context), mountTemperature(plot, context), mountLimits(limits, context), mountFaults(faults, context)];
  return () => {
    for (const end of ends) end();
  };
}

function mountControl(root, context) {
  const { axis } = context;
  const warm = h("div", { class: "big number live", id: "temperature" }, "–");
  const sensor = h("p", { class: "error", id: "sensor", role: "status" });
  const mode = h("p", { id: "bake-state", role: "status" });
  const set = h("input", { id: "setpoint", type: "text", inputMode: "decimal", autocomplete: "off", value: "150", size: 6 });
  const start = () => context.attempt(async () => {
    const setpoint = Number(set.value.trim());
    if (!set.value.trim() || !Number.isInteger(setpoint)) throw new Error("Give the set-point as a whole number of °C, as in 150");
    await api("POST", ofAxis(axis.name, "/bake"), { setpoint });
    context.notify("good", `${axis.name} bakes towards ${setpoint} °C`);
  });
  const end = () => context.attempt(async () => {
    await api("DELETE", ofAxis(axis.name, "/bake"));
    context.notify("good", `${axis.name} cools`);
  });
  replace(root, h("h2", {}, "Bake-out"), warm, sensor, mode,
    h("form", { onsubmit: (event) => { event.preventDefault(); start(); } },
      h("div", { class: "field" }, h("label", { for: "setpoint" }, "Set-point, in °C"), set),
      h("div", { class: "pair" },
        h("button", { class: "primary moves", id: "bake-start", title: "Warms the motor through its phases; it does not turn" }, "Start baking"),
        h("button", { type: "button", id: "bake-end", onclick: end }, "End baking"))));
  return store.watch("focus", (now) => {
    const broken = brokenSensor(now);
    setText(warm, broken || now.q?.TMOT === undefined ? "–" : `${shown(now.q.TMOT, 1)} °C`);
    setText(sensor, broken ? `No reading: ${broken}.` : "");
    setText(mode, now.flags?.BAKE ? `baking, set-point ${shown(now.q?.BAKET, 0)} °C` : "not baking");
  });
}

function mountTemperature(root, context) {
  const { axis } = context;
  const place = h("div", { class: "plot", role: "img", "aria-label": `Motor temperature of ${axis.name} over time` });
  replace(root, h("h2", {}, "Motor temperature"), place);
  const columns = () => seen.get(axis.name) ?? [[], [], []];
  let plot = null;
  const make = () => {
    plot?.destroy();
    const grid = { stroke: colour("--plot-grid"), width: 1 };
    const line = (label, stroke, dash) => ({ label, stroke, dash, width: 1.8, points: { show: false }, value: (_, value) => (value === null || value === undefined ? "–" : `${value.toFixed(1)} °C`) });
    const clock = (_, times) => times.map((time) => new Date(time * 1000).toTimeString().slice(0, 8));
    plot = new uPlot({
      width: Math.max(200, place.clientWidth), height: HEIGHT_PX,
      scales: {
        x: { range: (_, low, high) => {
          const end = high ?? Date.now() / 1000;
          return [Math.min(low ?? end, end - LEAST_SHOWN_S), end];
        } },
        y: { range: (_, low, high) => [Math.min(15, Math.floor(low ?? 15)), Math.max(40, Math.ceil((high ?? 40) * 1.05))] },
      },
      axes: [{ stroke: colour("--plot-axis"), grid, ticks: grid, values: clock, space: 80 },
        { stroke: colour("--plot-axis"), grid, ticks: grid, values: (_, ticks) => ticks.map((tick) => `${tick} °C`), size: 70 }],
      series: [{ label: "time", value: (_, time) => (time === null || time === undefined ? "–" : clock(_, [time])[0]) },
        line("motor", colour("--plot-speed")), line("set-point", colour("--plot-position"), [6, 4])],
    }, columns(), place);
  };
  make();
  const resized = new ResizeObserver(() => plot?.setSize({ width: Math.max(200, place.clientWidth), height: HEIGHT_PX }));
  resized.observe(place);
  document.addEventListener("theme", make);
  const scheme = matchMedia("(prefers-color-scheme: dark)");
  scheme.addEventListener("change", make);
  let drawn = 0;
  const end = store.watch("focus", () => {
    const last = columns()[0].at(-1);
    if (last === drawn || last === undefined) return;
    drawn = last;
    plot.setData(columns());
  });
  return () => {
    end();
    resized.disconnect();
    document.removeEventListener("theme", make);
    scheme.removeEventListener("change", make);
    plot?.destroy();
  };
}

/** Both limits, whether they count, and homing towards each. */
function mountLimits(root, context) {
  const { axis } = context;
  const trust = h("p", { class: "trust", role: "status" });
  const problem = h("p", { class: "error", role: "alert" });
  const home = (way) => context.attempt(() => api("POST", ofAxis(axis.name, "/home"), { direction: way }));
  const all = limitSwitch("L", "The limit inputs stop the motor", set);
  const side = (flag, way, words) => {
    const light = h("span", { class: "light" }, flag);
    const enabled = limitSwitch(`L${way}`, "enabled", set);
    const polarity = h("small", {});
    const button = h("button", { type: "button", class: "small moves", id: `home-${words}`, onclick: () => home(way) }, `Home towards ${way === "-" ? "−" : "+"}`);
    return { flag, way, light, enabled, polarity, button, row: h("div", { class: "limit" }, light, h("div", {}, enabled.element, polarity), button) };
  };
  const sides = [side("LIMIT NEGATIVE", "-", "negative"), side("LIMIT POSITIVE", "+", "positive")];
  const why = h("p", { class: "quiet", id: "no-homing" });
  replace(root, h("h2", {}, "Limits and homing"), all.element, sides.map(({ row }) => row), why, problem, trust);

  function show(rows) {
    const value = (name) => rows.find((row) => row.name === name)?.value ?? null;
    all.show(value("L"));
    for (const { way, enabled, polarity, button } of sides) {
      const stops = isOn(value("L")) && isOn(value(`L${way}`));
      enabled.show(value(`L${way}`));
      setText(polarity, `${isOn(value(`LP${way}`)) ? "active low" : "active high"} (LP${way}), ${stops ? "stops the motor" : "stops nothing now"}`);
      button.disabled = !stops;
    }
    setText(why, sides.some(({ button }) => button.disabled) ? "Homing needs a limit that stops the motor." : "");
  }

  async function load() {
    try {
      show((await api("GET", ofAxis(axis.name, "/settings"))).rows);
      setText(problem, "");
    } catch (error) {
      setText(problem, `Which limits count could not be read: ${error.message}`);
    }
  }

  async function set(name, on) {
    await context.attempt(() => api("PUT", ofAxis(axis.name, "/settings"), { set: { [name]: on } }));
    await load();
  }

  let timer;
  let rev;
  const end = store.watch("focus", (now) => {
    for (const { flag, light } of sides) setClass(light, "on", now.flags?.[flag]);
    const trusted = Boolean(now.b & store.BIT.TRUSTED);
    setText(trust, now.b & store.BIT.HOMING ? "homing" : trusted ? "position trusted" : `position not trusted: ${now.doubt ?? "the drive has not been homed"}`);
    setClass(trust, "doubt", !trusted);
    if (rev !== undefined && rev !== now.rev) {
      clearTimeout(timer);
      timer = setTimeout(load, SOON_MS);
    }
    ({ rev } = now);
  });
  load();
  return () => {
    clearTimeout(timer);
    end();
  };
}

/** A switch for the setting that enables a limit. */
function limitSwitch(name, words, set) {
  let on = false;
  const element = h("button", { type: "button", class: "switch", role: "switch", "aria-checked": "false", "data-setting": name, disabled: true,
    onclick: () => set(name, !on) }, words, " ", h("code", {}, name));
  return {
    element,
    /** Shows its value; null while that is not known. */
    show(value) {
      on = isOn(value);
      element.disabled = value === null;
      element.setAttribute("aria-checked", String(on));
    },
  };
}

const isOn = (value) => Number(value) === 1;

/** The faults of the drive: which are latched, what they mean, and how they go away. */
function mountFaults(root, context) {
  const { axis } = context;
  const list = h("ul", { class: "latched" });
  const none = h("p", { class: "good", role: "status" });
  const clear = h("button", { type: "button", onclick: () => context.attempt(async () => {
    await api("POST", ofAxis(axis.name, "/clear"), {});
    context.notify("good", "Faults cleared, as far as their cause is gone");
  }) }, "Clear faults");
  replace(root, h("h2", {}, "Faults"), none, list, clear,
    h("p", { class: "quiet" }, "A fault is latched: it stays until its cause is gone and it has been cleared."));
  let table = [];
  let before = null;
  const show = (now) => {
    const on = table.filter((flag) => now.flags?.[flag.name]);
    const key = on.map((flag) => flag.name).join();
    if (key === before) return;
    before = key;
    setText(none, on.length === 0 ? "None." : "");
    clear.disabled = on.length === 0;
    replace(list, on.map((flag) => h("li", {}, h("strong", { class: "mono" }, flag.name), " ", prose(flag.about), " ", h("small", {}, flag.source))));
  };
  context.attempt(() => api("GET", ofAxis(axis.name))).then((detail) => {
    table = detail?.flags_table.filter((flag) => flag.kind === "error") ?? [];
    before = null;
    if (detail) show(detail);
  });
  return store.watch("focus", (now) => { if (table.length > 0) show(now); });
}

// The rig: its time, and for each drive inputs, supply, front panel, faults and wires. Only virtual drives have one.

import { h, replace, setClass, setText, shown } from "./dom.js";
import { api, follow } from "./net.js";
import * as store from "./store.js";
import { mountClock } from "./clock.js";

/** The rig says only every 15 s that it lives. */
const SILENCE_MS = 20_000;
const LONGEST_MS = 60_000;
/** What faults are called. */
const TITLES = {
  rotor: "Rotor", motor: "Motor", temperature: "Temperature", thermocouple: "Thermocouple", flash: "Flash", connection: "Connections",
  "reply-delay": "Late replies", "reply-drop": "Lost replies", "reply-pieces": "Replies in pieces", "reply-duplicate": "Bytes that come twice",
  "reply-damage": "Damaged replies", "reply-id": "Wrong identifiers", exception: "Exceptions",
};
/** What is asked for of a fault that takes numbers, with its unit, and how the rig reads that. */
const CHANCE = { parts: [{ label: "of all replies", value: "10", unit: "%" }], setting: ([chance]) => `${chance}%` };
const FORMS = {
  "reply-delay": { parts: [{ label: "late by", value: "20", unit: "ms" }, { label: "±", value: "5", unit: "ms" }], setting: ([time, jitter]) => `${time}ms ${jitter}ms` },
  "reply-pieces": { parts: [{ label: "in", value: "3", unit: "pieces" }, { label: "gap", value: "5", unit: "ms" }], setting: ([pieces, gap]) => `${pieces} ${gap}ms` },
  "reply-drop": CHANCE, "reply-duplicate": CHANCE, "reply-damage": CHANCE, "reply-id": CHANCE,
  exception: {
    parts: [{ label: "code", choices: [["04", "04, device failure"], ["06", "06, device busy"]] }, { label: "of all requests", value: "30", unit: "%" }],
    setting: ([code, chance]) => `${code} ${chance}%`,
  },
};
const OF_THE_LINE = /^(connection|reply-|exception)/;
/** The drive that was looked at last; it stays chosen while the page is open. */
let chosen = null;

const drivePath = (name, rest) => `/v1/drives/${encodeURIComponent(name)}/${rest}`;
const section = (label, ...children) => h("section", { class: "card", "aria-label": label }, ...children);

/** Shows the rig in `root`. */
export function mountRig(root, context) {
  const act = (method, path, body) => context.attempt(() => api(method, path, body, { timeout: LONGEST_MS }));
  let rig = null;
  let stream = null;
  const place = { clock: section("Time"), signals: section("Inputs"), faults: section("Faults"), wires: section("Wires") };
  const choice = h("select", { id: "rig-drive", "aria-label": "Drive", onchange: () => choose(choice.value) });
  const one = () => rig?.drives.find((drive) => drive.name === chosen) ?? null;
  const power = h("button", { type: "button", class: "switch", id: "power", role: "switch", "aria-label": "Supply", "aria-checked": "true", onclick: () => {
    const drive = one();
    if (drive) act("PUT", drivePath(drive.name, "power"), { on: !drive.powered });
  } }, "Supply on");
  const words = h("span", { role: "status" });
  const numbers = h("span", { class: "number quiet" });
  const link = h("a", {});
  const missing = h("p", { class: "error", id: "rig-missing", role: "status" });
  replace(root, h("div", { class: "bar" }, h("h1", {}, "Rig"), choice, power, words, numbers, link),
    missing,
    h("div", { class: "rig-page" },
      h("div", { class: "column" }, place.clock, place.signals, place.wires), place.faults));
  const clock = mountClock(place.clock, context, act);
  const signals = mountSignals(place.signals, act);
  const faults = mountFaults(place.faults, act);
  const wires = mountWires(place.wires, act);

  function choose(name) {
    chosen = name;
    choice.value = name;
    link.href = `#/axis/${encodeURIComponent(name)}`;
    setText(link, `Open ${name}`);
    stream?.close();
    rig = null;
    signals.choose(name);
    faults.choose(name);
    stream = follow(`/v1/events?drive=${encodeURIComponent(name)}&every=100ms`, { state: (event) => { rig = event; update(); } }, heard, SILENCE_MS);
  }

  /** Shows whether the rig is heard, and why not. */
  function heard(up, error) {
    if (up) setText(missing, "");
    else if (error?.status) setText(missing, `What the rig does cannot be followed: ${error.message}`);
    else if (!missing.textContent) setText(missing, "The server is not heard; this is what the rig said last.");
    setClass(root, "stale", !up);
    clock.link(up);
  }

  const offer = () => {
    const names = store.axes.filter((axis) => axis.virtual).map((axis) => axis.name);
    if (names.length === 0 || names.join() === [...choice.options].map((option) => option.value).join()) return;
    replace(choice, names.map((name) => h("option", { value: name }, name)));
    choose(names.includes(chosen) ? chosen : names[0]);
  };

  function update() {
    clock.update(rig);
    wires.update(rig.wires);
    const drive = one();
    if (!drive) return;
    setText(words, drive.stalled ? `${drive.state}, stalled` : drive.state);
    setText(numbers, `carriage at ${shown(drive.carriage, 2)} full steps, ${shown(drive.speed, 1)} full steps/s`);
    setText(power, drive.powered ? "Supply on" : "Supply off");
    power.setAttribute("aria-checked", String(drive.powered));
    signals.update(drive);
    faults.update(drive);
  }

  const end = store.watch("axes", offer);
  offer();
  return () => {
    end();
    stream?.close();
    clock.leave();
    setClass(root, "stale", false);
  };
}

/** Inputs, outputs and the front panel of a drive. */
function mountSignals(root, act) {
  let drive = "";
  const rows = new Map();
  const inputs = h("div", { class: "inputs" });
  const outputs = h("div", { class: "lights" });
  const out = h("div", {}, h("h3", {}, "Outputs"), outputs);
  const mode = h("select", { "aria-label": "Front panel" }, h("option", { value: "LA" }, "LA: commands over LAN"), h("option", { value: "bF" }, "bF: runs a program at power-up"));
  const program = h("select", { "aria-label": "Program of the front panel" }, [0, 1, 2, 3].map((number) => h("option", { value: String(number) }, `program ${number}`)));
  const panel = h("div", {}, h("h3", {}, "Front panel"), h("div", { class: "row" }, mode, program,
    h("button", { type: "button", id: "front-panel", onclick: () => act("PUT", drivePath(drive, "panel"), { mode: mode.value, program: Number(program.value) }) }, "Set")),
    h("small", {}, "It counts from the next power-up on."));
  replace(root, h("h2", {}, "Inputs"),
    h("p", { class: "quiet" }, "Click a signal to force it; “release” gives it back to its switch or wire."), inputs, out, panel);

  function make(name) {
    const row = { level: false };
    const set = (to) => act("PUT", drivePath(drive, `inputs/${encodeURIComponent(name)}`), { set: to });
    const small = (label, to, words) => h("button", { type: "button", class: "small", "aria-label": `${words} ${name}`, onclick: () => set(to) }, label);
    row.light = h("button", { type: "button", class: "light", "data-input": name, onclick: () => set(row.level ? "0" : "1") }, name);
    row.forced = h("small", {});
    row.release = small("release", "release", "Release");
    inputs.append(h("div", { class: "row" }, row.light, small("pulse", "pulse 50ms", "Pulse of 50 ms at"), row.release, row.forced));
    return row;
  }

  return {
    choose(name) {
      drive = name;
      rows.clear();
      replace(inputs);
      panel.hidden = store.axisNamed(name)?.family !== "smsd";
    },
    update(now) {
      for (const [name, input] of Object.entries(now.inputs)) {
        if (!rows.has(name)) rows.set(name, make(name));
        const row = rows.get(name);
        row.level = input.level;
        setClass(row.light, "on", input.level);
        row.light.setAttribute("aria-pressed", String(input.level));
        setText(row.forced, input.forced === null ? "" : `forced ${input.forced ? "on" : "off"}`);
        row.release.hidden = input.forced === null;
      }
      const levels = Object.entries(now.outputs);
      out.hidden = levels.length === 0;
      replace(outputs, levels.map(([name, on]) => h("span", { class: `light${on ? " on" : ""}` }, name, h("span", { class: "visually-hidden" }, on ? " on" : " off"))));
    },
  };
}

/** The faults that a drive can have, each with what it can be set to. */
function mountFaults(root, act) {
  let all = [];
  let drive = "";
  const rows = new Map();
  const lists = h("div", {});
  replace(root, h("h2", {}, "Faults"), lists);
  act("GET", "/v1/faults").then((answer) => {
    all = answer ?? [];
    list();
  });

  function make(fault) {
    const put = (to) => act("PUT", drivePath(drive, `faults/${encodeURIComponent(fault.name)}`), { setting: to });
    const form = FORMS[fault.name];
    const settings = form ? ["off"] : ["off", ...fault.settings.split("|").map((setting) => setting.trim())];
    const chips = settings.map((setting) => h("button", { type: "button", class: "chip", "data-setting": setting, onclick: () => put(setting) }, setting.replace("-", " ")));
    const now = h("span", { class: "now mono", role: "status" });
    const title = TITLES[fault.name] ?? `Switch at ${fault.name}`;
    const element = h("div", { class: "fault", role: "group", "aria-label": `Fault ${fault.name}`, "data-fault": fault.name },
      h("div", { class: "row" }, h("strong", {}, title), h("code", { class: "quiet" }, fault.name), h("span", { class: "grow" }), now),
      h("p", { class: "quiet" }, `${fault.about[0].toUpperCase()}${fault.about.slice(1)}.`),
      form ? makeForm(fault, form, chips, put) : h("div", { class: "chips" }, chips));
    const show = (setting) => {
      setText(now, setting);
      setClass(element, "on", setting !== "off");
      for (const chip of chips) chip.setAttribute("aria-pressed", String(chip.dataset.setting === setting));
    };
    show(fault.setting);
    rows.set(fault.name, show);
    return element;
  }

  function list() {
    rows.clear();
    const mine = all.filter((fault) => fault.drive === drive);
    const parts = [["Of the machine", mine.filter((fault) => !OF_THE_LINE.test(fault.name))], ["Of its line", mine.filter((fault) => OF_THE_LINE.test(fault.name))]];
    replace(lists, parts.map(([title, faults]) => [h("h3", {}, title), h("div", { class: "faults" }, faults.map(make))]));
  }

  return {
    choose(name) {
      drive = name;
      list();
    },
    update(now) {
      for (const [name, show] of rows) show(now.faults[name] ?? "off");
    },
  };
}

/** Labelled fields for what a fault is to be, with their units. */
function makeForm(fault, { parts, setting }, chips, put) {
  const fields = parts.map((part, at) => {
    const id = `${fault.name}-${at}`;
    const field = part.choices
      ? h("select", { id }, part.choices.map(([value, label]) => h("option", { value }, label)))
      : h("input", { id, type: "text", inputMode: "decimal", autocomplete: "off", size: 4, value: part.value });
    return { field, row: h("span", { class: "part-of" }, h("label", { for: id }, part.label), field, part.unit ? h("small", {}, part.unit) : null) };
  });
  return h("form", { class: "row", onsubmit: (event) => {
    event.preventDefault();
    put(setting(fields.map(({ field }) => field.value.trim())));
  } }, chips, fields.map(({ row }) => row), h("button", { class: "small", "aria-label": `Set ${fault.name}` }, "Set"));
}

/** The wires between the drives of the rig. */
function mountWires(root, act) {
  const list = h("div", {});
  replace(root, h("h2", {}, "Wires"), list);
  let key = "";
  return {
    update(wires) {
      const is = JSON.stringify(wires);
      if (key === is) return;
      key = is;
      replace(list, wires.length === 0 ? h("p", { class: "quiet" }, "This rig has no wires.") : wires.map((wire) => h("div", { class: "row" },
        h("span", { class: `light${wire.level ? " on" : ""}` }, `${wire.from} → ${wire.to}`, h("span", { class: "visually-hidden" }, wire.level ? " on" : " off")),
        h("small", {}, [wire.connected ? "" : "cut", wire.invert ? "inverted" : "", wire.delay_ns ? `after ${wire.delay_ns / 1e6} ms` : ""].filter(Boolean).join(", ")),
        h("button", { type: "button", class: "small", "aria-label": `${wire.connected ? "Cut" : "Mend"} the wire from ${wire.from} to ${wire.to}`,
          onclick: () => act("PUT", "/v1/wires", { from: wire.from, to: wire.to, connected: !wire.connected }) }, wire.connected ? "Cut" : "Mend"))));
    },
  };
}

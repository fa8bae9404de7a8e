// The rig: its time, and for each drive inputs, supply, faults and wires. Only virtual drives have one.

import { h, replace, setClass, setText } from "./dom.js";
import { api, follow } from "./net.js";
import * as store from "./store.js";

const SPEEDS = ["real", "x0.1", "x2", "x10", "x100", "x1000"];
/** The rig says only every 15 s that it lives. */
const SILENCE_MS = 20_000;
/** The drive that was looked at last; it stays chosen while the page is open. */
let chosen = null;

const drivePath = (name, rest) => `/v1/drives/${encodeURIComponent(name)}/${rest}`;

/** Shows the rig in `root`. */
export function mountRig(root, context) {
  let rig = null;
  let faults = [];
  let stream = null;
  const act = (method, path, body) => context.attempt(() => api(method, path, body, { timeout: 60_000 }));

  /* The clock. */
  const now = h("div", { class: "big number", id: "rig-time" }, "–");
  const mode = h("p", { id: "clock", role: "status" });
  const setClock = (to) => act("PUT", "/v1/clock", { mode: to });
  const step = h("input", { id: "step", value: "100ms", size: 7, type: "text", "aria-label": "How far to step" });
  const until = h("input", { id: "until", type: "text", placeholder: "idle, or stage.ABS_POS >= 500", size: 28, "aria-label": "Condition" });
  const speeds = h("div", { class: "row", role: "group", "aria-label": "Speed of time" },
    h("button", { type: "button", id: "pause", onclick: () => setClock("paused") }, "❚❚ Pause"),
    SPEEDS.map((speed) => h("button", { type: "button", "data-mode": speed, onclick: () => setClock(speed) }, speed === "real" ? "▶ Real time" : speed)));
  const clock = h("section", { class: "card", "aria-label": "Time" },
    h("h2", {}, "Time"), now, mode, speeds,
    h("form", { class: "row", onsubmit: (event) => { event.preventDefault(); act("POST", "/v1/clock/step", { for: step.value.trim() }); } },
      h("label", { for: "step" }, "Step"), step, h("button", { id: "do-step" }, "Step")),
    h("form", { class: "row", onsubmit: async (event) => {
      event.preventDefault();
      const answer = await act("POST", "/v1/clock/run-until", { until: until.value.trim() });
      if (answer) context.notify(answer.reached ? "good" : "error", answer.reached ? "Reached; time stands" : "It did not come within an hour of rig time");
    } }, h("label", { for: "until" }, "Run until"), until, h("button", {}, "Run")));

  /* The drive. */
  const choice = h("select", { id: "rig-drive", "aria-label": "Drive", onchange: () => { chosen = choice.value; watchDrive(); } });
  const power = h("button", { type: "button", id: "power", "aria-pressed": "true", onclick: () => {
    const drive = one();
    if (drive) act("PUT", drivePath(drive.name, "power"), { on: !drive.powered });
  } }, "Supply on");
  const words = h("p", { role: "status" });
  const panelMode = h("select", { "aria-label": "Front panel" }, h("option", { value: "LA" }, "LA: commands over LAN"), h("option", { value: "bF" }, "bF: runs a program at power-up"));
  const panelProgram = h("select", { "aria-label": "Program of the front panel" }, [0, 1, 2, 3].map((number) => h("option", { value: String(number) }, `program ${number}`)));
  const panel = h("div", { class: "row", hidden: true }, h("h3", {}, "Front panel"), panelMode, panelProgram,
    h("button", { type: "button", class: "small", id: "front-panel", onclick: () => act("PUT", drivePath(chosen, "panel"), { mode: panelMode.value, program: Number(panelProgram.value) }) }, "Set"),
    h("small", {}, "It counts from the next power-up on."));
  const inputs = h("div", { class: "inputs" });
  const outputs = h("div", { class: "lights" });
  const faultRows = h("div", { class: "faults" });
  const wires = h("div", {});
  replace(root, h("div", { class: "bar" }, h("h1", {}, "Rig"), choice, power, words),
    h("div", { class: "grid" }, clock,
      h("section", { class: "card", "aria-label": "Inputs" }, h("h2", {}, "Inputs"),
        h("p", { class: "quiet" }, "Click a signal to force it; “release” gives it back to its switch or wire."), inputs,
        h("h3", {}, "Outputs"), outputs, panel),
      h("section", { class: "card", "aria-label": "Faults" }, h("h2", {}, "Faults"), faultRows),
      h("section", { class: "card", "aria-label": "Wires" }, h("h2", {}, "Wires"), wires)));

  const one = () => rig?.drives.find((drive) => drive.name === chosen) ?? null;

  function watchDrive() {
    stream?.close();
    rig = null;
    inputRows.clear();
    replace(inputs);
    panel.hidden = store.axisNamed(chosen)?.family !== "smsd";
    showFaults();
    stream = follow(`/v1/events?drive=${encodeURIComponent(chosen ?? "")}&every=100ms`, { state: (event) => { rig = event; update(); } }, () => {}, SILENCE_MS);
  }

  const choose = () => {
    const names = store.axes.filter((axis) => axis.virtual).map((axis) => axis.name);
    if (names.length === 0) return;
    chosen = names.includes(chosen) ? chosen : names[0];
    replace(choice, names.map((name) => h("option", { value: name, selected: name === chosen }, name)));
    watchDrive();
  };

  function update() {
    const { clock: passes } = rig;
    setText(now, `${(rig.now_ns / 1e9).toFixed(3)} s`);
    setText(mode, passes.mode === "paused" ? "Time stands." : `Time passes: ${passes.mode}, reached x${passes.speed_reached.toPrecision(3)}${rig.playing ? `; playing ${rig.playing}` : ""}.`);
    for (const button of speeds.children) {
      const is = (button.dataset.mode ?? "paused") === passes.mode;
      button.setAttribute("aria-pressed", String(is));
    }
    const drive = one();
    if (drive) updateDrive(drive);
    updateWires();
  }

  const inputRows = new Map();
  function updateDrive(drive) {
    setText(words, drive.stalled ? `${drive.state}, stalled` : drive.state);
    setText(power, drive.powered ? "Supply on" : "Supply off");
    power.setAttribute("aria-pressed", String(drive.powered));
    for (const [name, input] of Object.entries(drive.inputs)) {
      if (!inputRows.has(name)) inputRows.set(name, inputRow(drive.name, name));
      const row = inputRows.get(name);
      setClass(row.light, "on", input.level);
      row.light.setAttribute("aria-pressed", String(input.level));
      row.level = input.level;
      setText(row.forced, input.forced === null ? "" : `forced ${input.forced ? "on" : "off"}`);
      row.release.hidden = input.forced === null;
    }
    replace(outputs, Object.entries(drive.outputs).map(([name, on]) => h("span", { class: `light${on ? " on" : ""}` }, name)));
    for (const field of faultRows.querySelectorAll("[data-fault]")) {
      const setting = drive.faults[field.dataset.fault] ?? "off";
      setText(field.querySelector(".now"), setting);
      setClass(field, "on", setting !== "off");
    }
  }

  function inputRow(drive, name) {
    const row = { level: false };
    const set = (to) => act("PUT", drivePath(drive, `inputs/${encodeURIComponent(name)}`), { set: to });
    row.light = h("button", { type: "button", class: "light", "data-input": name, onclick: () => set(row.level ? "0" : "1") }, name);
    row.forced = h("small", {});
    row.release = h("button", { type: "button", class: "plain small", hidden: true, onclick: () => set("release") }, "release");
    inputs.append(h("div", { class: "row" }, row.light, h("button", { type: "button", class: "plain small", onclick: () => set("pulse 50ms") }, "pulse"), row.forced, row.release));
    return row;
  }

  /** The faults that the drive can have, each with its settings. */
  function showFaults() {
    const mine = faults.filter((fault) => fault.drive === chosen);
    replace(faultRows, mine.map((fault) => {
      const setting = h("input", { type: "text", size: 16, value: first(fault.settings), "aria-label": `Setting of ${fault.name}: ${fault.settings}`, list: `settings-${fault.name}` });
      const put = (to) => act("PUT", drivePath(chosen, `faults/${encodeURIComponent(fault.name)}`), { setting: to });
      return h("div", { class: "fault", "data-fault": fault.name },
        h("div", { class: "row" }, h("strong", {}, fault.name), h("span", { class: "now mono" }, fault.setting)),
        h("p", { class: "quiet" }, fault.about, " ", h("code", {}, fault.settings)),
        h("form", { class: "row", onsubmit: (event) => { event.preventDefault(); put(setting.value.trim()); } },
          setting, h("button", { class: "small" }, "Set"), h("button", { type: "button", class: "small", onclick: () => put("off") }, "Off")));
    }));
    if (rig) update();
  }

  function updateWires() {
    const key = JSON.stringify(rig.wires);
    if (wires.dataset.key === key) return;
    wires.dataset.key = key;
    replace(wires, rig.wires.length === 0 ? h("p", { class: "quiet" }, "This rig has no wires.") : rig.wires.map((wire) => h("div", { class: "row" },
      h("span", { class: `light${wire.level ? " on" : ""}` }, `${wire.from} → ${wire.to}`),
      h("small", {}, [wire.invert ? "inverted" : "", wire.delay_ns ? `after ${wire.delay_ns / 1e6} ms` : ""].filter(Boolean).join(", ")),
      h("button", { type: "button", class: "small", onclick: () => act("PUT", "/v1/wires", { from: wire.from, to: wire.to, connected: !wire.connected }) }, wire.connected ? "Cut" : "Connect"))));
  }

  const end = store.watch("axes", choose);
  context.attempt(() => api("GET", "/v1/faults")).then((all) => {
    faults = all ?? [];
    showFaults();
  });
  choose();
  return () => {
    end();
    stream?.close();
  };
}

/** The first of the settings that a fault takes, to begin with. */
const first = (settings) => settings.split("|")[0].trim();

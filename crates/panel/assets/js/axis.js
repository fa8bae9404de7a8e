// The page of one drive: what it is, its stops, and its parts.

import { h, replace, setClass, setText, shown, span, tabs } from "./dom.js";
import * as store from "./store.js";
import { mountDrive } from "./drive.js";
import { mountSettings } from "./settings.js";
import { mountPrograms } from "./programs.js";
import { mountBake } from "./bake.js";

const PARTS = {
  drive: ["Drive", mountDrive, () => true],
  settings: ["Settings", mountSettings, () => true],
  programs: ["Programs", mountPrograms, (axis) => axis.family === "smsd"],
  bake: ["Bake", mountBake, (axis) => axis.family === "smd3"],
};

/** Shows the page of `context.name`, with its part `context.part`. */
export function mountAxis(root, context) {
  let leave = () => {};
  let shownAxis = null;
  const show = () => {
    const axis = store.axisNamed(context.name);
    // The same drive after a reconnection: what a person is at stays as it is.
    if (axis && shownAxis && axis.family === shownAxis.family && axis.target === shownAxis.target) return;
    leave();
    shownAxis = axis;
    leave = axis ? mountKnown(root, { ...context, axis }) : mountUnknown(root, context.name);
  };
  const end = store.watch("axes", show);
  show();
  return () => {
    end();
    leave();
  };
}

function mountUnknown(root, name) {
  const text = store.axes.length === 0 ? "Waiting for the server …" : `There is no drive ${name} here.`;
  replace(root, h("p", { class: "quiet" }, text), h("p", {}, h("a", { href: "#/" }, "All drives")));
  return () => {};
}

function mountKnown(root, context) {
  const { axis, part } = context;
  const [, mount] = PARTS[part] ?? PARTS.drive;
  const lamp = h("span", { class: "lamp", "aria-hidden": "true" });
  const word = h("strong", { role: "status", id: "state" });
  const where = h("span", { class: "number live", id: "place" });
  const model = h("small", {});
  // Which model it is, is known once it has been asked.
  const name = () => setText(model, `${store.axisNamed(axis.name)?.model ?? axis.family.toUpperCase()} at ${axis.target}`);
  name();
  const entries = Object.entries(PARTS).filter(([, [, , fits]]) => fits(axis)).map(([key, [label]]) => [key, label]);
  const go = (key) => context.navigate(`#/axis/${encodeURIComponent(axis.name)}/${key}`);
  const page = h("div", { class: "part", role: "tabpanel", "aria-label": PARTS[part]?.[0] ?? "Drive" });
  replace(root,
    h("section", { class: `axis-head card ${axis.virtual ? "virtual" : "real"}`, "aria-label": "Drive" },
      h("div", { class: "grow" },
        h("div", { class: "row" }, h("h1", {}, axis.name),
          h("span", { class: `badge ${axis.virtual ? "virtual" : "real"}` }, axis.virtual ? "virtual" : "real: moves metal"),
          model),
        h("div", { class: "row" }, lamp, word, where)),
      h("div", { class: "row", role: "group", "aria-label": "Stop" },
        h("button", { type: "button", class: "stop big", id: "stop", title: "Brakes and holds (space bar)", onclick: () => context.stop(axis.name) }, "STOP"),
        h("button", { type: "button", class: "small", title: hardly(axis), onclick: () => context.stop(axis.name, "hard") }, "Stop at once"),
        h("button", { type: "button", class: "small", title: "Brakes, then takes the current off the motor", onclick: () => context.stop(axis.name, "free") }, "Stop and free"))),
    tabs("Parts of this page", entries, part in PARTS ? part : "drive", go),
    page);

  const update = () => {
    const state = store.stateOf(axis) ?? store.stateOf(store.axisNamed(axis.name));
    const [text, kind] = store.words(state);
    lamp.className = `lamp ${kind}`;
    const lost = Boolean(state && state.b & store.BIT.LOST);
    setText(word, lost ? `lost: ${state.w ?? "it does not answer"}; last seen ${span(store.ageOf(state))} ago` : text);
    setClass(root, "stale", lost);
    setText(where, state && !(state.b & store.BIT.UNREAD) ? `${shown(state.p)} ${axis.unit}   ${shown(state.v)} ${axis.unit}/s` : "");
  };
  const ends = [store.watch("states", update), store.watch("axes", name)];
  const clock = setInterval(update, 250);
  const leave = mount(page, context);
  update();
  return () => {
    clearInterval(clock);
    for (const end of ends) end();
    leave();
    setClass(root, "stale", false);
  };
}

const hardly = (axis) => axis.family === "smsd"
  ? "HARD_STOP: stands at once, and holds"
  : "ESTOP: stands at once; the motor is disabled until the fault is cleared";

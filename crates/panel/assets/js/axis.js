// The page of one drive: what it is and where, its stops, and its parts.

import { h, replace, setClass, setText, span, tabs } from "./dom.js";
import * as store from "./store.js";
import { mountDrive } from "./drive.js";
import { mountSettings } from "./settings.js";
import { mountPrograms } from "./programs.js";
import { mountBake } from "./bake.js";

const PARTS = {
  drive: ["Drive", mountDrive, () => true],
  settings: ["Settings", mountSettings, () => true],
  programs: ["Programs", mountPrograms, (axis) => axis.family === "smsd"],
  bake: ["Bake and limits", mountBake, (axis) => axis.family === "smd3"],
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
  const { axis } = context;
  const kind = axis.virtual ? "virtual" : "real";
  const part = PARTS[context.part]?.[2](axis) ? context.part : "drive";
  const [title, mount] = PARTS[part];
  const entries = Object.entries(PARTS).filter(([, [, , fits]]) => fits(axis)).map(([key, [label]]) => [key, label]);
  const go = (key) => context.navigate(`#/axis/${encodeURIComponent(axis.name)}/${key}`);
  const page = h("div", { class: `part ${kind}`, role: "tabpanel", "aria-label": title });
  const head = makeHead(axis, context);
  replace(root, head.element, tabs("Parts of this page", entries, part, go), page);

  const ends = [
    store.watch("states", head.update), store.watch("link", head.update), store.watch("axes", head.name),
    store.watch("focus", head.follow), mount(page, context),
  ];
  const clock = setInterval(head.update, 250);
  head.update();
  return () => {
    clearInterval(clock);
    for (const end of ends) end();
    setClass(root, "stale", false);
  };

  function makeHead() {
    const lamp = h("span", { class: "lamp", "aria-hidden": "true" });
    const word = h("strong", { role: "status", id: "state" });
    const age = h("span", { class: "quiet number", id: "age" });
    const position = h("div", { class: "big number live", id: "position" }, "–");
    const speed = h("div", { class: "number live", id: "speed-now" }, "–");
    const model = h("small", {});
    // Which model it is, is known once it has been asked.
    const name = () => setText(model, `${store.axisNamed(axis.name)?.model ?? axis.family.toUpperCase()} at ${axis.target}`);
    name();
    const element = h("section", { class: `axis-head card ${kind}`, "aria-label": "Drive" },
      h("div", { class: "who" },
        h("div", { class: "row" }, h("h1", {}, axis.name),
          h("span", { class: `badge ${kind}` }, axis.virtual ? "virtual" : "real: moves metal"), model),
        h("p", { class: "state" }, lamp, word, " ", age)),
      h("div", { class: "where" }, position, speed),
      h("div", { class: "stops", role: "group", "aria-label": "Stop" },
        h("button", { type: "button", class: "stop big", id: "stop", title: "Brakes and holds (space bar)", onclick: () => context.stop(axis.name) }, "STOP"),
        h("button", { type: "button", class: "small", title: hardly(axis), onclick: () => context.stop(axis.name, "hard") }, "Stop at once"),
        h("button", { type: "button", class: "small", title: "Brakes, then takes the current off the motor", onclick: () => context.stop(axis.name, "free") }, "Stop and free")));

    const update = () => {
      const state = store.stateOf(store.axisNamed(axis.name) ?? axis);
      const lost = Boolean(state && state.b & store.BIT.LOST);
      if (store.linked === false) {
        lamp.className = "lamp lost";
        setText(word, "not known: the connection to the panel is lost");
        return setText(age, "");
      }
      const [text, is] = store.words(state);
      lamp.className = `lamp ${is}`;
      // The age goes on by itself, and is no news to a screen reader.
      setText(word, lost ? `lost: ${state.w ?? "it does not answer"}` : text);
      setText(age, lost ? `last seen ${span(store.ageOf(state))} ago` : "");
      return setClass(root, "stale", lost);
    };
    const follow = (now) => {
      if (now.b & store.BIT.UNREAD) return;
      setText(position, store.placeText(axis, now.p));
      setText(speed, store.speedText(axis, now.v));
      setClass(position, "doubtful", !(now.b & store.BIT.TRUSTED));
    };
    return { element, update, follow, name };
  }
}

const hardly = (axis) => axis.family === "smsd"
  ? "HARD_STOP: stands at once, and holds"
  : "ESTOP: stands at once; the motor is disabled until the fault is cleared";

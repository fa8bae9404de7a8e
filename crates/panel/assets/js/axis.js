// The page of one drive: what it is and where, its stops, and its parts.

import { h, replace, setClass, setText, tabs } from "./dom.js";
import * as store from "./store.js";
import { api, ofAxis } from "./net.js";
import { mountDrive } from "./drive.js";
import { followRig } from "./mechanism.js";
import { mountSettings } from "./settings.js";
import { mountPrograms } from "./programs.js";
import { mountBake } from "./bake.js";

/** How often what changes by itself is told anew. */
const CLOCK_MS = 250;
const PARTS = {
  drive: ["Drive", mountDrive, () => true],
  settings: ["Settings", mountSettings, () => true],
  programs: ["Programs", mountPrograms, (axis) => axis.family === "smsd"],
  bake: ["Bake and limits", mountBake, (axis) => axis.family === "smd3"],
};

/** What the faults of the controllers are, in a few words; the flags tell more. */
const FAULTS = {
  TSHORT: "sensor short-circuited", TOPEN: "sensor open", TOVR: "motor too hot", "MOTOR SHORT": "phase short-circuited",
  "EXTERNAL DISABLE": "enable input not energised", "EMERGENCY STOP": "stopped at once", "CONFIGURATION ERROR": "stored configuration damaged",
  CMD_ERROR: "a command was refused",
};

/** Shows the page of `context.name`, with its part `context.part`. */
export function mountAxis(root, context) {
  let leave = () => {};
  let shownAxis = null;
  const show = () => {
    const axis = store.axisNamed(context.name);
    // The same drive after a reconnection: what a person is at stays as it is.
    if (axis && shownAxis && isLike(axis, shownAxis)) return;
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

/** Whether two descriptions are of the same axis, whatever has become known of its model. */
const isLike = (one, other) => ["family", "target", "virtual", "unit", "steps_per_unit", "limits"]
  .every((key) => JSON.stringify(one[key]) === JSON.stringify(other[key]));

function mountUnknown(root, name) {
  const text = store.axes.length === 0 ? "Waiting for the server …" : `There is no drive ${name} here.`;
  replace(root, h("p", { class: "quiet" }, text), h("p", {}, h("a", { href: "#/" }, "All drives")));
  return () => {};
}

function mountKnown(root, { axis, ...context }) {
  const rig = followRig(axis, context);
  const kind = axis.virtual ? "virtual" : "real";
  const part = PARTS[context.part]?.[2](axis) ? context.part : "drive";
  const [title, mount] = PARTS[part];
  const entries = Object.entries(PARTS).filter(([, [, , fits]]) => fits(axis)).map(([key, [label]]) => [key, label]);
  const go = (key) => context.navigate(partOf(axis, key));
  const page = h("div", { class: `part ${kind}`, role: "tabpanel", "aria-label": title });
  const head = makeHead(axis, rig, context);
  replace(root, head.element, tabs("Parts of this page", entries, part, go, page), page);

  const update = () => setClass(root, "stale", head.update());
  const ends = [
    store.watch("states", update), store.watch("link", update), store.watch("axes", head.name),
    store.watch("focus", head.follow), rig.watch(head.simulated), rig.close, mount(page, { ...context, axis, rig }),
  ];
  const clock = setInterval(() => {
    // Whether there is a rig may be known late.
    rig.begin();
    update();
  }, CLOCK_MS);
  update();
  return () => {
    clearInterval(clock);
    for (const end of ends) end();
    setClass(root, "stale", false);
  };
}

const MOVES = store.BIT.MOVING | store.BIT.JOGGING | store.BIT.HOMING;

const partOf = (axis, part) => `#/axis/${encodeURIComponent(axis.name)}/${part}`;

/** What the drive is, what it does, where it is, and its stops: the same on all parts of its page. */
function makeHead(axis, rig, context) {
  const kind = axis.virtual ? "virtual" : "real";
  const model = h("small", { class: "model" });
  const time = h("a", { class: "time", href: "#/rig", id: "rig-clock", hidden: true });
  const position = h("div", { class: "big number live", id: "position" }, "–");
  const speed = h("div", { class: "number live", id: "speed-now" }, "–");
  const state = makeState(axis, rig, context);
  const stop = (label, how, props) => h("button", { type: "button", onclick: () => context.stop(axis.name, how), ...props }, label);
  const element = h("section", { class: `axis-head card ${kind}`, "aria-label": "Drive" },
    h("div", { class: "who" },
      h("div", { class: "name" }, h("h1", { title: axis.name }, axis.name),
        h("span", { class: `badge ${kind}` }, axis.virtual ? "virtual" : "real: moves metal"), time, model),
      state.element),
    h("div", { class: "where" }, position, speed),
    h("div", { class: "stops", role: "group", "aria-label": "Stop" },
      stop("STOP", "soft", { class: "stop big", id: "stop", title: "Brakes and holds (space bar)" }),
      stop("Stop at once", "hard", { class: "small", title: hardly(axis) }),
      stop("Stop and free", "free", { class: "small", title: "Brakes, then takes the current off the motor" })));
  // Which model it is, is known once it has been asked.
  const name = () => setText(model, `${store.axisNamed(axis.name)?.model ?? axis.family.toUpperCase()} at ${axis.target}`);
  name();
  return {
    element, name,
    update: state.update,
    follow(now) {
      if (now.b & store.BIT.UNREAD) return;
      setText(position, store.placeText(axis, now.p));
      setText(speed, store.speedText(axis, now.v));
      setClass(position, "doubtful", !(now.b & store.BIT.TRUSTED));
      state.follow(now);
    },
    simulated() {
      const mode = rig.clock?.mode ?? "real";
      time.hidden = mode === "real";
      setText(time, mode === "paused" ? "time paused" : `time ${mode}`);
      state.update();
    },
  };
}

/** The line that says what the drive does. */
function makeState(axis, rig, context) {
  const lamp = h("span", { class: "lamp", "aria-hidden": "true" });
  const word = h("strong", { role: "status", id: "state" });
  const age = h("span", { class: "quiet number", id: "age" });
  const lost = h("span", { class: "doubt", id: "lost-steps" });
  const program = h("a", { id: "program-runs", href: partOf(axis, "programs"), hidden: true });
  const clear = h("button", { type: "button", class: "small", id: "clear-fault", hidden: true, title: "Clears the faults whose cause is gone",
    onclick: () => context.attempt(() => api("POST", ofAxis(axis.name, "/clear"), {})) }, "Clear");
  const show = (text, is, more = {}) => {
    lamp.className = `lamp ${is}`;
    setText(word, text);
    // The age goes on by itself, and is no news to a screen reader.
    setText(age, more.age ?? "");
    clear.hidden = !more.fault;
  };
  let running = null;
  const update = () => {
    const now = store.stateOf(store.axisNamed(axis.name) ?? axis);
    if (store.linked === false) show("not known: the connection to the panel is lost", "lost");
    else if (now && now.b & store.BIT.LOST) show(`lost: ${now.w ?? "it does not answer"}`, "lost", { age: store.lastSeen(now) });
    else if (now && now.b & store.BIT.FAULT) show(`fault: ${(now.e ?? []).map(faultText).join("; ")}`, "fault", { fault: true });
    else if (rig.mechanism?.stalled) show("stalled", "fault");
    else if (running && !(now.b & MOVES)) show("waits", "moving");
    else show(...store.words(now));
    const isLost = store.linked !== false && Boolean(now && now.b & store.BIT.LOST);
    program.hidden = !running || isLost;
    const steps = Math.round(Math.abs(rig.lost()));
    setText(lost, steps > 0 ? `${steps} ${steps === 1 ? "step" : "steps"} lost` : "");
    return isLost;
  };
  return {
    element: h("p", { class: "state" }, lamp, word, clear, age, lost, program),
    update,
    follow(now) {
      running = now.program?.running ? now.program : null;
      if (running) setText(program, `program mem${running.mem}:${running.line} runs`);
      update();
    },
  };
}

const faultText = (name) => (FAULTS[name] ? `${name}, ${FAULTS[name]}` : name);

const hardly = (axis) => axis.family === "smsd"
  ? "HARD_STOP: stands at once, and holds"
  : "ESTOP: stands at once; the motor is disabled until the fault is cleared";

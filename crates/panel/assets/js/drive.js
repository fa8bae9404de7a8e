// What a drive does, and how it is moved.

import { h, replace, setClass, setText, shown } from "./dom.js";
import { api, ofAxis } from "./net.js";
import * as store from "./store.js";
import { mountJog } from "./jog.js";
import { mountLights } from "./lights.js";
import { mountMechanism } from "./mechanism.js";
import { mountPlot } from "./plot.js";

const FORESEE_MS = 250;
/** The settings of an SMD3 that say whether a limit counts: as a whole, and towards each side. */
const LIMITS = { all: "L", "-": "L-", "+": "L+" };

/** Shows the drive of `context.axis` in `root`. */
export function mountDrive(root, context) {
  const part = (name, label) => h("section", { class: `card ${name}`, "aria-label": label });
  const [place, plot, jog, move, lights] = [part("place-card", "Position"), part("plot-card", "Plot of position and speed"), part("jog-card", "Jog"),
    part("move-card", "Move"), part("flags-card", "Flags")];
  // What moves it comes first for the keyboard, and stands beside what is seen.
  replace(root, h("div", { class: "drive-page" },
    h("div", { class: "column controls" }, jog, move),
    h("div", { class: "column sights" }, place, plot, lights)));
  const ends = [
    leaveAfterPointer(root),
    mountPlace(place, context),
    mountPlot(plot, context),
    mountJog(jog, context),
    mountMoves(move, context),
    mountLights(lights, context),
  ];
  return () => {
    for (const end of ends) end();
  };
}

/** Gives the arrow keys back to the jog when a slider or list has been used by a pointer. */
function leaveAfterPointer(root) {
  let byPointer = false;
  const isList = (element) => element instanceof HTMLSelectElement;
  const isSlider = (element) => element instanceof HTMLInputElement && element.type === "range";
  const listen = {
    pointerdown: () => { byPointer = true; },
    keydown: () => { byPointer = false; },
    change: ({ target }) => { if (byPointer && isList(target)) target.blur(); },
    pointerup: ({ target }) => { if (isSlider(target)) target.blur(); },
  };
  for (const [kind, told] of Object.entries(listen)) root.addEventListener(kind, told);
  return () => {
    for (const [kind, told] of Object.entries(listen)) root.removeEventListener(kind, told);
  };
}

/** Shows where the drive is, whether that can be trusted, and its mechanism. */
function mountPlace(root, context) {
  const { axis, rig } = context;
  const trust = h("p", { class: "trust" });
  const more = h("p", { class: "quiet number more" });
  const mechanism = h("div", { class: "mechanism" });
  replace(root, h("div", { class: "row spread" }, trust, more), mechanism);
  let latest = null;
  const update = () => {
    if (latest) {
      const [text, good] = trustText(axis, rig, latest);
      setText(trust, text);
      setClass(trust, "doubt", !good);
      return setText(more, moreText(axis, latest));
    }
    const state = store.stateOf(store.axisNamed(axis.name) ?? axis);
    const never = Boolean(state && state.b & store.BIT.LOST && state.a === undefined);
    setText(trust, never ? "It has never answered: nothing is known of where it is." : "");
    return setClass(trust, "doubt", never);
  };
  const ends = [
    store.watch("focus", (now) => {
      if (now.b & store.BIT.UNREAD) return;
      latest = now;
      update();
    }),
    store.watch("states", update),
    rig.watch(update),
    mountMechanism(mechanism, context),
  ];
  update();
  return () => {
    for (const end of ends) end();
  };
}

function trustText(axis, rig, now) {
  const lost = Math.round(rig.lost());
  if (lost !== 0) {
    const size = axis.unit === "steps" ? `${Math.abs(lost)} steps` : store.placeText(axis, Math.abs(rig.lost() / axis.steps_per_unit));
    return [`${size} off: the rotor stalled, and the controller cannot know; home it, or zero it here`, false];
  }
  if (now.b & store.BIT.TRUSTED) return ["position trusted", true];
  return [`position not trusted: ${now.doubt ?? "the drive has not been homed"}`, false];
}

function moreText(axis, now) {
  const target = now.target === null || now.target === undefined ? "" : `target ${store.placeText(axis, now.target)}`;
  const steps = axis.unit === "steps" ? "" : `${shown(now.steps, 2)} full steps`;
  return [target, steps].filter(Boolean).join(", ");
}

/** Shows moves to a place or by a distance, runs, home, zero and clear in `root`. */
function mountMoves(root, context) {
  const { axis } = context;
  const send = (rest, body, good) => context.attempt(async () => {
    await api("POST", ofAxis(axis.name, rest), body);
    if (good) context.notify("good", good);
    return true;
  });
  const goal = makeGoal(context);
  const homing = makeHoming(context, goal.speed);
  const run = (id, way, label, words) => h("button", { type: "button", id, class: "moves", title: `Turns ${words} until it is stopped or comes to an end`,
    onclick: () => send("/run", { direction: way, ...goal.speed(), ...goal.override() }) }, label);
  const zero = async () => {
    if (await send("/zero", {}, "This place is zero now")) context.rig.forget();
  };
  replace(root,
    h("h2", {}, "Move"),
    goal.form,
    h("div", { class: "pair" }, run("run-back", "-", "◀ Run", "backward"), run("run-forward", "+", "Run ▶", "forward")),
    homing.parts,
    h("div", { class: "pair apart" },
      h("button", { type: "button", id: "zero", title: "The counter reads 0 here; nothing moves", onclick: zero }, "Zero here"),
      h("button", { type: "button", id: "clear", onclick: () => send("/clear", {}, "Faults cleared, as far as their cause is gone") }, "Clear faults")));
  const end = store.watch("focus", (now) => {
    if (now.b & store.BIT.UNREAD) return;
    goal.update(now);
    homing.update(now);
  });
  return () => {
    end();
    goal.leave();
  };
}

/** The fields for a position or distance and a speed, with what a move would do told under its button. */
function makeGoal(context) {
  const { axis } = context;
  const field = (id, label, props) => {
    const input = h("input", { id, type: "text", autocomplete: "off", "aria-describedby": "goal-error", ...props });
    return [h("div", { class: "field" }, h("label", { for: id }, label), input), input];
  };
  const [goalRow, goal] = field("goal", "Position or distance", { placeholder: `30 ${axis.unit}` });
  const [speedRow, speed] = field("speed", "Speed", { placeholder: "as it is set", title: `In ${axis.unit}/s, or with its unit; left empty, the speed is as it is set` });
  const override = h("input", { type: "checkbox", id: "override" });
  const overrideRow = h("label", { class: "row", for: "override", hidden: true }, override, "Go though the position is not trusted");
  const wrong = h("p", { class: "error", id: "goal-error", role: "alert" });
  const plans = { to: h("span", { class: "number" }), by: h("span", { class: "number" }) };
  let now = null;

  const speedOnly = () => (speed.value.trim() ? { speed: speed.value.trim() } : {});
  const overridden = () => (override.checked ? { override_trust: true } : {});
  const order = (kind) => ({ [kind]: goal.value.trim(), ...speedOnly(), ...overridden() });
  const refuse = (message, isWrong = true) => {
    setText(wrong, message);
    const atSpeed = /^(a |the )?speed|MAX_SPEED/.test(message);
    setInvalid(goal, isWrong && message && !atSpeed);
    setInvalid(speed, isWrong && atSpeed);
  };
  const show = ({ to, by }) => {
    refuse(to?.error && to.error === by?.error ? to.error : "", by?.isWrong);
    for (const [kind, told] of Object.entries({ to, by })) {
      setText(plans[kind], !told || wrong.textContent ? "" : told.error ?? planText(axis, told));
      setClass(plans[kind], "doubt", Boolean(told?.error));
    }
  };
  const foresee = makeForeseer(axis, order, show);
  const look = () => foresee(goal.value.trim() && now && !(now.b & store.BIT.MOVING), !now || now.b & store.BIT.TRUSTED || override.checked);
  const go = async (kind) => {
    if (!goal.value.trim()) {
      goal.focus();
      return refuse(`Say where to, as in 30 ${axis.unit}`);
    }
    foresee(false);
    try {
      return await api("POST", ofAxis(axis.name, "/move"), order(kind));
    } catch (error) {
      return refuse(error.message, isWrong(error));
    }
  };
  for (const input of [goal, speed, override]) input.addEventListener("input", look);
  const form = h("form", { onsubmit: (event) => { event.preventDefault(); go("to"); } },
    h("div", { class: "fields" }, goalRow, speedRow), wrong, overrideRow,
    h("div", { class: "pair" },
      h("button", { class: "primary moves", id: "move-to" }, "Go to"),
      h("button", { type: "button", class: "moves", id: "move-by", onclick: () => go("by") }, "Move by")),
    h("output", { class: "plans quiet", id: "preview" }, plans.to, plans.by));
  return {
    form, speed: speedOnly, override: overridden,
    update(latest) {
      const changed = !now || (now.b ^ latest.b) & (store.BIT.MOVING | store.BIT.TRUSTED);
      now = latest;
      overrideRow.hidden = Boolean(now.b & store.BIT.TRUSTED);
      if (changed && goal.value.trim()) look();
    },
    leave: () => foresee(false),
  };
}

/** Whether it is what was asked for that cannot be, and not that the drive or the server cannot now. */
const isWrong = (error) => error.status === 422;

function setInvalid(input, on) {
  if (on) input.setAttribute("aria-invalid", "true");
  else input.removeAttribute("aria-invalid");
}

const planText = (axis, plan) => `→ ${shown(plan.to, store.decimals(axis))}, ${shown(plan.seconds, 2)} s`;

/** Asks what the moves that could be ordered would do, as the controller's driver plans them, and gives that to `show` as
 * `{to, by}`, each a plan or an `{error}`; nothing while there is nothing to foresee. */
function makeForeseer(axis, order, show) {
  let timer;
  let asked = 0;
  const ask = (kind) => api("POST", ofAxis(axis.name, "/move"), { ...order(kind), dry_run: true })
    .catch((error) => ({ error: error.message.replace(/; nothing was sent$/, ""), isWrong: isWrong(error) }));
  return (wanted, toPlaces = true) => {
    clearTimeout(timer);
    asked += 1;
    const mine = asked;
    if (!wanted) return show({});
    timer = setTimeout(async () => {
      const by = await ask("by");
      // Where a position is not trusted there is no place to go to, which is said already; a wrong text is one either way.
      const to = toPlaces ? await ask("to") : { error: by.error ?? "not while it is not trusted" };
      if (mine === asked) show({ to, by });
    }, FORESEE_MS);
    return undefined;
  };
}

/** The button that looks for home, why it cannot, and what came of it. */
function makeHoming(context, speed) {
  const { axis } = context;
  const direction = h("select", { id: "home-direction", onchange: () => tellWhy() }, h("option", { value: "-" }, "towards −"), h("option", { value: "+" }, "towards +"));
  const why = h("p", { class: "quiet", id: "home-why", hidden: true }, h("span", {}), " ",
    h("a", { href: `#/axis/${encodeURIComponent(axis.name)}/bake` }, "Bake and limits"));
  /** "asked", then "begun"; null when none was asked for here, or it has ended. */
  let stage = null;
  const ask = () => context.attempt(async () => {
    stage = null;
    await api("POST", ofAxis(axis.name, "/home"), { direction: direction.value, speed: context.jogSpeed(), ...speed() });
    stage = "asked";
  });
  const home = h("button", { type: "button", class: "moves", id: "home", "aria-describedby": "home-why",
    title: "Looks for the switch at the speed that is given, or else at that of the jog slider", onclick: ask }, "Home");

  let settings = null;
  const tellWhy = () => {
    const off = settings ? [LIMITS.all, LIMITS[direction.value]].filter((name) => Number(settings.get(name)) === 0) : [];
    home.disabled = off.length > 0;
    why.hidden = off.length === 0;
    setText(why.firstChild, `Homing needs the limit on this side to be switched on; ${off.map((name) => `${name} is 0`).join(", ")}.`);
  };
  let read = null;
  const readLimits = async (rev) => {
    if (axis.family !== "smd3" || read === rev) return;
    read = rev;
    try {
      const { rows } = await api("GET", ofAxis(axis.name, "/settings"));
      settings = new Map(rows.filter((row) => row.value !== null && row.value !== undefined).map((row) => [row.name, row.value]));
      tellWhy();
    } catch {
      // Then the controller itself says why it does not home.
    }
  };
  const follow = (now) => {
    const homes = Boolean(now.b & store.BIT.HOMING);
    if (stage === "asked" && homes && now.b & store.BIT.MOVING) {
      stage = "begun";
      context.notify("good", `${axis.name} looks for home`);
    } else if (stage === "begun" && !homes) {
      stage = null;
      // Any other end is told by the server.
      if (now.b & store.BIT.TRUSTED) context.notify("good", `${axis.name} is home`);
    }
  };
  return {
    parts: [h("div", { class: "pair" }, home, h("label", { class: "visually-hidden", for: "home-direction" }, "Direction of homing"), direction), why],
    update(now) {
      follow(now);
      readLimits(now.rev ?? 0);
    },
  };
}

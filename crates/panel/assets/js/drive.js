// What a drive does, and how it is moved.

import { h, replace, setClass, setText, shown } from "./dom.js";
import { api, ofAxis } from "./net.js";
import * as store from "./store.js";
import { mountJog } from "./jog.js";
import { mountLights } from "./lights.js";
import { mountMechanism } from "./mechanism.js";
import { mountPlot } from "./plot.js";

const FORESEE_MS = 250;

/** Shows the drive of `context.axis` in `root`. */
export function mountDrive(root, context) {
  const { axis } = context;
  const trust = h("p", { class: "trust" });
  const more = h("p", { class: "quiet number more" });
  const mechanism = h("div", { class: "mechanism" });
  const part = (name, label) => h("section", { class: `card ${name}`, "aria-label": label });
  const [plot, jog, move, lights] = [part("plot-card", "Plot of position and speed"), part("jog-card", "Jog"), part("move-card", "Move"), part("flags-card", "Flags")];
  // What moves it comes first for the keyboard, and stands beside what is seen.
  replace(root, h("div", { class: "drive-page" },
    h("div", { class: "column controls" }, jog, move),
    h("div", { class: "column sights" },
      h("section", { class: "card place-card", "aria-label": "Position" }, h("div", { class: "row spread" }, trust, more), mechanism),
      plot, lights)));

  const update = (now) => {
    const target = now.target === null || now.target === undefined ? "" : `target ${store.placeText(axis, now.target)}`;
    const steps = axis.unit === "steps" ? "" : `${shown(now.steps, 2)} full steps`;
    setText(more, [target, steps].filter(Boolean).join(", "));
    const trusted = Boolean(now.b & store.BIT.TRUSTED);
    setText(trust, trusted ? "position trusted" : `position not trusted: ${now.doubt ?? "the drive has not been homed"}`);
    setClass(trust, "doubt", !trusted);
  };
  const ends = [
    store.watch("focus", update),
    mountMechanism(mechanism, context),
    mountPlot(plot, context),
    mountJog(jog, context),
    mountMoves(move, context),
    mountLights(lights, context),
  ];
  return () => {
    for (const end of ends) end();
  };
}

/** Shows moves to a place or by a distance, runs, home and zero in `root`. */
function mountMoves(root, context) {
  const { axis } = context;
  const send = (rest, body, good) => context.attempt(async () => {
    const answer = await api("POST", ofAxis(axis.name, rest), body);
    if (good) context.notify("good", typeof good === "function" ? good(answer) : good);
    return answer;
  });
  const field = (id, label, props) => {
    const input = h("input", { id, type: "text", autocomplete: "off", ...props });
    return [h("div", { class: "field" }, h("label", { for: id }, label), input), input];
  };
  const [goalRow, goal] = field("goal", "Position or distance", { placeholder: `30 ${axis.unit}` });
  const [speedRow, speed] = field("speed", "Speed", { placeholder: "as it is set", title: `In ${axis.unit}/s, or with its unit; left empty, the speed is as it is set` });
  const override = h("input", { type: "checkbox", id: "override" });
  const overrideRow = h("label", { class: "row", for: "override", hidden: true }, override, "Go though the position is not trusted");
  const preview = h("output", { class: "quiet plan", id: "preview" });

  const speedOnly = () => (speed.value.trim() ? { speed: speed.value.trim() } : {});
  const overridden = () => (override.checked ? { override_trust: true } : {});
  const order = (kind) => ({ [kind]: goal.value.trim(), ...speedOnly(), ...overridden() });
  const planned = (plan) => `from ${shown(plan.from, store.decimals(axis))} to ${store.placeText(axis, plan.to)}, about ${shown(plan.seconds, 2)} s`;
  const go = (kind) => {
    if (!goal.value.trim()) {
      goal.focus();
      return context.notify("error", `Say where to, as in 30 ${axis.unit}`);
    }
    return send("/move", order(kind), (plan) => `${axis.name} goes ${planned(plan)}`);
  };

  const foresee = makeForeseer(axis, preview, order, planned);
  const look = () => foresee.soon(Boolean(goal.value.trim()));
  for (const input of [goal, speed, override]) input.addEventListener("input", look);
  const direction = h("select", { id: "home-direction" }, h("option", { value: "-" }, "towards −"), h("option", { value: "+" }, "towards +"));
  const run = (id, way, label, words) => h("button", { type: "button", id, class: "moves", title: `Turns ${words} until it is stopped or comes to an end`,
    onclick: () => send("/run", { direction: way, ...speedOnly(), ...overridden() }) }, label);

  replace(root,
    h("h2", {}, "Move"),
    h("form", { onsubmit: (event) => { event.preventDefault(); go("to"); } },
      h("div", { class: "fields" }, goalRow, speedRow), overrideRow,
      h("div", { class: "pair" },
        h("button", { class: "primary moves", id: "move-to" }, "Go to"),
        h("button", { type: "button", class: "moves", id: "move-by", onclick: () => go("by") }, "Move by")),
      preview),
    h("div", { class: "pair" }, run("run-back", "-", "◀ Run", "backward"), run("run-forward", "+", "Run ▶", "forward")),
    h("div", { class: "pair" },
      h("button", { type: "button", class: "moves", id: "home", title: "Looks for the switch at the speed that is given, or else at that of the jog slider",
        onclick: () => send("/home", { direction: direction.value, speed: context.jogSpeed(), ...speedOnly() }, `${axis.name} looks for home`) }, "Home"),
      h("label", { class: "visually-hidden", for: "home-direction" }, "Direction of homing"), direction),
    h("div", { class: "pair apart" },
      h("button", { type: "button", id: "zero", title: "The counter reads 0 here; nothing moves", onclick: () => send("/zero", {}, "This place is zero now") }, "Zero here"),
      h("button", { type: "button", id: "clear", onclick: () => send("/clear", {}, "Faults cleared, as far as their cause is gone") }, "Clear faults")));
  const end = store.watch("focus", (now) => {
    overrideRow.hidden = Boolean(now.b & store.BIT.TRUSTED);
    if (foresee.moving(Boolean(now.b & store.BIT.MOVING))) look();
  });
  return () => {
    end();
    foresee.soon(false);
  };
}

/** Shows what the moves that could be ordered would do, as the controller's driver plans them. */
function makeForeseer(axis, preview, order, planned) {
  let timer;
  let moves = false;
  let asked = 0;
  const ask = async (kind, label) => {
    try {
      return `${label}: ${planned(await api("POST", ofAxis(axis.name, "/move"), { ...order(kind), dry_run: true }))}`;
    } catch (error) {
      return `${label}: ${error.message}`;
    }
  };
  return {
    soon(wanted) {
      clearTimeout(timer);
      asked += 1;
      const mine = asked;
      // While it moves there is nothing to foresee: a plan begins where it stands.
      if (!wanted || moves) return replace(preview);
      timer = setTimeout(async () => {
        const lines = [await ask("to", "to"), await ask("by", "by")];
        if (mine === asked) replace(preview, lines.map((line) => h("div", {}, line)));
      }, FORESEE_MS);
      return undefined;
    },
    /** Takes whether it moves; answers whether that is new. */
    moving(now) {
      const changed = now !== moves;
      moves = now;
      return changed;
    },
  };
}

// What a drive does, and how it is moved.

import { h, replace, setClass, setText, shown } from "./dom.js";
import { api, ofAxis } from "./net.js";
import * as store from "./store.js";
import { mountJog } from "./jog.js";
import { mountLights } from "./lights.js";
import { mountMechanism } from "./mechanism.js";
import { mountPlot } from "./plot.js";

/** Shows the drive of `context.axis` in `root`. */
export function mountDrive(root, context) {
  const { axis } = context;
  const big = h("div", { class: "big number", id: "position" }, "–");
  const small = h("div", { class: "quiet number" });
  const trust = h("p", { class: "trust" });
  const mechanism = h("div", { class: "mechanism" });
  const plot = h("section", { class: "card wide", "aria-label": "Plot of position and speed" });
  const jog = h("section", { class: "card", "aria-label": "Jog" });
  const lights = h("section", { class: "card", "aria-label": "Flags" });
  const move = h("section", { class: "card", "aria-label": "Move" });
  replace(root, h("div", { class: "drive-page" },
    h("section", { class: "card wide", "aria-label": "Position" },
      h("div", { class: "row spread" }, h("div", {}, big, small), trust), mechanism),
    plot, jog, move, lights));

  const update = (now) => {
    setText(big, `${shown(now.p)} ${axis.unit}`);
    const target = now.target === null || now.target === undefined ? "" : `, target ${shown(now.target)} ${axis.unit}`;
    setText(small, `${shown(now.v)} ${axis.unit}/s, ${shown(now.steps, 2)} full steps${target}`);
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
    const input = h("input", { id, autocomplete: "off", ...props });
    return [h("div", { class: "field" }, h("label", { for: id }, label), input), input];
  };
  const [goalRow, goal] = field("goal", `Position or distance, in ${axis.unit}`, { type: "text", inputMode: "text", placeholder: `30 ${axis.unit}` });
  const [speedRow, speed] = field("speed", `Speed, in ${axis.unit}/s (else as it is set)`, { type: "text", inputMode: "decimal" });
  const override = h("input", { type: "checkbox", id: "override" });
  const overrideRow = h("label", { class: "row", for: "override", hidden: true }, override, "Go though the position is not trusted");
  const preview = h("output", { class: "quiet", id: "preview" });

  const order = (kind) => ({
    [kind]: goal.value.trim(),
    ...(speed.value.trim() ? { speed: speed.value.trim() } : {}),
    ...(override.checked ? { override_trust: true } : {}),
  });
  const speedOnly = () => (speed.value.trim() ? { speed: speed.value.trim() } : {});
  const planned = (plan) => `${axis.name} goes from ${shown(plan.from)} to ${shown(plan.to)} ${axis.unit}, about ${shown(plan.seconds, 2)} s`;
  const go = (kind) => {
    if (!goal.value.trim()) {
      goal.focus();
      return context.notify("error", `Say where to, as in 30 ${axis.unit}`);
    }
    return send("/move", order(kind), planned);
  };

  let timer;
  let moving = false;
  const foresee = () => {
    clearTimeout(timer);
    timer = setTimeout(async () => {
      // While it moves there is nothing to foresee: a plan begins where it stands.
      if (!goal.value.trim() || moving) return setText(preview, "");
      try {
        const plan = await api("POST", ofAxis(axis.name, "/move"), { ...order("to"), dry_run: true });
        setText(preview, `to: ${planned(plan)}`);
      } catch (error) {
        setText(preview, error.message);
      }
      return undefined;
    }, 250);
  };
  for (const input of [goal, speed, override]) input.addEventListener("input", foresee);
  const direction = h("select", { id: "home-direction" }, h("option", { value: "-" }, "towards −"), h("option", { value: "+" }, "towards +"));

  replace(root,
    h("h2", {}, "Move"),
    h("form", { onsubmit: (event) => { event.preventDefault(); go("to"); } },
      goalRow, speedRow, overrideRow,
      h("div", { class: "row" },
        h("button", { class: "primary", id: "move-to" }, "Go to"),
        h("button", { type: "button", id: "move-by", onclick: () => go("by") }, "Move by")),
      preview),
    h("div", { class: "row" },
      h("button", { type: "button", id: "run-back", onclick: () => send("/run", { direction: "-", ...speedOnly() }) }, "◀ Run"),
      h("button", { type: "button", id: "run-forward", onclick: () => send("/run", { direction: "+", ...speedOnly() }) }, "Run ▶")),
    h("div", { class: "row" },
      h("button", { type: "button", id: "home", title: "Looks for the switch at the speed that is given, or else at that of the jog slider",
        onclick: () => send("/home", { direction: direction.value, speed: context.jogSpeed(), ...speedOnly() }, `${axis.name} looks for home`) }, "Home"),
      h("label", { class: "visually-hidden", for: "home-direction" }, "Direction of homing"), direction,
      h("button", { type: "button", id: "zero", onclick: () => send("/zero", {}, "This place is zero now") }, "Zero here"),
      h("button", { type: "button", id: "clear", onclick: () => send("/clear", {}, "Faults cleared, as far as their cause is gone") }, "Clear faults")));
  return store.watch("focus", (now) => {
    overrideRow.hidden = Boolean(now.b & store.BIT.TRUSTED);
    const moves = Boolean(now.b & store.BIT.MOVING);
    if (moves !== moving) foresee();
    moving = moves;
  });
}

// Every flag as a light with its name; what it means, and where that stands, is told beside it.

import { h, prose, replace, setClass, setText } from "./dom.js";
import { api, ofAxis } from "./net.js";
import * as store from "./store.js";

const KINDS = [["error", "Errors"], ["status", "Status"], ["input", "Inputs"], ["output", "Outputs"]];
/** Flags that say how it is with the motor's current and motion; they differ in colour and shape from what is merely so. */
const SENSES = {
  HiZ: "free", STOP: "stands", STANDBY: "stands", CONST_SPEED: "turns", ACC: "turns", DEC: "turns", ATSPEED: "turns", BAKE: "warms",
};
/** What the makers call what they wrote. */
const MANUALS = { smsd: "the maker's manual of the SMSD-LAN", smd3: "the maker's manual of the SMD3" };
/** Where a state has the flags of a kind. A flag and an input may have one name, as the DIR of an SMSD. */
const SETS = { error: "flags", status: "flags", input: "inputs", output: "outputs" };
const keyOf = (set, name) => `${set} ${name}`;
const GAP_PX = 8;

/** Shows the flags of `context.axis` in `root`: those of `kinds`, or all. */
export function mountLights(root, context, kinds = KINDS) {
  const lights = new Map();
  const tip = makeTip(context.axis);
  const state = h("p", { class: "quiet" }, "Asking which there are …");
  replace(root, h("h2", {}, "Flags"), state);
  let asking = false;
  let gone = false;

  const ask = async () => {
    asking = true;
    try {
      const detail = await api("GET", ofAxis(context.axis.name));
      if (!gone) fill(detail);
    } catch (error) {
      setText(state, `Not known: ${error.message}`);
    }
    asking = false;
  };
  const fill = (detail) => {
    const groups = kinds.map(([kind, title]) => [title, detail.flags_table.filter((flag) => flag.kind === kind)]);
    replace(root, h("h2", {}, "Flags"),
      h("div", { class: "flags" }, groups.filter(([, flags]) => flags.length > 0).map(([title, flags]) =>
        h("div", { role: "group", "aria-label": title, class: "group" }, h("h3", {}, title),
          h("div", { class: "lights" }, flags.map((flag) => {
            const light = makeLight(flag, tip);
            lights.set(keyOf(SETS[flag.kind], flag.name), light);
            return light.element;
          }))))),
      tip.element);
    update(detail);
  };

  const update = (now) => {
    for (const set of ["flags", "inputs", "outputs"]) {
      for (const [name, on] of Object.entries(now[set] ?? {})) lights.get(keyOf(set, name))?.show(Boolean(on));
    }
  };
  const end = store.watch("focus", (now) => {
    if (now.b & store.BIT.UNREAD) return;
    update(now);
    // It had not answered when it was asked.
    if (lights.size === 0 && !asking) ask();
  });
  ask();
  return () => {
    gone = true;
    tip.leave();
    end();
  };
}

function makeLight(flag, tip) {
  let is = null;
  const sense = SENSES[flag.kind === "status" ? flag.name : null] ?? "";
  const element = h("button", { type: "button", class: `light unknown ${flag.kind} ${sense}`, "aria-label": `${flag.name}, not known`, "aria-describedby": tip.element.id,
    onfocus: () => tip.show(element, flag, is), onpointerenter: () => tip.show(element, flag, is), onclick: () => tip.show(element, flag, is),
    onkeydown: (event) => { if (event.key === "Escape") tip.hide(); }, onblur: tip.hide,
    onpointerleave: (event) => { if (event.pointerType === "mouse" && document.activeElement !== element) tip.hide(); } }, flag.name);
  return {
    element,
    show(on) {
      if (on === is) return;
      is = on;
      setClass(element, "unknown", false);
      setClass(element, "on", on);
      element.setAttribute("aria-label", `${flag.name}, ${on ? "on" : "off"}`);
    },
  };
}

/** One box for all lights, shown at that which is pointed at, touched or has the focus. */
function makeTip(axis) {
  const [name, about, source] = [h("strong", { class: "mono" }), h("p", {}), h("small", {})];
  const element = h("div", { class: "tip", role: "tooltip", id: "flag-tip", hidden: true }, name, about, source);
  const hide = () => { element.hidden = true; };
  // A finger that touches something else is done with it.
  const elsewhere = ({ target }) => { if (!target.closest?.(".light")) hide(); };
  document.addEventListener("pointerdown", elsewhere);
  return {
    element, hide,
    leave: () => document.removeEventListener("pointerdown", elsewhere),
    show(at, flag, is) {
      setText(name, is === null ? flag.name : `${flag.name}: ${is ? "on" : "off"}`);
      replace(about, prose(flag.about));
      setText(source, sourceText(axis, flag));
      element.hidden = false;
      const space = element.offsetParent.getBoundingClientRect();
      const light = at.getBoundingClientRect();
      const most = space.width - element.offsetWidth - GAP_PX;
      element.style.left = `${Math.max(GAP_PX, Math.min(most, light.left - space.left))}px`;
      // Above the light, so that it hides none that is read after it; below it where there is no room.
      const above = light.top - element.offsetHeight - GAP_PX;
      const head = document.querySelector(".axis-head")?.getBoundingClientRect().bottom ?? 0;
      element.style.top = `${(above < head ? light.bottom + GAP_PX : above) - space.top}px`;
    },
  };
}

/** Where it is written, for somebody who has the maker's manual and this program. */
function sourceText(axis, flag) {
  const manual = MANUALS[axis.family];
  const source = flag.source.replace(/^manual, /, "");
  return `${source ? `In ${manual}: ${source}. ` : ""}In a terminal, "stepdrive flags" tells all of them.`;
}

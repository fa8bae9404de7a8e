// Every flag as a light with its name; what it means, and where that stands, is told beside it.

import { h, prose, replace, setClass, setText } from "./dom.js";
import { api, ofAxis } from "./net.js";
import * as store from "./store.js";

const KINDS = [["error", "Errors"], ["status", "Status"], ["input", "Inputs"], ["output", "Outputs"]];
const GAP_PX = 8;

/** Shows the flags of `context.axis` in `root`: those of `kinds`, or all. */
export function mountLights(root, context, kinds = KINDS) {
  const lights = new Map();
  const tip = makeTip();
  replace(root, h("h2", {}, "Flags"), h("p", { class: "quiet" }, "Asking which there are …"));
  let gone = false;

  context.attempt(() => api("GET", ofAxis(context.axis.name))).then((detail) => {
    if (!detail || gone) return;
    const groups = kinds.map(([kind, title]) => [title, detail.flags_table.filter((flag) => flag.kind === kind)]);
    replace(root, h("h2", {}, "Flags"),
      h("div", { class: "flags" }, groups.filter(([, flags]) => flags.length > 0).map(([title, flags]) =>
        h("div", { role: "group", "aria-label": title }, h("h3", {}, title),
          h("div", { class: "lights" }, flags.map((flag) => {
            const light = makeLight(flag, tip);
            lights.set(flag.name, light);
            return light.element;
          }))))),
      tip.element);
    update(detail);
  });

  const update = (now) => {
    for (const values of [now.flags, now.inputs, now.outputs]) {
      for (const [name, on] of Object.entries(values ?? {})) lights.get(name)?.show(Boolean(on));
    }
  };
  const end = store.watch("focus", update);
  return () => {
    gone = true;
    end();
  };
}

function makeLight(flag, tip) {
  let is = null;
  const element = h("button", { type: "button", class: `light ${flag.kind}`, "aria-label": `${flag.name}, not known`, "aria-describedby": tip.element.id,
    onfocus: () => tip.show(element, flag), onpointerenter: () => tip.show(element, flag), onclick: () => tip.show(element, flag),
    onkeydown: (event) => { if (event.key === "Escape") tip.hide(); }, onblur: tip.hide, onpointerleave: () => { if (document.activeElement !== element) tip.hide(); } }, flag.name);
  return {
    element,
    show(on) {
      if (on === is) return;
      is = on;
      setClass(element, "on", on);
      element.setAttribute("aria-label", `${flag.name}, ${on ? "on" : "off"}`);
    },
  };
}

/** One box for all lights, shown at that which is pointed at or has the focus. */
function makeTip() {
  const [name, about, source] = [h("strong", { class: "mono" }), h("p", {}), h("small", {})];
  const element = h("div", { class: "tip", role: "tooltip", id: "flag-tip", hidden: true }, name, about, source);
  return {
    element,
    show(at, flag) {
      setText(name, flag.name);
      replace(about, prose(flag.about));
      setText(source, [flag.source, flag.doc].filter(Boolean).join("; see "));
      element.hidden = false;
      const space = element.offsetParent.getBoundingClientRect();
      const light = at.getBoundingClientRect();
      const most = space.width - element.offsetWidth - GAP_PX;
      element.style.left = `${Math.max(GAP_PX, Math.min(most, light.left - space.left))}px`;
      // Above the light, so that it hides none that is read after it.
      element.style.top = `${light.top - space.top - element.offsetHeight - GAP_PX}px`;
    },
    hide() {
      element.hidden = true;
    },
  };
}

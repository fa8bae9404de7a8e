// Every flag as a light with its name; what it means is told beside.

import { h, replace, setClass, setText } from "./dom.js";
import { api, ofAxis } from "./net.js";
import * as store from "./store.js";

const KINDS = [["error", "Errors"], ["status", "Status"], ["input", "Inputs"], ["output", "Outputs"]];

/** Shows the flags of `context.axis` in `root`. */
export function mountLights(root, context) {
  const lights = new Map();
  const about = h("p", { class: "about", role: "status" }, "Choose a flag to read what it means.");
  replace(root, h("h2", {}, "Flags"), about);
  let gone = false;

  const explain = (flag) => {
    replace(about, h("strong", {}, flag.name), ` ${flag.about} `, h("small", {}, flag.source, flag.doc ? ` – ${flag.doc}` : ""));
  };
  const light = (flag) => {
    const element = h("button", { type: "button", class: `light ${flag.kind}`, "aria-pressed": "false", title: `${flag.about} (${flag.source})`,
      onclick: () => explain(flag), onfocus: () => explain(flag), onpointerenter: () => explain(flag) }, flag.name);
    lights.set(flag.name, element);
    return element;
  };
  context.attempt(() => api("GET", ofAxis(context.axis.name))).then((detail) => {
    if (!detail || gone) return;
    const groups = KINDS.map(([kind, title]) => [title, detail.flags_table.filter((flag) => flag.kind === kind)]);
    replace(root, h("h2", {}, "Flags"),
      groups.filter(([, flags]) => flags.length > 0).map(([title, flags]) =>
        h("div", {}, h("h3", {}, title), h("div", { class: "lights" }, flags.map(light)))),
      about);
    update(detail);
  });

  const update = (now) => {
    for (const values of [now.flags, now.inputs, now.outputs]) {
      for (const [name, on] of Object.entries(values ?? {})) {
        const element = lights.get(name);
        if (!element) continue;
        setClass(element, "on", on);
        if (element.getAttribute("aria-pressed") !== String(Boolean(on))) element.setAttribute("aria-pressed", String(Boolean(on)));
      }
    }
  };
  const end = store.watch("focus", update);
  setText(about, "Choose a flag to read what it means.");
  return () => {
    gone = true;
    end();
  };
}

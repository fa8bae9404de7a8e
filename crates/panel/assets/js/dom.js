// Small helpers to build the page. Text only ever goes in as text, never as HTML.

const SVG = "http://www.w3.org/2000/svg";

/** An element: `h("button", {class: "primary", onclick: go}, "Go")`. Properties that start with `on` listen; `class`, `for`,
 * `aria-*`, `data-*` and other names with a dash become attributes; the rest are properties of the element. */
export function h(tag, props = {}, ...children) {
  return dress(document.createElement(tag), props, children);
}

/** The same for SVG, where everything but listeners is an attribute. */
export function svg(tag, props = {}, ...children) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(props)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) element.setAttribute(name, String(value));
  }
  return fill(element, children);
}

function dress(element, props, children) {
  for (const [name, value] of Object.entries(props ?? {})) {
    if (value === null || value === undefined) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "class") element.className = value;
    else if (name === "for") element.htmlFor = value;
    else if (name === "list" || name === "role" || name.includes("-")) setAttribute(element, name, value);
    else element[name] = value;
  }
  return fill(element, children);
}

function setAttribute(element, name, value) {
  if (value === false) element.removeAttribute(name);
  else element.setAttribute(name, value === true ? "true" : String(value));
}

function fill(element, children) {
  for (const child of children.flat(Infinity)) {
    if (child === null || child === undefined || child === false) continue;
    element.append(child instanceof Node ? child : document.createTextNode(String(child)));
  }
  return element;
}

/** Puts children in the place of all that is in an element. */
export function replace(element, ...children) {
  element.replaceChildren();
  return fill(element, children);
}

/** A text of the tables, where names stand between backticks. */
export const prose = (text) => text.split("`").map((part, at) => (at % 2 ? h("code", {}, part) : part));

/** Sets the text of an element if it is another: an update that changes nothing costs nothing. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Sets a class by a condition. */
export function setClass(element, name, on) {
  if (element.classList.contains(name) !== Boolean(on)) element.classList.toggle(name, Boolean(on));
}

/** A number for people: as many decimals as its size asks for. */
export function shown(value, decimals) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  const size = Math.abs(value);
  const text = value.toFixed(decimals ?? (size >= 1000 ? 1 : size >= 100 ? 2 : 3));
  // A hair below zero is no minus zero.
  return Number(text) === 0 ? text.replace("-", "") : text;
}

/** A time span for people. */
export function span(ms) {
  // Rounded first: 59.97 s are 1 min 0 s, not 60.0 s.
  const tenths = Math.round(ms / 100);
  if (tenths < 10) return `${Math.round(ms)} ms`;
  if (tenths < 600) return `${(tenths / 10).toFixed(1)} s`;
  const seconds = Math.round(ms / 1000);
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min ${seconds % 60} s`;
  const minutes = Math.round(seconds / 60);
  return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

/** A switch between several views of a page, as tabs that the arrow keys go through. `entries` are `[key, label]`; `panel` is
 * the element that shows what is selected. */
export function tabs(label, entries, selected, choose, panel = null) {
  if (panel) panel.id = "tab-panel";
  const list = h("div", { class: "tabs", role: "tablist", "aria-label": label });
  for (const [key, text] of entries) {
    list.append(h("button", {
      type: "button", role: "tab", "data-key": key, "aria-selected": key === selected, "aria-controls": panel?.id, tabIndex: key === selected ? 0 : -1,
      onclick: () => choose(key),
    }, text));
  }
  list.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    event.stopPropagation();
    const all = [...list.children];
    const next = all[(all.indexOf(document.activeElement) + step + all.length) % all.length];
    next.focus();
    next.click();
  });
  return list;
}

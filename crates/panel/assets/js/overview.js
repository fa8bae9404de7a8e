// All drives at a glance. Only the rows that are seen are in the page, so a thousand drives cost what thirty do.

import { h, replace, setClass, setText, span } from "./dom.js";
import * as store from "./store.js";

const ROW_PX = 52;
const SPARE = 6;
const FILTERS = [["all", "All"], ["moving", "Moving"], ["fault", "Faults"], ["lost", "Lost"], ["rest", "Standing"]];

/** Shows all drives in `root`. Answers what takes them away again. */
export function mountOverview(root, context) {
  let wanted = "all";
  let text = "";
  let list = [];
  const rows = new Map();

  const search = h("input", { type: "search", placeholder: "Filter by name, model or address", "aria-label": "Filter drives",
    oninput: () => { text = search.value.trim().toLowerCase(); choose(); } });
  const chips = h("div", { class: "chips", role: "group", "aria-label": "Which drives" });
  for (const [key, label] of FILTERS) {
    chips.append(h("button", { type: "button", class: "chip", "data-key": key, "aria-pressed": key === wanted, onclick: () => {
      wanted = key;
      for (const chip of chips.children) chip.setAttribute("aria-pressed", String(chip.dataset.key === key));
      choose();
    } }, label, h("span", { class: "count" })));
  }
  const tall = h("div", { class: "tall", role: "rowgroup" });
  const view = h("div", { class: "view", tabIndex: 0, role: "table", "aria-label": "Drives" },
    h("div", { class: "heads", role: "row" }, ["Drive", "State", "Position", "Speed", ""].map((head) => h("span", { role: "columnheader" }, head))),
    tall);
  const empty = h("p", { class: "quiet", hidden: true }, "No drive fits the filter.");
  replace(root, h("div", { class: "overview" },
    h("div", { class: "bar" }, h("h1", {}, "Drives"), search, chips), view, empty));

  const fits = (axis) => {
    const [, kind] = store.words(store.stateOf(axis));
    if (wanted === "rest" ? !["rest", "off"].includes(kind) : wanted !== "all" && wanted !== kind) return false;
    return !text || `${axis.name} ${axis.model ?? ""} ${axis.target}`.toLowerCase().includes(text);
  };

  function choose() {
    const before = list;
    list = store.axes.filter(fits);
    empty.hidden = list.length > 0 || store.axes.length === 0;
    tall.style.height = `${list.length * ROW_PX}px`;
    // As high as its rows, up to what the window has.
    view.style.maxHeight = `${list.length * ROW_PX + view.firstChild.offsetHeight + 2}px`;
    view.setAttribute("aria-rowcount", String(list.length + 1));
    if (before.length !== list.length || before.some((axis, place) => axis !== list[place])) {
      for (const row of rows.values()) row.element.remove();
      rows.clear();
    }
    show();
  }

  function show() {
    const first = Math.max(0, Math.floor(view.scrollTop / ROW_PX) - SPARE);
    const last = Math.min(list.length, Math.ceil((view.scrollTop + view.clientHeight) / ROW_PX) + SPARE);
    for (const [place, row] of rows) {
      if (place < first || place >= last) {
        row.element.remove();
        rows.delete(place);
      }
    }
    for (let place = first; place < last; place += 1) {
      let row = rows.get(place);
      if (!row) {
        row = makeRow(list[place], context);
        row.element.style.transform = `translateY(${place * ROW_PX}px)`;
        row.element.setAttribute("aria-rowindex", String(place + 2));
        rows.set(place, row);
        tall.append(row.element);
      }
      row.update();
    }
  }

  function count() {
    const sums = { all: store.axes.length, moving: 0, fault: 0, lost: 0, rest: 0 };
    for (const state of store.states.values()) {
      const [, kind] = store.words(state);
      sums[kind === "off" ? "rest" : kind] += 1;
    }
    for (const chip of chips.children) setText(chip.querySelector(".count"), String(sums[chip.dataset.key]));
  }

  const update = () => {
    count();
    if (wanted === "all") show();
    else choose();
  };
  view.addEventListener("scroll", () => requestAnimationFrame(show), { passive: true });
  const resized = new ResizeObserver(show);
  resized.observe(view);
  const ends = [store.watch("axes", choose), store.watch("states", update)];
  // The age of a lost reading grows without events.
  const clock = setInterval(show, 500);
  choose();
  count();
  return () => {
    clearInterval(clock);
    resized.disconnect();
    for (const end of ends) end();
  };
}

function makeRow(axis, context) {
  const lamp = h("span", { class: "lamp", "aria-hidden": "true" });
  const word = h("span", { class: "word" });
  const position = h("span", { class: "number" });
  const marker = h("i", { class: "marker" });
  const rail = h("span", { class: "rail", "aria-hidden": "true" }, marker);
  const speed = h("span", { class: "number" });
  const halt = h("button", { type: "button", class: "stop small quiet-stop", "aria-label": `Stop ${axis.name}`, onclick: () => context.stop(axis.name) }, "Stop");
  const element = h("div", { class: "drive-row", role: "row" },
    h("span", { role: "cell" },
      h("a", { href: `#/axis/${encodeURIComponent(axis.name)}` }, axis.name),
      h("span", { class: `badge ${axis.virtual ? "virtual" : "real"}` }, axis.virtual ? "virtual" : "real"),
      h("small", {}, axis.model ?? axis.family.toUpperCase())),
    h("span", { role: "cell" }, lamp, word),
    h("span", { role: "cell", class: "place" }, position, rail),
    h("span", { role: "cell" }, speed),
    h("span", { role: "cell" }, halt));
  let before = null;
  const update = () => {
    const state = store.stateOf(axis);
    const lost = Boolean(state && state.b & store.BIT.LOST);
    if (state === before && !lost) return;
    before = state;
    const [text, kind] = store.words(state);
    lamp.className = `lamp ${kind}`;
    setText(word, lost ? `lost, last seen ${span(store.ageOf(state))} ago` : text);
    setClass(element, "stale", lost);
    const known = state && !(state.b & store.BIT.UNREAD);
    setText(position, known ? store.placeText(axis, state.p) : "–");
    setText(speed, known ? store.speedText(axis, state.v) : "–");
    setClass(element, "moves-now", kind === "moving");
    setClass(position, "doubtful", known && !(state.b & store.BIT.TRUSTED));
    position.title = known && !(state.b & store.BIT.TRUSTED) ? "The position is not trusted: the drive has not been homed" : "";
    rail.hidden = !axis.limits || !known;
    if (axis.limits && known) {
      const [low, high] = axis.limits;
      marker.style.left = `${Math.min(100, Math.max(0, (100 * (state.p - low)) / (high - low || 1)))}%`;
    }
  };
  return { element, update };
}

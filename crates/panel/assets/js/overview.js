// All drives at a glance: a few as cards, many as a table. Only the rows that are seen are in the page, so a thousand drives
// cost what thirty do.

import { h, replace, setClass, setText } from "./dom.js";
import { api } from "./net.js";
import * as store from "./store.js";

/** The most drives that are shown as cards. */
const MOST_CARDS = 12;
const ROW_PX = 52;
const SPARE = 6;
/** How often the rig is asked where its drives have their zero. */
const REACH_MS = 2000;
const AGE_MS = 500;
const FILTERS = [["all", "All"], ["moving", "Moving"], ["fault", "Faults"], ["lost", "Lost"], ["rest", "Standing"]];

/** How the page was left: who comes back finds it so. */
const kept = { wanted: "all", text: "", top: 0 };

/** Shows all drives in `root`. Answers what takes them away again. */
export function mountOverview(root, context) {
  let shown = null;
  let list = null;

  const search = h("input", { type: "search", placeholder: "Filter by name, model or address", "aria-label": "Filter drives", value: kept.text,
    oninput: () => { kept.text = search.value; choose(); } });
  const chips = h("div", { class: "chips", role: "group", "aria-label": "Which drives" }, FILTERS.map(([key, label]) =>
    h("button", { type: "button", class: "chip", "data-key": key, "aria-pressed": key === kept.wanted, onclick: () => {
      kept.wanted = key;
      for (const chip of chips.children) chip.setAttribute("aria-pressed", String(chip.dataset.key === key));
      choose();
    } }, label, h("span", { class: "count" }))));
  const place = h("div", { class: "drives" });
  const empty = h("p", { class: "quiet", hidden: true }, "No drive fits the filter.");
  replace(root, h("div", { class: "overview" }, h("div", { class: "bar" }, h("h1", {}, "Drives"), search, chips), place, empty));

  /** As cards or as a table, as many as there are. */
  function lay() {
    const make = store.axes.length > MOST_CARDS ? makeTable : makeCards;
    if (shown?.make === make) return;
    shown?.leave();
    shown = { make, ...make(context) };
    list = null;
    replace(place, shown.element);
  }

  function choose() {
    if (store.axes.length === 0) return;
    lay();
    const fitting = store.axes.filter(fits);
    empty.hidden = fitting.length > 0;
    const isNew = list === null || list.length !== fitting.length || fitting.some((axis, at) => !isLike(axis, list[at]));
    list = fitting;
    if (isNew) shown.show(list);
    else shown.update();
  }

  function count() {
    const sums = { all: store.axes.length, moving: 0, fault: 0, lost: 0, rest: 0 };
    for (const state of store.states.values()) {
      const filter = filterOf(state);
      if (filter in sums) sums[filter] += 1;
    }
    for (const chip of chips.children) setText(chip.querySelector(".count"), String(sums[chip.dataset.key]));
  }

  const update = () => {
    count();
    if (kept.wanted === "all") shown?.update();
    else choose();
  };
  const ends = [store.watch("axes", choose), store.watch("states", update)];
  // The age of a lost reading grows without events.
  const clock = setInterval(() => shown?.update(), AGE_MS);
  choose();
  count();
  shown?.restore();
  return () => {
    clearInterval(clock);
    shown?.leave();
    for (const end of ends) end();
  };
}

/** The filter that a state fits beside that for all. */
function filterOf(state) {
  const [, kind] = store.words(state);
  return kind === "off" ? "rest" : kind;
}

/** Whether two descriptions of a drive say the same: then what shows it stays, and with it the button under a finger. */
const isLike = (one, other) => one === other || JSON.stringify(one) === JSON.stringify(other);

function fits(axis) {
  if (kept.wanted !== "all" && filterOf(store.stateOf(axis)) !== kept.wanted) return false;
  const text = kept.text.trim().toLowerCase();
  return !text || `${axis.name} ${axis.model ?? ""} ${axis.target}`.toLowerCase().includes(text);
}

/** A few drives, each on a card. */
function makeCards(context) {
  const element = h("div", { class: "cards" });
  const reach = new Map();
  const leaveReach = learnReach(context, reach);
  let cards = [];
  // The page is scrolled, not the cards.
  const scrolled = () => { kept.top = scrollY; };
  addEventListener("scroll", scrolled, { passive: true });
  const update = () => { for (const card of cards) card.update(); };
  return {
    element, update,
    show(list) {
      cards = list.map((axis) => makeCard(axis, context, () => reach.get(axis.name)));
      replace(element, cards.map((card) => card.element));
      update();
    },
    restore: () => scrollTo(0, kept.top),
    leave() {
      leaveReach();
      removeEventListener("scroll", scrolled);
    },
  };
}

function makeCard(axis, context, reach) {
  const parts = makeParts(axis, context, reach);
  const element = h("article", { class: `card drive-card ${axis.virtual ? "virtual" : "real"}`, "aria-label": axis.name },
    h("div", { class: "who" }, h("h2", {}, parts.link), parts.badge, parts.model),
    parts.halt,
    h("p", { class: "state" }, parts.lamp, parts.word),
    h("div", { class: "numbers" }, parts.position, parts.speed),
    parts.rail);
  parts.position.classList.add("big");
  parts.halt.classList.add("big");
  setText(parts.halt, "STOP");
  return openedBy(element, axis, parts, context);
}

/** Many drives, in rows. */
function makeTable(context) {
  const rows = new Map();
  let list = [];
  const tall = h("div", { class: "tall", role: "rowgroup" });
  const heads = h("div", { class: "heads", role: "row" }, ["Drive", "State", "Position", "Speed", ""].map((head) => h("span", { role: "columnheader" }, head)));
  const element = h("div", { class: "view", tabIndex: 0, role: "table", "aria-label": "Drives" }, heads, tall);

  function update() {
    const first = Math.max(0, Math.floor(element.scrollTop / ROW_PX) - SPARE);
    const last = Math.min(list.length, Math.ceil((element.scrollTop + element.clientHeight) / ROW_PX) + SPARE);
    for (const [place, row] of rows) {
      if (place < first || place >= last) {
        row.element.remove();
        rows.delete(place);
      }
    }
    for (let place = first; place < last; place += 1) {
      if (!rows.has(place)) rows.set(place, put(place));
      rows.get(place).update();
    }
  }

  function put(place) {
    const row = makeRow(list[place], context);
    row.element.style.transform = `translateY(${place * ROW_PX}px)`;
    row.element.setAttribute("aria-rowindex", String(place + 2));
    tall.append(row.element);
    return row;
  }

  element.addEventListener("scroll", () => {
    kept.top = element.scrollTop;
    requestAnimationFrame(update);
  }, { passive: true });
  const resized = new ResizeObserver(update);
  resized.observe(element);
  return {
    element, update,
    show(fitting) {
      list = fitting;
      for (const row of rows.values()) row.element.remove();
      rows.clear();
      tall.style.height = `${list.length * ROW_PX}px`;
      // As high as its rows, up to what the window has.
      element.style.maxHeight = `${list.length * ROW_PX + heads.offsetHeight + 2}px`;
      element.setAttribute("aria-rowcount", String(list.length + 1));
      update();
    },
    restore() {
      element.scrollTop = kept.top;
      update();
    },
    leave: () => resized.disconnect(),
  };
}

function makeRow(axis, context) {
  const parts = makeParts(axis, context, () => undefined);
  const cell = (...children) => h("span", { role: "cell" }, children);
  const place = cell(parts.position, parts.rail);
  place.className = "place";
  parts.halt.classList.add("small", "quiet-stop");
  const element = h("div", { class: "drive-row", role: "row" },
    cell(parts.link, parts.badge, parts.model), cell(parts.lamp, parts.word), place, cell(parts.speed), cell(parts.halt));
  return openedBy(element, axis, parts, context);
}

/** All of it opens the drive; but links stay links, buttons buttons, and text can be selected. */
function openedBy(element, axis, parts, context) {
  element.addEventListener("click", (event) => {
    if (event.target.closest("a, button") || !getSelection().isCollapsed) return;
    context.navigate(parts.link.getAttribute("href"));
  });
  return { element, update: () => parts.update(element) };
}

/** What is shown of a drive; where each part is put is for cards and rows to say. `reach` tells what the rig knows of its travel. */
function makeParts(axis, context, reach) {
  const marker = h("i", { class: "marker" });
  const parts = {
    link: h("a", { href: `#/axis/${encodeURIComponent(axis.name)}` }, axis.name),
    badge: h("span", { class: `badge ${axis.virtual ? "virtual" : "real"}` }, axis.virtual ? "virtual" : "real"),
    model: h("small", {}, axis.model ?? axis.family.toUpperCase()),
    lamp: h("span", { class: "lamp", "aria-hidden": "true" }),
    word: h("span", { class: "word" }),
    position: h("span", { class: "number" }),
    speed: h("span", { class: "number" }),
    rail: h("span", { class: "rail", "aria-hidden": "true" }, marker),
    halt: h("button", { type: "button", class: "stop", "aria-label": `Stop ${axis.name}`, onclick: () => context.stop(axis.name) }, "Stop"),
  };
  let before = null;
  let reached = null;
  parts.update = (element) => {
    const state = store.stateOf(axis);
    const [text, kind] = store.words(state);
    if (state === before && reach() === reached && kind !== "lost") return;
    before = state;
    reached = reach();
    parts.lamp.className = `lamp ${kind}`;
    parts.word.className = `word ${kind}`;
    setText(parts.word, kind === "lost" ? `lost, ${store.lastSeen(state)}` : text);
    setClass(element, "stale", kind === "lost");
    setClass(element, "moves-now", kind === "moving");
    showPlace(axis, state, parts, fraction(axis, state, reached), marker);
  };
  return parts;
}

function showPlace(axis, state, { position, speed, rail }, along, marker) {
  const known = isKnown(state);
  const doubtful = known && !(state.b & store.BIT.TRUSTED);
  setText(position, known ? store.placeText(axis, state.p) : "–");
  setText(speed, known ? store.speedText(axis, state.v) : "–");
  setClass(position, "doubtful", doubtful);
  position.title = doubtful ? "The position is not trusted: the drive has not been homed" : "";
  rail.hidden = along === null;
  if (along !== null) marker.style.left = `${100 * along}%`;
}

const isKnown = (state) => Boolean(state && !(state.b & store.BIT.UNREAD));

/** How far along its travel a drive is, from 0 to 1; null when that is not known. */
function fraction(axis, state, reach) {
  if (!isKnown(state)) return null;
  const at = axis.limits ? state.p : reach && reach.zero + state.p * axis.steps_per_unit;
  const ends = axis.limits ?? reach?.travel;
  if (!ends) return null;
  return Math.min(1, Math.max(0, (at - ends[0]) / (ends[1] - ends[0] || 1)));
}

/** Learns how far simulated drives without limits can go, and where their zero lies in that: `reach` has it by their names. */
function learnReach(context, reach) {
  const ask = async (axis) => {
    try {
      const { mechanism } = await api("GET", `/v1/drives/${encodeURIComponent(axis.name)}`);
      const { travel, zero } = mechanism ?? {};
      if (travel) reach.set(axis.name, { travel, zero });
    } catch {
      // Without it there is no bar, and nothing else is missing.
    }
  };
  const askAll = () => {
    if (!context.hasRig() || document.hidden) return;
    for (const axis of store.axes) if (axis.virtual && !axis.limits) ask(axis);
  };
  askAll();
  const clock = setInterval(askAll, REACH_MS);
  return () => clearInterval(clock);
}

// The mechanism, drawn to scale: travel, switches, carriage, zero, mark, target; and the rotor.
//
// A virtual drive's rig tells where everything is; of a real one its position and soft limits are known. The axis' positive
// direction is to the right, so a reversed axis is drawn the other way round than its motor counts.

import { h, replace, setText, shown, svg } from "./dom.js";
import { follow } from "./net.js";
import * as store from "./store.js";

const SIDE = 34;
const ROTOR = { space: 120, y: 54, r: 42 };
/** Narrower than this there is no room for the rotor. */
const NARROW = 480;
/** The least between two ticks. */
const TICK_PX = 48;
/** A line of text, and a letter of it. */
const LINE_PX = 15;
const LETTER_PX = 7.6;
/** What stands above the rail: the line of what moves, the lines of what stands still, and the carriage. */
const MOVING_PX = 14;
const ABOVE_PX = 40;
const LEAST_PX = 118;
/** A rig that has nothing new says so every ten seconds. */
const SILENCE_MS = 20_000;

/* Steps that are lost. A controller counts on while its rotor stalls; only the rig sees both. */

/** Of each drive the place of the controller's zero when its counter was last right, and what was seen last, by name. It
 * stays while the page is open. */
const slips = new Map();

/** Takes where the controller's zero is now. A stall moves it; what moves it otherwise sets the counter anew. */
function slide(name, { zero, stalled }) {
  const before = slips.get(name);
  if (zero === null) return slips.delete(name);
  const set = before && !stalled && !before.stalled && Math.abs(zero - before.zero) >= 1;
  return slips.set(name, { right: before && !set ? before.right : zero, zero, stalled });
}

/** Follows what the rig tells of a virtual drive, for all parts of its page. `begin()` does so once there is a rig. */
export function followRig(axis, context) {
  const watchers = new Set();
  let stream = null;
  const rig = {
    /** The drive's mechanism; null while none is known, as of a real drive. */
    mechanism: null,
    clock: null,
    /** How many full steps its controller has counted that the rotor did not make. */
    lost: () => {
      const slip = rig.mechanism && slips.get(axis.name);
      return slip ? slip.right - slip.zero : 0;
    },
    /** The counter has been set to where the rotor is. */
    forget() {
      slips.delete(axis.name);
      if (rig.mechanism) slide(axis.name, rig.mechanism);
      for (const tell of watchers) tell();
    },
    watch(tell) {
      watchers.add(tell);
      return () => watchers.delete(tell);
    },
    begin() {
      if (stream || !axis.virtual || !context.hasRig()) return;
      stream = follow(`/v1/events?drive=${encodeURIComponent(axis.name)}&every=40ms`, { state: take }, () => {}, SILENCE_MS);
    },
    close: () => stream?.close(),
  };
  const take = (event) => {
    rig.clock = event.clock;
    rig.mechanism = event.drives[0]?.mechanism ?? null;
    if (rig.mechanism) slide(axis.name, rig.mechanism);
    for (const tell of watchers) tell();
  };
  let homing = false;
  const end = store.watch("focus", (now) => {
    const homes = Boolean(now.b & store.BIT.HOMING);
    if (homing && !homes && now.b & store.BIT.TRUSTED) rig.forget();
    homing = homes;
  });
  const close = rig.close;
  rig.close = () => {
    end();
    close();
  };
  rig.begin();
  return rig;
}

/** Shows the mechanism of `context.axis` in `root`. */
export function mountMechanism(root, context) {
  const { axis, rig } = context;
  let latest = null;
  let seen = [Infinity, -Infinity];
  let drawing = null;

  const text = h("p", { class: "visually-hidden", role: "status" });
  const place = h("div", { class: "drawing" });
  replace(root, place, text);

  function update() {
    // Of a drive that has never answered nothing is drawn.
    if (!latest) return;
    const view = look(axis, rig, latest);
    seen = [Math.min(seen[0], view.at, view.counted), Math.max(seen[1], view.at, view.counted)];
    const range = rangeOf(axis, view, seen);
    const width = Math.max(280, place.clientWidth);
    const key = JSON.stringify([width, range, view.switches, view.mark, view.zero, axis.limits]);
    if (drawing?.key !== key) {
      drawing = { ...draw(axis, view, range, width), key };
      replace(place, drawing.picture);
    }
    drawing.show(view);
    const lost = view.counted === view.at ? "" : ` ${shown(Math.abs(rig.lost()), 0)} steps are lost.`;
    setText(text, view.stalled ? "The rotor is stalled." : lost);
  }

  const ends = [
    store.watch("focus", (now) => {
      if (now.b & store.BIT.UNREAD) return;
      latest = now;
      update();
    }),
    rig.watch(update),
  ];
  const resized = new ResizeObserver(update);
  resized.observe(place);
  return () => {
    resized.disconnect();
    for (const end of ends) end();
  };
}

/** What there is to draw, all places in full steps of the motor: on the travel, or from zero where no rig is. */
function look(axis, rig, latest) {
  const told = rig.mechanism;
  const lost = Math.abs(rig.lost()) >= 1 ? rig.lost() : 0;
  // The scale is the counter's, as it was when it was right: a stall does not move it.
  const counter = (at) => (at === null || at === undefined ? null : at + lost);
  const goal = latest.target === null || latest.target === undefined ? null : latest.target * axis.steps_per_unit;
  const at = told ? told.carriage : latest.steps;
  const zero = told ? counter(told.zero) ?? 0 : 0;
  return {
    at, zero,
    counted: at + lost,
    target: counter(told?.target) ?? (goal === null ? null : zero + goal),
    mark: counter(told?.mark),
    travel: told?.travel ?? null,
    switches: told?.switches ?? [],
    turn: told?.steps_per_rev ?? 200,
    stalled: Boolean(told?.stalled),
    inputs: { ...latest.inputs, ...latest.flags },
  };
}

/** From where to where it is drawn. */
function rangeOf(axis, { travel, zero, turn }, seen) {
  if (travel) return travel;
  if (axis.limits) {
    const ends = axis.limits.map((limit) => zero + limit * axis.steps_per_unit);
    return [Math.min(...ends, seen[0]), Math.max(...ends, seen[1])];
  }
  // Without an end the drawing grows with what was visited, in whole turns.
  const [low, high] = [Math.min(seen[0], zero), Math.max(seen[1], zero)];
  return [Math.floor(low / turn) * turn - turn, Math.ceil(high / turn) * turn + turn];
}

/** Draws what stands still, and answers how to show what moves. */
function draw(axis, view, [low, high], width) {
  const right = width - SIDE - (width < NARROW ? 0 : ROTOR.space);
  const scale = (right - SIDE) / (high - low || 1);
  const along = (steps) => (Math.min(high, Math.max(low, steps)) - low) * scale;
  const x = axis.steps_per_unit < 0 ? (steps) => right - along(steps) : (steps) => SIDE + along(steps);
  const isSeen = (steps) => steps >= low && steps <= high;

  const signs = standing(axis, view, isSeen).map((sign) => ({ ...sign, x: x(sign.at) }));
  const above = lines(signs.map(({ x: at, text, kind }) => ({ x: at, text, kind })), right + SIDE);
  const names = lines(view.switches.map((row) => ({ x: (x(row.closed[0]) + x(row.closed[1])) / 2, text: row.input, kind: "m-name" })), right + SIDE);
  const rail = MOVING_PX + above.lines * LINE_PX + ABOVE_PX;
  const numbers = rail + (names.lines > 0 ? 28 : 22) + names.lines * LINE_PX;
  const height = Math.max(LEAST_PX, numbers + 8);

  const still = [
    svg("line", { x1: SIDE, y1: rail, x2: right, y2: rail, class: "m-rail" }),
    ...ticks(axis, view.zero, [low, high], right - SIDE).flatMap(([at, value]) => [
      svg("line", { x1: x(at), y1: rail, x2: x(at), y2: rail + 5, class: "m-tick" }), label(x(at), numbers, value, "m-number")]),
    ...signs.map(({ x: at, line, tip }) => svg("line", { x1: at, y1: rail - 36, x2: at, y2: rail + 6, class: line }, svg("title", {}, tip))),
    ...above.placed.map(({ x: at, line, text, kind }) => label(at, rail - ABOVE_PX - line * LINE_PX, text, kind)),
    ...names.placed.map(({ x: at, line, text, kind }) => label(at, rail + 26 + line * LINE_PX, text, kind)),
    view.travel ? [SIDE - 14, right].map((at) => svg("rect", { x: at, y: rail - 34, width: 14, height: 46, rx: 2, class: "m-end" }, svg("title", {}, "hard end of the travel"))) : null,
  ];
  const switches = view.switches.map((row) => {
    const [from, to] = row.closed.map(x).sort((one, other) => one - other);
    return [row.input, svg("rect", { x: from, y: rail + 4, width: Math.max(3, to - from), height: 9, class: "m-switch" },
      svg("title", {}, `${row.input} is closed from ${row.closed[0]} to ${row.closed[1]} full steps`))];
  });
  const moving = makeMoving(rail, x);
  const rotor = width < NARROW ? null : makeRotor(width - ROTOR.r - 8);
  const picture = svg("svg", { viewBox: `0 0 ${width} ${height}`, height, class: "m", role: "img", "aria-label": `The mechanism of ${axis.name}` },
    still, switches.map(([, bar]) => bar), moving.parts, rotor?.parts);
  return {
    picture,
    show(now) {
      moving.show(now);
      rotor?.show(now);
      for (const [input, bar] of switches) bar.classList.toggle("on", Boolean(now.inputs[input]));
    },
  };
}

/** The signs along the travel that stand still: zero, the mark, the soft limits. */
function standing(axis, { zero, mark }, isSeen) {
  // A mark that nobody has set lies at zero.
  const atZero = mark !== null && Math.abs(mark - zero) < 1;
  const signs = [{ at: zero, text: atZero ? "0, mark" : "0", kind: "m-zero", line: "m-zero", tip: "zero of the counter" }];
  if (mark !== null && !atZero) signs.push({ at: mark, text: "mark", kind: "m-mark", line: "m-mark", tip: "MARK" });
  for (const limit of axis.limits ?? []) {
    signs.push({ at: zero + limit * axis.steps_per_unit, text: "soft limit", kind: "m-name", line: "m-limit", tip: `soft limit ${limit} ${axis.unit}` });
  }
  return signs.filter(({ at }) => isSeen(at));
}

/** Puts texts that would lie on each other on several lines, and keeps them within the drawing. */
function lines(texts, width) {
  const ends = [];
  const placed = [...texts].sort((one, other) => one.x - other.x).map((text) => {
    const half = (text.text.length * LETTER_PX) / 2;
    const x = Math.max(half, Math.min(width - half, text.x));
    const free = ends.findIndex((end) => x - half > end);
    const line = free < 0 ? ends.length : free;
    ends[line] = x + half + LETTER_PX;
    return { ...text, x, line };
  });
  return { placed, lines: ends.length };
}

/** The carriage, where the controller believes it to be should that be elsewhere, and the target. */
function makeMoving(rail, x) {
  const shape = () => [svg("rect", { x: -13, y: -24, width: 26, height: 20, rx: 4 }), svg("path", { d: "M-5 -4 L0 4 L5 -4 Z" })];
  const stall = label(0, MOVING_PX - 2 - rail, "stalled", "m-stall");
  const count = label(0, MOVING_PX - 2 - rail, "counted here", "m-count");
  const sledge = svg("g", { class: "m-carriage" }, shape(), stall);
  const ghost = svg("g", { class: "m-ghost" }, svg("title", {}, "where the controller counts itself"), shape(), count);
  const goal = svg("path", { d: "M0 -34 v34 M0 -34 l13 5 l-13 5", class: "m-target" }, svg("title", {}, "target"));
  const put = (part, at) => {
    part.style.display = at === null ? "none" : "";
    if (at !== null) part.setAttribute("transform", `translate(${x(at).toFixed(2)} ${rail})`);
  };
  return {
    parts: [goal, ghost, sledge],
    show({ at, counted, target, stalled }) {
      put(sledge, at);
      put(ghost, counted === at ? null : counted);
      put(goal, target);
      sledge.classList.toggle("stalled", stalled);
      stall.style.display = stalled ? "" : "none";
      // No room for both words.
      count.style.display = stalled && Math.abs(x(counted) - x(at)) < 11 * LETTER_PX ? "none" : "";
    },
  };
}

function makeRotor(centre) {
  const hand = svg("line", { x1: centre, y1: ROTOR.y, x2: centre, y2: ROTOR.y - ROTOR.r + 6, class: "m-hand" });
  const turns = label(centre, ROTOR.y + ROTOR.r + 17, "", "m-name");
  return {
    parts: [svg("circle", { cx: centre, cy: ROTOR.y, r: ROTOR.r, class: "m-rotor" }), hand, svg("circle", { cx: centre, cy: ROTOR.y, r: 4, class: "m-hub" }), turns],
    show({ at, zero, turn }) {
      hand.setAttribute("transform", `rotate(${(((360 * at) / turn) % 360).toFixed(2)} ${centre} ${ROTOR.y})`);
      setText(turns, `${shown((at - zero) / turn, 2)} turns`);
    },
  };
}

const label = (x, y, text, kind) => svg("text", { x, y, class: kind, "text-anchor": "middle" }, text);

/** Round values of the axis' unit within a range, as many as have room with their numbers, and their places: `[place, value]`. */
function ticks(axis, zero, [low, high], width) {
  const ends = [low, high].map((end) => (end - zero) / (axis.steps_per_unit || 1)).sort((one, other) => one - other);
  const room = (values) => width / Math.max(1, (ends[1] - ends[0]) / (values[1] - values[0]));
  const widest = (values) => Math.max(...values.map((value) => String(value).length + 1)) * LETTER_PX;
  let wanted = width / TICK_PX;
  let values = roundValues(...ends, wanted);
  while (values.length > 1 && room(values) < widest(values)) values = roundValues(...ends, wanted /= 1.5);
  return values.map((value) => [zero + value * axis.steps_per_unit, value]);
}

/** About so many values between two, in steps of 1, 2 or 5 and a power of ten. */
export function roundValues(low, high, wanted) {
  const rough = (high - low) / wanted || 1;
  const size = 10 ** Math.floor(Math.log10(rough));
  const step = size * ([1, 2, 5, 10].find((factor) => factor * size >= rough) ?? 10);
  const values = [];
  for (let at = Math.ceil(low / step - 1e-9); at <= high / step + 1e-9; at += 1) values.push(Number((at * step).toPrecision(9)));
  return values;
}

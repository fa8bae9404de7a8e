// The mechanism, drawn to scale: travel, switches, carriage, zero, mark, target; and the rotor.
//
// A virtual drive's rig tells where everything is; of a real one its position and soft limits are known.

import { h, replace, setText, shown, svg } from "./dom.js";
import { follow } from "./net.js";
import * as store from "./store.js";

const HEIGHT = 150;
const LEFT = 34;
const RAIL = 86;
const ROTOR = { space: 120, y: 62, r: 42 };
/** Narrower than this there is no room for the rotor. */
const NARROW = 480;
/** So many pixels a tick with its number wants. */
const TICK_PX = 90;
/** And so many a name. */
const NAME_PX = 70;

/** Shows the mechanism of `context.axis` in `root`. */
export function mountMechanism(root, context) {
  const { axis } = context;
  /** What the rig tells of it; null for a real drive. */
  let rig = null;
  let latest = null;
  let seen = [Infinity, -Infinity];
  let drawing = null;

  const text = h("p", { class: "visually-hidden", role: "status" });
  const place = h("div", { class: "drawing" });
  replace(root, place, text);

  const range = () => {
    if (rig?.travel) return [rig.travel[0], rig.travel[1]];
    if (axis.limits) return axis.limits.map((limit) => limit * axis.steps_per_unit).sort((a, b) => a - b);
    // Without an end the drawing grows with what was visited, in whole turns.
    const turn = rig?.steps_per_rev ?? 200;
    const low = Math.min(seen[0], 0);
    const high = Math.max(seen[1], 0);
    return [Math.floor(low / turn) * turn - turn, Math.ceil(high / turn) * turn + turn];
  };

  /** The carriage's place in full steps of the drawing. */
  const carriage = () => (rig ? rig.carriage : latest?.steps ?? 0);
  const zero = () => rig?.zero ?? 0;

  function update() {
    if (!latest && !rig) return;
    const at = carriage();
    seen = [Math.min(seen[0], at), Math.max(seen[1], at)];
    const [low, high] = range();
    const width = Math.max(280, place.clientWidth);
    const key = JSON.stringify([width, low, high, rig?.switches, rig?.mark, zero(), axis.limits]);
    if (!drawing || drawing.key !== key) {
      drawing = draw(axis, rig, [low, high], zero(), width);
      drawing.key = key;
      replace(place, drawing.picture);
    }
    const stalled = Boolean(rig?.stalled);
    const target = rig?.target ?? (latest?.target === null || latest?.target === undefined ? null : zero() + latest.target * axis.steps_per_unit);
    drawing.show({ at, target, stalled, inputs: { ...latest?.inputs, ...latest?.flags }, turn: rig?.steps_per_rev ?? 200, position: latest?.p });
    setText(text, stalled ? "The rotor is stalled." : "");
  }

  const end = store.watch("focus", (now) => {
    latest = now;
    update();
  });
  let stream = null;
  if (axis.virtual && context.hasRig()) {
    stream = follow(`/v1/events?drive=${encodeURIComponent(axis.name)}&every=40ms`, {
      state: (event) => {
        rig = event.drives[0]?.mechanism ?? null;
        update();
      },
    }, () => {}, 20_000);
  }
  const resized = new ResizeObserver(update);
  resized.observe(place);
  return () => {
    resized.disconnect();
    end();
    stream?.close();
  };
}

/** Draws what stands still, and answers how to show what moves. */
function draw(axis, rig, [low, high], zero, width) {
  const narrow = width < NARROW;
  const RIGHT = width - (narrow ? LEFT : LEFT + ROTOR.space);
  const centre = width - ROTOR.r - 8;
  const scale = (RIGHT - LEFT) / (high - low || 1);
  const x = (steps) => LEFT + (Math.min(high, Math.max(low, steps)) - low) * scale;
  const still = [
    svg("line", { x1: LEFT, y1: RAIL, x2: RIGHT, y2: RAIL, class: "m-rail" }),
    ...ticks(axis, zero, [low, high], x, Math.max(2, (RIGHT - LEFT) / TICK_PX)),
  ];
  if (rig?.travel) {
    still.push(svg("rect", { x: LEFT - 14, y: RAIL - 34, width: 14, height: 46, class: "m-end" }, svg("title", {}, "hard end of the travel")),
      svg("rect", { x: RIGHT, y: RAIL - 34, width: 14, height: 46, class: "m-end" }, svg("title", {}, "hard end of the travel")));
  }
  if (axis.limits) {
    for (const limit of axis.limits) {
      const at = x(zero + limit * axis.steps_per_unit);
      still.push(svg("line", { x1: at, y1: RAIL - 40, x2: at, y2: RAIL + 8, class: "m-limit" }, svg("title", {}, `soft limit ${limit} ${axis.unit}`)));
      if (!narrow && Math.abs(at - x(zero)) > NAME_PX) still.push(label(at, RAIL - 44, "soft limit", "m-name"));
    }
  }
  const switches = (rig?.switches ?? []).map((row) => {
    const [from, to] = row.closed.map(x);
    const bar = svg("rect", { x: from, y: RAIL + 4, width: Math.max(3, to - from), height: 9, class: "m-switch" }, svg("title", {}, `${row.input} is closed from ${row.closed[0]} to ${row.closed[1]} full steps`));
    still.push(bar, label(Math.min(RIGHT - 20, Math.max(LEFT + 20, (from + to) / 2)), RAIL + 26, row.input, "m-name"));
    return [row.input, bar];
  });
  const marked = rig?.mark !== null && rig?.mark !== undefined;
  // A mark that nobody has set lies at zero.
  const markAtZero = marked && Math.abs(x(rig.mark) - x(zero)) < 1;
  still.push(label(x(zero), RAIL - 42, markAtZero ? "0, mark" : "0", "m-zero"), svg("line", { x1: x(zero), y1: RAIL - 38, x2: x(zero), y2: RAIL, class: "m-zero" }));
  if (marked && !markAtZero) {
    still.push(label(x(rig.mark), RAIL - 42, "mark", "m-mark"), svg("line", { x1: x(rig.mark), y1: RAIL - 38, x2: x(rig.mark), y2: RAIL, class: "m-mark" }));
  }
  const goal = svg("path", { d: "M0 -34 v34 M0 -34 l13 5 l-13 5", class: "m-target" }, svg("title", {}, "target"));
  const sledge = svg("g", { class: "m-carriage" },
    svg("rect", { x: -13, y: -24, width: 26, height: 20, rx: 4 }),
    svg("path", { d: "M-5 -4 L0 4 L5 -4 Z" }));
  const stall = label(0, -30, "stalled", "m-stall");
  sledge.append(stall);
  const hand = svg("line", { x1: centre, y1: ROTOR.y, x2: centre, y2: ROTOR.y - ROTOR.r + 6, class: "m-hand" });
  const turns = label(centre, ROTOR.y + ROTOR.r + 18, "", "m-name");
  const rotor = [svg("circle", { cx: centre, cy: ROTOR.y, r: ROTOR.r, class: "m-rotor" }), hand, svg("circle", { cx: centre, cy: ROTOR.y, r: 4, class: "m-hub" }), turns];
  const picture = svg("svg", { viewBox: `0 0 ${width} ${HEIGHT}`, class: "m", role: "img", "aria-label": `The mechanism of ${axis.name}` },
    still, goal, sledge, narrow ? null : rotor);
  return {
    picture,
    show({ at, target, stalled, inputs, turn }) {
      sledge.setAttribute("transform", `translate(${x(at).toFixed(2)} ${RAIL})`);
      sledge.classList.toggle("stalled", stalled);
      stall.style.display = stalled ? "" : "none";
      goal.style.display = target === null ? "none" : "";
      if (target !== null) goal.setAttribute("transform", `translate(${x(target).toFixed(2)} ${RAIL})`);
      for (const [input, bar] of switches) bar.classList.toggle("on", Boolean(inputs[input]));
      hand.setAttribute("transform", `rotate(${(((360 * at) / turn) % 360).toFixed(2)} ${centre} ${ROTOR.y})`);
      setText(turns, `${shown(at / turn, 2)} turns`);
    },
  };
}

const label = (x, y, text, kind) => svg("text", { x, y, class: kind, "text-anchor": "middle" }, text);

/** Ticks at round values of the axis' unit. */
function ticks(axis, zero, [low, high], x, wanted) {
  const per = Math.abs(axis.steps_per_unit || 1);
  const ends = [(low - zero) / axis.steps_per_unit, (high - zero) / axis.steps_per_unit].sort((a, b) => a - b);
  const rough = (high - low) / per / wanted;
  const size = 10 ** Math.floor(Math.log10(rough || 1));
  const step = size * ([1, 2, 5, 10].find((factor) => factor * size >= rough) ?? 10);
  const marks = [];
  for (let at = Math.ceil(ends[0] / step) * step; at <= ends[1] + step * 1e-9 && marks.length < 60; at += step) {
    const place = x(zero + at * axis.steps_per_unit);
    marks.push(svg("line", { x1: place, y1: RAIL, x2: place, y2: RAIL + 5, class: "m-tick" }),
      label(place, RAIL + 44, Number(at.toPrecision(6)), "m-number"));
  }
  return marks;
}

// What is known of the axes, from the stream of events. One stream serves the whole page.

import { shown, span } from "./dom.js";
import { follow } from "./net.js";

/** Bits of a state. */
export const BIT = {
  LOST: 1, MOVING: 2, ENERGISED: 4, LIMIT_NEGATIVE: 8, LIMIT_POSITIVE: 16, TRUSTED: 32, WITHIN: 64, FAULT: 128,
  JOGGING: 256, HOMING: 512, PROGRAM: 1024, UNREAD: 2048,
};

/** All axes, in the order of the server: `{name, family, model, virtual, target, unit, steps_per_unit, limits}`. */
export let axes = [];
/** What each is now, by its place: `{p, v, b, e, a, w, at}`; `at` is when it came here. */
export const states = new Map();
/** Whether the stream stands. */
export let linked = null;

/** After so long without a word from the server, what is shown is not live. */
const QUIET_MS = 1000;

let stream = null;
let focused = null;
/** When the streams before this one heard something last. */
let heard = 0;
/** The places of the axes, by their names. */
let places = new Map();
const watchers = { states: new Set(), focus: new Set(), axes: new Set(), link: new Set(), notice: new Set() };

/** Calls `tell` when something of this kind has come: "states" and "focus" (at most once a frame), "axes", "link",
 * "notice". Answers a function that ends it. */
export function watch(kind, tell) {
  watchers[kind].add(tell);
  return () => watchers[kind].delete(tell);
}

let due = new Set();
let latest = null;
/** Tells what has changed with the next frame, however many events come before it. */
function tellSoon(kind) {
  if (due.size === 0) {
    // A page that is not shown has no frames, but still has states.
    if (document.hidden) setTimeout(tellNow, 250);
    else requestAnimationFrame(tellNow);
  }
  due.add(kind);
}

function tellNow() {
  const kinds = due;
  due = new Set();
  for (const kind of kinds) {
    // Another drive has been chosen meanwhile.
    if (kind === "focus" && latest === null) continue;
    for (const tell of watchers[kind]) tell(kind === "focus" ? latest : states);
  }
}

/** Follows all axes, and one of them closely. */
export function focus(name) {
  if (stream && focused === name) return;
  focused = name;
  latest = null;
  open(name === null ? "" : `?focus=${encodeURIComponent(name)}`);
}

const lastWord = () => Math.max(heard, stream?.heard ?? 0);

/** For how long the server has said nothing, in ms. */
export const silence = () => performance.now() - lastWord();

/** Whether what is shown is what is. */
export const isLive = () => linked === true && silence() < QUIET_MS;

function open(query) {
  heard = lastWord();
  stream?.close();
  stream = follow(`/v1/axes/events${query}`, {
    axes: (event) => {
      axes = event.axes;
      places = new Map(axes.map((axis, place) => [axis.name, place]));
      states.clear();
      for (const tell of watchers.axes) tell(axes);
    },
    states: (event) => {
      const at = performance.now();
      for (const state of event.s) states.set(state.i, { ...state, at });
      tellSoon("states");
    },
    focus: (event) => {
      if (event.name !== focused) return;
      latest = { ...event, at: performance.now() };
      for (const tell of watchers.focus) tell.sample?.(latest);
      tellSoon("focus");
    },
    notice: (event) => {
      for (const tell of watchers.notice) tell(event);
    },
  }, (up, error) => {
    // There is no such drive; the others are still to be seen.
    if (error?.status === 422 && query) return open("");
    if (linked === up) return;
    linked = up;
    for (const tell of watchers.link) tell(up, error);
  });
}

/** The axis of this name, or undefined. */
export const axisNamed = (name) => axes[places.get(name)];

/** The state of an axis, or undefined while nothing has come. */
export const stateOf = (axis) => states.get(places.get(axis.name));

/** How many decimals a position of this axis has: those that 1/16 of a full step asks for, and always as many, so that
 * numbers that change stand still. */
export const decimals = (axis) => Math.min(6, Math.max(2, Math.ceil(Math.log10(16 * Math.abs(axis.steps_per_unit || 1)))));

/** A position of an axis, and a speed, with their units. */
export const placeText = (axis, value) => `${shown(value, decimals(axis))} ${axis.unit}`;
export const speedText = (axis, value) => `${shown(value, decimals(axis))} ${axis.unit}/s`;

/** How old the last reading of a lost axis is, in ms. */
const ageOf = (state) => state.a + (performance.now() - state.at);

/** When a lost axis was read last, in words. */
export const lastSeen = (state) => (state.a === undefined ? "never answered" : `last seen ${span(ageOf(state))} ago`);

/** What an axis does, in a word or two, and of which kind that is: "lost", "fault", "moving", "rest", "off", "unread". */
export function words(state) {
  if (state && state.b & BIT.LOST) return ["lost", "lost"];
  if (!state || state.b & BIT.UNREAD) return ["not read yet", "unread"];
  if (state.b & BIT.FAULT) return [state.e?.length ? state.e.join(", ") : "fault", "fault"];
  if (state.b & BIT.HOMING) return ["homing", "moving"];
  if (state.b & BIT.JOGGING) return ["jogging", "moving"];
  if (state.b & BIT.MOVING) return [state.v < 0 ? "moving −" : "moving +", "moving"];
  if (state.b & BIT.PROGRAM) return ["program runs", "moving"];
  return state.b & BIT.ENERGISED ? ["holds", "rest"] : ["de-energised", "off"];
}

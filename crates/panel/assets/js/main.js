// The shell of the page: header, routes, notices, and the stops that always work.

import { h, replace, setClass, setText, span } from "./dom.js";
import { has, ofAxis, onRefused, onSuccess, onTokenWanted, urgently } from "./net.js";
import * as store from "./store.js";
import { mountOverview } from "./overview.js";
import { mountAxis } from "./axis.js";
import { mountRig } from "./rig.js";
import { mountTraffic } from "./traffic.js";

const THEME = "stepdrive-theme";
const main = document.getElementById("main");

/** Whether there is a rig here, whose time and faults can be had: then its API describes itself. Null: not known yet. */
let rig = null;
let unmount = () => {};
/** The axis that the page is about, which the space bar stops. */
let current = null;

/* Notices. The last two are shown, and how many more there are is told. */

/** How long a notice stays. */
const NOTICE_MS = 6000;
const ERROR_MS = 15_000;
const SHOWN = 2;
const MOST = 20;
const notices = document.getElementById("notices");
const others = h("button", { type: "button", class: "plain small others", hidden: true, onclick: () => {
  notices.classList.toggle("all");
  arrange();
} });
notices.append(others);

/** Tells the person something: "info", "error" or "good". What was told `about` the same before goes away; what `stays` goes
 * only by hand, or when it is withdrawn. */
export function notify(level, text, { about = text, stays = false } = {}) {
  withdraw(about);
  const same = [...notices.querySelectorAll(".notice")].find((told) => told.querySelector("p").textContent === text);
  if (same?.classList.contains("stays") && !stays) return;
  same?.remove();
  const note = h("div", { class: `notice ${level}`, "data-about": about },
    h("p", {}, text),
    h("button", { type: "button", class: "plain", "aria-label": "Close this notice", onclick: () => take(note) }, "✕"));
  if (stays) note.classList.add("stays");
  else setTimeout(() => take(note), level === "error" ? ERROR_MS : NOTICE_MS);
  // What stays is never behind what passes.
  notices.insertBefore(note, stays ? null : notices.querySelector(".stays"));
  arrange();
}

/** Takes away what was told about something. */
function withdraw(about) {
  for (const note of notices.querySelectorAll(".notice")) if (note.dataset.about === about) take(note);
}

function take(note) {
  note.remove();
  arrange();
}

function arrange() {
  const all = [...notices.querySelectorAll(".notice")];
  for (const note of all.splice(0, all.length - MOST)) note.remove();
  const open = notices.classList.contains("all");
  const more = Math.max(0, all.length - SHOWN);
  all.forEach((note, at) => { note.hidden = at < more && !open; });
  others.hidden = more === 0;
  setText(others, open ? "Fewer" : `${more} more`);
  if (more === 0) notices.classList.remove("all");
}

/** Does something and tells when it fails, until the same succeeds. Answers what it gave, or undefined. */
export async function attempt(what) {
  try {
    return await what();
  } catch (error) {
    notify("error", error.message, { about: error.action ?? error.message });
    return undefined;
  }
}

/* Stops. Each is sent until it is answered, and what a drive was not told yet is said until it has been. */

/** After so long without an answer a person is told that a stop is not confirmed. */
const CONFIRM_MS = 1000;
/** A try that takes longer is followed by another one, over another connection. */
const TRY_MS = 3000;
const TRY_AGAIN_MS = 500;
const LOOK_MS = 500;
/** For so long the server goes on telling a drive, and says so when it ends. */
const TOLD_FOR_MS = 120_000;
/** The last press of each stop, by its path: only this one is sent again. */
const presses = new Map();
/** What ends looking whether drives have been told, by the path of the stop. */
const looks = new Map();

/** Stops an axis, whatever else goes on. */
export async function stop(name, how = "soft") {
  const path = ofAxis(name, "/stop");
  const answer = await attempt(() => insist(path, { how }, name).catch((error) => {
    if (error.status !== 502) throw error;
    return { not_yet: [{ axis: name, error: error.message }] };
  }));
  if (answer) tellWhoIsLeft(path, how, answer.not_yet ?? []);
}

/** Stops all axes. */
export async function stopAll() {
  const path = "/v1/axes/stop";
  const answer = await attempt(() => insist(path, {}, "all drives"));
  if (answer) tellWhoIsLeft(path, "soft", answer.not_yet);
}

/** Sends a stop until it is answered, and answers that; nothing when it was pressed anew meanwhile. */
async function insist(path, body, whom) {
  document.dispatchEvent(new Event("stopping"));
  const press = { doubted: presses.get(path)?.doubted ?? false };
  const isLast = () => presses.get(path) === press;
  const doubt = () => {
    if (!isLast()) return;
    press.doubted = true;
    notify("error", `STOP of ${whom} is not confirmed yet: nothing has answered so far. It is sent again until it is.`, { about: `POST ${path}`, stays: true });
  };
  presses.set(path, press);
  const late = setTimeout(doubt, CONFIRM_MS);
  try {
    while (isLast()) {
      const answer = await once(path, body);
      if (answer && isLast()) {
        if (press.doubted && !answer.not_yet?.length) notify("good", `STOP of ${whom} is confirmed`);
        return answer;
      }
      doubt();
      await new Promise((done) => setTimeout(done, TRY_AGAIN_MS));
    }
    return undefined;
  } finally {
    clearTimeout(late);
    if (isLast()) {
      presses.delete(path);
      withdraw(`POST ${path}`);
    }
  }
}

/** Sends a stop. Answers nothing when no reply came. */
async function once(path, body) {
  try {
    return await urgently("POST", path, body, TRY_MS);
  } catch (error) {
    if (error.status !== 0) throw error;
    return undefined;
  }
}

/** Says which drives could not be told to stop yet, until they have been: the server goes on telling them. One that has been
 * started anew meanwhile knows nothing of that, so they are stopped again when the connection comes back. */
function tellWhoIsLeft(path, how, notYet) {
  const about = `left ${path}`;
  looks.get(path)?.();
  looks.delete(path);
  withdraw(about);
  if (notYet.length === 0) return;
  let left = notYet;
  const tell = () => notify("error", left.length === 1 ? left[0].error
    : `${listed(left)} could not be told to stop yet; they are told again, for two minutes`, { about, stays: true });
  tell();
  const begun = performance.now();
  const timer = setInterval(() => {
    if (performance.now() - begun > TOLD_FOR_MS) {
      end();
      return withdraw(about);
    }
    const now = left.filter((one) => !stands(one.axis));
    if (now.length === left.length) return;
    left = now;
    if (left.length > 0) return tell();
    end();
    withdraw(about);
    return notify("good", `${listed(notYet)} can be reached again, and ${notYet.length === 1 ? "stands" : "stand"}`);
  }, LOOK_MS);
  const forget = store.watch("link", (up) => {
    if (!up) return;
    end();
    withdraw(about);
    for (const one of left) stop(one.axis, how);
  });
  const end = () => {
    clearInterval(timer);
    forget();
    looks.delete(path);
  };
  looks.set(path, end);
}

/** Whether a drive is seen to stand; one that is here no more need not be waited for. */
function stands(name) {
  const axis = store.axisNamed(name);
  const state = axis && store.stateOf(axis);
  return store.isLive() && (!axis || Boolean(state && !(state.b & (store.BIT.LOST | store.BIT.UNREAD | store.BIT.MOVING))));
}

/** The names of some drives, the first few of many. */
function listed(drives) {
  const names = drives.map((one) => one.axis);
  return names.length <= 4 ? names.join(", ") : `${names.slice(0, 3).join(", ")} and ${names.length - 3} more`;
}

const context = { notify, attempt, stop, stopAll, navigate: (hash) => { location.hash = hash; }, hasRig: () => rig === true };

/* Routes. */

/** The parts of an address; none when it cannot be read. */
function address() {
  try {
    return location.hash.replace(/^#\/?/, "").split("/").map(decodeURIComponent);
  } catch {
    return null;
  }
}

function route() {
  const [page, name, part] = address() ?? [null];
  unmount();
  current = page === "axis" && name ? name : null;
  store.focus(current);
  const [title, mount] = pageAt(page, name, part);
  unmount = mount();
  document.title = `${title} – stepdrive`;
  for (const link of document.querySelectorAll("#top nav a")) {
    if (link.getAttribute("href") === `#/${page}`) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
}

/** The title of a page, and what shows it. */
function pageAt(page, name, part = "drive") {
  if (page === "") return ["Drives", () => mountOverview(main, context)];
  if (current !== null) return [part === "drive" ? name : `${name}, ${part}`, () => mountAxis(main, { ...context, name, part })];
  if (page === "rig" && rig) return ["Rig", () => mountRig(main, context)];
  if (page === "traffic" && rig) return ["Traffic", () => mountTraffic(main, context)];
  const why = page === "rig" || page === "traffic" ? "There is no rig here: only simulated drives have one." : `There is no page ${location.hash} here.`;
  return ["No such page", () => mountNothing(why)];
}

function mountNothing(why) {
  replace(main, h("p", {}, why), h("p", {}, h("a", { href: "#/" }, "All drives")));
  return () => {};
}

/* The header. */

/** How often it is looked whether the server still says something. */
const LIVE_MS = 250;
const linkLamp = h("span", { class: "link", role: "status" }, "connecting");
// It changes all the time, and is no news to a screen reader.
const linkAge = h("span", { class: "link-age number", id: "link-age" });

function showLink() {
  const live = store.isLive();
  const waits = store.linked === null;
  setText(linkLamp, waits ? "connecting" : live ? "connected" : store.linked ? "not live" : "connection lost");
  setText(linkAge, live || waits ? "" : `${span(store.silence())} old`);
  setClass(linkLamp, "lost", !live && !waits);
  setClass(document.body, "unlinked", !live);
}

/* What a stream that is refused would show is missing: why, stands above the page for as long. */

const missing = document.getElementById("missing");
const refusals = new Map();

function showRefusal(path, error) {
  if (error === null ? !refusals.delete(path) : refusals.get(path) === error.message) return;
  if (error !== null) {
    refusals.set(path, error.message);
    notify("error", error.message);
  }
  missing.hidden = refusals.size === 0;
  setText(missing, `Some of this page is missing: ${[...new Set(refusals.values())].join("; ")}. It is asked for again and again.`);
}

function header() {
  const nav = h("nav", { "aria-label": "Pages" }, h("a", { href: "#/" }, "Drives"));
  if (rig) nav.append(h("a", { href: "#/rig" }, "Rig"), h("a", { href: "#/traffic" }, "Traffic"));
  replace(document.getElementById("top"),
    h("a", { class: "brand", href: "#/", "aria-label": "stepdrive, all drives" }, "stepdrive"),
    nav,
    h("div", { class: "link-box" }, linkLamp, linkAge),
    h("button", { type: "button", class: "plain", id: "theme", onclick: nextTheme }, themeName()),
    h("button", { type: "button", class: "stop", id: "stop-all", title: "Brakes every drive (SOFT_STOP, STOP)", onclick: () => stopAll() }, "Stop all"));
}

/* Light and dark. */

const THEMES = ["auto", "light", "dark"];
const theme = () => localStorage.getItem(THEME) ?? "auto";
const themeName = () => `Theme: ${theme()}`;

function applyTheme() {
  if (theme() === "auto") delete document.documentElement.dataset.theme;
  else document.documentElement.dataset.theme = theme();
  document.dispatchEvent(new Event("theme"));
}

function nextTheme() {
  localStorage.setItem(THEME, THEMES[(THEMES.indexOf(theme()) + 1) % THEMES.length]);
  applyTheme();
  setText(document.getElementById("theme"), themeName());
}

/* Stops by key. The space bar and Escape stop the drive of this page, or all where the page is about all; Escape also while
   text is being written, where a space is a space. */

const TEXTS = ["text", "search", "password", "number"];
const writes = (element) => element instanceof HTMLTextAreaElement || (element instanceof HTMLInputElement && TEXTS.includes(element.type));

/** Whether Escape has something to close first: a list of completions, or the tip of what has the focus. One that only the
 * mouse points at is left open: it would never let a stop through. */
function closes(element) {
  const tip = document.getElementById(element.getAttribute?.("aria-describedby") ?? "");
  return Boolean(document.querySelector(".popup:not([hidden])")) || (tip?.getAttribute("role") === "tooltip" && !tip.hidden);
}

const inDialog = () => Boolean(document.querySelector("dialog[open]"));

function stopByKey(event) {
  const space = event.code === "Space" && !writes(event.target);
  const escape = event.key === "Escape" && !event.isComposing && !closes(event.target);
  if (inDialog() || !(space || escape)) return;
  event.preventDefault();
  if (space) event.stopPropagation();
  if (event.repeat) return;
  if (current !== null) stop(current);
  else stopAll();
}

/* What the space bar would else do: a button that has the focus is not pressed when it comes up, and boxes are ticked by
 * Enter. */
function keepSpace(event) {
  if (event.code === "Space" && !writes(event.target) && !inDialog()) event.preventDefault();
}

function tickByEnter(event) {
  if (event.key !== "Enter" || !(event.target instanceof HTMLInputElement) || event.target.type !== "checkbox") return;
  event.preventDefault();
  event.target.click();
}

/** Which page was shown before. */
let before = "";

/** After another page was chosen the focus is at its beginning, or where the arrow keys were going through tabs, there. */
function turn() {
  const focused = document.activeElement;
  const byKeys = Boolean(focused?.closest(".tabs") && focused.matches(":focus-visible"));
  route();
  const tab = byKeys ? main.querySelector('.tabs [aria-selected="true"]') : null;
  (tab ?? main).focus({ preventScroll: true });
  const page = location.hash.split("/").slice(0, 3).join("/");
  // Drives are shown where they were left; the parts of a drive have their head in common.
  if (page !== before && page.length > 2) scrollTo(0, 0);
  before = page;
}

/* The token. */

function askForToken(refused) {
  return new Promise((done) => {
    const field = h("input", { type: "password", id: "token", autocomplete: "off", required: true });
    const dialog = h("dialog", { "aria-labelledby": "token-title" },
      h("form", { method: "dialog" },
        h("h2", { id: "token-title" }, "This panel asks for its token"),
        refused ? h("p", { class: "error", role: "alert" }, "This is not the token.") : null,
        h("p", {}, "It is the api_token of the rig file, or what the panel was started with."),
        h("label", { for: "token" }, "Token"), field,
        h("div", { class: "row" }, h("button", { class: "primary" }, "Go on"))));
    dialog.addEventListener("close", () => {
      dialog.remove();
      done(field.value.trim() || null);
    });
    document.body.append(dialog);
    dialog.showModal();
  });
}

/** Finds out whether there is a rig, and shows its pages. Answers whether it was found out. */
async function lookForRig() {
  if (rig !== null) return false;
  try {
    rig = await has("/openapi.json");
  } catch {
    // Asked again when the stream of events stands.
    return false;
  }
  header();
  return true;
}

async function begin() {
  onTokenWanted(askForToken);
  onSuccess((action) => withdraw(action));
  onRefused(showRefusal);
  applyTheme();
  store.watch("link", showLink);
  store.watch("link", async (up) => {
    if (up && await lookForRig()) route();
  });
  setInterval(showLink, LIVE_MS);
  store.watch("notice", ({ level, name, text }) => notify(level, text.startsWith(`${name} `) ? text : `${name}: ${text}`));
  store.watch("axes", () => {
    const real = store.axes.some((axis) => !axis.virtual);
    document.body.classList.toggle("real", real);
  });
  addEventListener("keydown", stopByKey, { capture: true });
  addEventListener("keyup", keepSpace, { capture: true });
  addEventListener("keydown", tickByEnter);
  addEventListener("hashchange", turn);
  document.querySelector(".skip").addEventListener("click", (event) => {
    event.preventDefault();
    main.focus();
  });
  header();
  await lookForRig();
  route();
}

begin();

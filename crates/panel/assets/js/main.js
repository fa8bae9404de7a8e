// The shell of the page: header, routes, notices, and the stops that always work.

import { h, replace, setClass, setText } from "./dom.js";
import { has, ofAxis, onTokenWanted, urgently } from "./net.js";
import * as store from "./store.js";
import { mountOverview } from "./overview.js";
import { mountAxis } from "./axis.js";
import { mountRig } from "./rig.js";
import { mountTraffic } from "./traffic.js";

const THEME = "stepdrive-theme";
/** How long a notice stays. */
const NOTICE_MS = 6000;
const ERROR_MS = 15_000;
const main = document.getElementById("main");
const notices = document.getElementById("notices");

/** Whether there is a rig here, whose time and faults can be had: then its API describes itself. */
let rig = false;
let unmount = () => {};
/** The axis that the page is about, which the space bar stops. */
let current = null;

/** Tells the person something: "info", "error" or "good". What was told already and is still there is told anew. */
export function notify(level, text) {
  for (const told of [...notices.children]) if (told.querySelector("p").textContent === text) told.remove();
  const note = h("div", { class: `notice ${level}` },
    h("p", {}, text),
    h("button", { type: "button", class: "plain", "aria-label": "Close this notice", onclick: () => note.remove() }, "✕"));
  notices.append(note);
  while (notices.children.length > 5) notices.firstChild.remove();
  setTimeout(() => note.remove(), level === "error" ? ERROR_MS : NOTICE_MS);
}

/** Does something and tells when it fails. Answers what it gave, or undefined. */
export async function attempt(what) {
  try {
    return await what();
  } catch (error) {
    notify("error", error.message);
    return undefined;
  }
}

/** Stops an axis, whatever else goes on. */
export function stop(name, how = "soft") {
  document.dispatchEvent(new Event("stopping"));
  return attempt(() => urgently("POST", ofAxis(name, "/stop"), { how }));
}

/** Stops all axes, those that move first: a browser sends only a few requests at once. */
export async function stopAll() {
  const moves = (axis) => Number(Boolean((store.stateOf(axis)?.b ?? store.BIT.MOVING) & store.BIT.MOVING));
  const order = [...store.axes].sort((one, other) => moves(other) - moves(one));
  await Promise.all(order.map((axis) => stop(axis.name)));
}

const context = { notify, attempt, stop, stopAll, navigate: (hash) => { location.hash = hash; }, hasRig: () => rig };

/* Routes. */

function route() {
  const [page, name, part] = location.hash.replace(/^#\/?/, "").split("/").map(decodeURIComponent);
  unmount();
  current = null;
  if (page === "axis" && name) {
    current = name;
    store.focus(name);
    unmount = mountAxis(main, { ...context, name, part: part ?? "drive" });
    document.title = `${name} – stepdrive`;
  } else {
    store.focus(null);
    if (page === "rig" && rig) unmount = mountRig(main, context);
    else if (page === "traffic" && rig) unmount = mountTraffic(main, context);
    else unmount = mountOverview(main, context);
    document.title = "stepdrive";
  }
  for (const link of document.querySelectorAll("#top nav a")) {
    const here = link.getAttribute("href") === `#/${page === "rig" || page === "traffic" ? page : ""}`;
    if (here) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
}

/* The header. */

const linkLamp = h("span", { class: "link", role: "status" }, "connecting");

function showLink(up, error) {
  setText(linkLamp, up ? "connected" : "connection lost");
  setClass(linkLamp, "lost", !up);
  document.body.classList.toggle("unlinked", !up);
  if (error?.status === 503) notify("error", error.message);
}

function header() {
  const nav = h("nav", { "aria-label": "Pages" }, h("a", { href: "#/" }, "Drives"));
  if (rig) nav.append(h("a", { href: "#/rig" }, "Rig"), h("a", { href: "#/traffic" }, "Traffic"));
  replace(document.getElementById("top"),
    h("a", { class: "brand", href: "#/", "aria-label": "stepdrive, all drives" }, "stepdrive"),
    nav,
    linkLamp,
    h("button", { type: "button", class: "plain", id: "theme", onclick: nextTheme }, themeName()),
    h("button", { type: "button", class: "stop", id: "stop-all", title: "Brakes every drive (SOFT_STOP, STOP)", onclick: stopAll }, "Stop all"));
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

/* Stops by key. The space bar stops the drive of this page, or all where the page is about all; Escape stops the drive of
   this page too, also while text is being written. */

const writes = (element) =>
  element instanceof HTMLTextAreaElement ||
  (element instanceof HTMLInputElement && ["text", "search", "password"].includes(element.type));

function stopByKey(event) {
  const space = event.code === "Space" && !writes(event.target);
  if (!space && !(event.key === "Escape" && current !== null)) return;
  if (document.querySelector("dialog[open]")) return;
  if (space) {
    event.preventDefault();
    event.stopPropagation();
  }
  if (event.repeat) return;
  if (current !== null) stop(current);
  else stopAll();
}

/* What the space bar would else do: a button that has the focus is not pressed when it comes up, and boxes are ticked by
 * Enter. */
function keepSpace(event) {
  if (event.code === "Space" && !writes(event.target)) event.preventDefault();
}

function tickByEnter(event) {
  if (event.key !== "Enter" || !(event.target instanceof HTMLInputElement) || event.target.type !== "checkbox") return;
  event.preventDefault();
  event.target.click();
}

/** After another page was chosen the focus is at its beginning, or where the arrow keys were going through tabs, there. */
function turn() {
  const before = document.activeElement;
  const byKeys = Boolean(before?.closest(".tabs") && before.matches(":focus-visible"));
  route();
  const tab = byKeys ? main.querySelector('.tabs [aria-selected="true"]') : null;
  (tab ?? main).focus({ preventScroll: true });
}

/* The token. */

function askForToken() {
  return new Promise((done) => {
    const field = h("input", { type: "password", id: "token", autocomplete: "off", required: true });
    const dialog = h("dialog", { "aria-labelledby": "token-title" },
      h("form", { method: "dialog" },
        h("h2", { id: "token-title" }, "This panel asks for its token"),
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

async function begin() {
  onTokenWanted(askForToken);
  applyTheme();
  store.watch("link", showLink);
  store.watch("notice", (event) => notify(event.level, `${event.name}: ${event.text}`));
  store.watch("axes", () => {
    const real = store.axes.some((axis) => !axis.virtual);
    document.body.classList.toggle("real", real);
  });
  addEventListener("keydown", stopByKey, { capture: true });
  addEventListener("keyup", keepSpace, { capture: true });
  addEventListener("keydown", tickByEnter);
  addEventListener("hashchange", turn);
  header();
  try {
    rig = await has("/openapi.json");
  } catch {
    // The stream of events goes on trying, and tells.
  }
  header();
  route();
}

begin();
